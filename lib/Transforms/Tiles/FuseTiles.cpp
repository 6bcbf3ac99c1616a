//===- FuseTiles.cpp - Elementwise fusion of tile operations --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A `tile_map` whose results only one other `tile_map` uses becomes part of
// that. Both treat corresponding elements in the same thread, so the block of
// one is put in front of the block of the other; operands that both have become
// one, so that what is loaded for both has one use.
//
// Before that, what a `tile_map` computes again is read: adjoints recompute
// what they need of a function of elements, also where its results are kept.
// And a product that is added to a tile adds to it itself, also to one that is
// carried in another shape (CarryReshaped.h).
//
//===----------------------------------------------------------------------===//

#include "CarryReshaped.h"
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

//===----------------------------------------------------------------------===//
// Results that are kept
//===----------------------------------------------------------------------===//

/// True if values of the blocks of two maps are computed alike from the same
/// operands.
static bool isSame(Value x, TileMapOp ofX, Value y, TileMapOp ofY) {
  if (x == y)
    return true;
  auto argument = [](Value value, TileMapOp map) {
    auto found = dyn_cast<BlockArgument>(value);
    return found && found.getOwner() == &map.getBody().front()
               ? map.getInputs()[found.getArgNumber()]
               : Value();
  };
  if (Value input = argument(x, ofX))
    return input == argument(y, ofY);
  Operation *a = x.getDefiningOp(), *b = y.getDefiningOp();
  return a && b && a->getBlock() == &ofX.getBody().front() &&
         b->getBlock() == &ofY.getBody().front() &&
         a->getName() == b->getName() && a->getNumResults() == 1 &&
         a->getNumRegions() == 0 && isMemoryEffectFree(a) &&
         a->getResultTypes() == b->getResultTypes() &&
         a->getAttrDictionary() == b->getAttrDictionary() &&
         a->getPropertiesAsAttribute() == b->getPropertiesAsAttribute() &&
         a->getNumOperands() == b->getNumOperands() &&
         llvm::all_of(
             llvm::zip(a->getOperands(), b->getOperands()), [&](auto pair) {
               return isSame(std::get<0>(pair), ofX, std::get<1>(pair), ofY);
             });
}

/// True if a tile is kept whatever a later map reads: one use could be where it
/// is computed.
static bool isKept(Value tile) {
  llvm::SmallPtrSet<Operation *, 4> users(tile.getUsers().begin(),
                                          tile.getUsers().end());
  return users.size() > 1;
}

/// Gives a map without what it computes like an earlier one; whether there was
/// anything.
static bool readResults(TileMapOp map, TileMapOp earlier) {
  Block &body = map.getBody().front();
  Operation *made = earlier.getBody().front().getTerminator();
  bool changed = false;
  for (auto [result, yielded] :
       llvm::zip_equal(earlier.getResults(), made->getOperands())) {
    auto from = cast<TileType>(result.getType());
    if (!yielded.getDefiningOp() || !isKept(result) ||
        from.getShape() != tileType(map.getResult(0)).getShape())
      continue;
    for (Operation &op : body.without_terminator()) {
      if (op.getNumResults() != 1 ||
          !isSame(op.getResult(0), map, yielded, earlier))
        continue;
      map.getInputsMutable().append(result);
      op.replaceAllUsesWith(
          ValueRange(body.addArgument(from.getElementType(), map.getLoc())));
      changed = true;
      break;
    }
  }
  return changed;
}

/// Removes what nothing in a map's block uses.
static void tidy(TileMapOp map) {
  Block &body = map.getBody().front();
  for (Operation &op : llvm::make_early_inc_range(llvm::reverse(body)))
    if (isOpTriviallyDead(&op))
      op.erase();
  for (unsigned i = body.getNumArguments(); i-- > 0;)
    if (body.getArgument(i).use_empty() && body.getNumArguments() > 1) {
      body.eraseArgument(i);
      map.getInputsMutable().erase(i);
    }
}

static void readKeptResults(ArrayRef<TileMapOp> maps) {
  for (auto [i, map] : llvm::enumerate(maps)) {
    if (!isMemoryEffectFree(map))
      continue;
    bool changed = false;
    for (TileMapOp earlier : maps.take_front(i))
      if (earlier->getBlock() == map->getBlock() && isMemoryEffectFree(earlier))
        changed |= readResults(map, earlier);
    if (changed)
      tidy(map);
  }
}

//===----------------------------------------------------------------------===//
// Products that are added
//===----------------------------------------------------------------------===//

/// True if a map gives the sum of two tiles.
static bool isSum(TileMapOp map) {
  Block &body = map.getBody().front();
  if (map.getInputs().size() != 2 || map.getNumResults() != 1 ||
      !isMemoryEffectFree(map))
    return false;
  auto sum = body.getTerminator()->getOperand(0).getDefiningOp<AddOp>();
  if (!sum || sum->getBlock() != &body)
    return false;
  Value x = sum->getOperand(0), y = sum->getOperand(1);
  Value a = body.getArgument(0), b = body.getArgument(1);
  return (x == a && y == b) || (x == b && y == a);
}

/// A product of 16 bits would not be rounded.
static bool addProduct(TileMapOp map) {
  for (unsigned i : {1, 0}) {
    if (!isSum(map))
      return false;
    auto product = map.getInputs()[i].getDefiningOp<TileMatmulOp>();
    Value other = map.getInputs()[1 - i];
    if (!product || product.getC() || !product->hasOneUse() ||
        product->getBlock() != map->getBlock() ||
        other.getType() != product.getType() ||
        map.getResultTypes()[0] != product.getType() ||
        tileType(other).getElementType().getIntOrFloatBitWidth() < 32)
      continue;
    OpBuilder b(map);
    auto added = TileMatmulOp::create(
        b, map.getLoc(), product.getType(), product.getA(), product.getB(),
        other, product.getAlpha(), Value(), product.getTransposeAAttr(),
        product.getTransposeBAttr());
    map.replaceAllUsesWith(ValueRange(added.getResult()));
    map.erase();
    product.erase();
    return true;
  }
  return false;
}

namespace {

struct FuseTiles : warp::impl::FuseTilesBase<FuseTiles> {
  void runOnOperation() override {
    auto work = [](FunctionOpInterface kernel, int64_t) {
      carryReshaped(kernel);
      SmallVector<TileMapOp> maps;
      kernel->walk([&](TileMapOp map) { maps.push_back(map); });
      llvm::erase_if(maps, addProduct);
      readKeptResults(maps);
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
