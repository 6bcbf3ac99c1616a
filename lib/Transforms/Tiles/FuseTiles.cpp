//===- FuseTiles.cpp - Functions of elements become one -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A `tile_map` whose results only one other `tile_map` uses becomes part of
// that. Both treat corresponding elements in the same thread, so the block of
// one is put in front of the block of the other; operands that both have become
// one, so that what is loaded for both has one use.
//
//===----------------------------------------------------------------------===//

#include "TileBuffers.h"

#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_FUSETILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

/// An operand's map that can become part of the one that uses it, or null.
static TileMapOp findProducer(TileMapOp user) {
  for (Value input : user.getInputs()) {
    auto producer = input.getDefiningOp<TileMapOp>();
    if (producer && producer->getBlock() == user->getBlock() &&
        isMemoryEffectFree(producer) &&
        llvm::all_of(producer->getUsers(),
                     [&](Operation *other) { return other == user; }))
      return producer;
  }
  return nullptr;
}

/// The block of a map behind what a builder has made so far: its arguments are
/// looked up by operand, and what it yields is returned.
static SmallVector<Value> appendBody(OpBuilder &b, TileMapOp map,
                                     const IRMapping &byOperand) {
  IRMapping mapping;
  Block &body = map.getBody().front();
  for (auto [input, argument] :
       llvm::zip_equal(map.getInputs(), body.getArguments()))
    mapping.map(argument, byOperand.lookup(input));
  for (Operation &op : body.without_terminator())
    b.clone(op, mapping);
  return llvm::map_to_vector(body.getTerminator()->getOperands(), [&](Value v) {
    return mapping.lookupOrDefault(v);
  });
}

static TileMapOp merge(TileMapOp producer, TileMapOp user) {
  OpBuilder b(user);
  llvm::SetVector<Value> inputs(producer.getInputs().begin(),
                                producer.getInputs().end());
  for (Value input : user.getInputs())
    if (input.getDefiningOp() != producer)
      inputs.insert(input);
  auto merged = TileMapOp::create(b, user.getLoc(), user.getResultTypes(),
                                  inputs.getArrayRef());
  Block *body = b.createBlock(&merged.getBody());
  IRMapping byOperand;
  for (Value input : inputs) {
    auto tile = dyn_cast<TileType>(input.getType());
    Type type = tile ? tile.getElementType() : input.getType();
    byOperand.map(input, body->addArgument(type, input.getLoc()));
  }
  SmallVector<Value> made = appendBody(b, producer, byOperand);
  byOperand.map(producer.getResults(), made);
  TileYieldOp::create(b, user.getLoc(), appendBody(b, user, byOperand));
  user.replaceAllUsesWith(merged.getResults());
  user.erase();
  producer.erase();
  return merged;
}

namespace {

struct FuseTiles : warp::impl::FuseTilesBase<FuseTiles> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel, int64_t) {
      SmallVector<TileMapOp> maps;
      kernel->walk([&](TileMapOp map) { maps.push_back(map); });
      // A producer stands before its user, and is complete when it is merged.
      for (TileMapOp map : maps)
        while (TileMapOp producer = findProducer(map))
          map = merge(producer, map);
      return success();
    };
    if (failed(forTileKernel(getOperation(), work)))
      signalPassFailure();
  }
};

} // namespace
