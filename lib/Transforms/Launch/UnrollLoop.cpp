//===- UnrollLoop.cpp - Full unrolling of a loop --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Indices that follow a counter become constants, on which passes depend that
// tell addresses apart.
//
//===----------------------------------------------------------------------===//

#include "UnrollLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

static std::optional<int64_t> getConstant(Value value) {
  APInt number;
  if (!matchPattern(value, m_ConstantInt(&number)))
    return std::nullopt;
  return number.getSExtValue();
}

std::optional<int64_t> warp::getConstantTrips(scf::ForOp loop) {
  std::optional<APInt> trips = loop.getStaticTripCount();
  if (!trips || trips->getActiveBits() > 63 ||
      !getConstant(loop.getLowerBound()) || !getConstant(loop.getStep()))
    return std::nullopt;
  return int64_t(trips->getZExtValue());
}

void warp::unroll(scf::ForOp loop) {
  OpBuilder b(loop);
  Type type = loop.getInductionVar().getType();
  int64_t trips = *getConstantTrips(loop);
  int64_t counter = *getConstant(loop.getLowerBound());
  int64_t step = *getConstant(loop.getStep());
  SmallVector<Value> carried(loop.getInitArgs());
  for (int64_t trip = 0; trip < trips; ++trip, counter += step) {
    IRMapping map;
    map.map(loop.getRegionIterArgs(), carried);
    map.map(loop.getInductionVar(),
            arith::ConstantOp::create(b, loop.getLoc(),
                                      b.getIntegerAttr(type, counter)));
    for (Operation &op : loop.getBody()->without_terminator()) {
      Operation *copy = b.clone(op, map);
      SmallVector<Value> folded;
      // Operations that fold in place have no other results.
      if (failed(b.tryFold(copy, folded)) || folded.empty())
        continue;
      map.map(op.getResults(), folded);
      copy->erase();
    }
    for (auto [value, next] : llvm::zip_equal(carried, loop.getYieldedValues()))
      value = map.lookupOrDefault(next);
  }
  loop.replaceAllUsesWith(carried);
  loop.erase();
}

/// The name is what llvm.br calls the attribute, to which the conversions of
/// loops copy it.
static void annotate(scf::ForOp loop, LLVM::LoopVectorizeAttr vectorize,
                     LLVM::LoopUnrollAttr unroll) {
  loop->setAttr("loop_annotation",
                LLVM::LoopAnnotationAttr::get(loop.getContext(), {}, vectorize,
                                              {}, unroll, {}, {}, {}, {}, {},
                                              {}, {}, {}, {}, {}, {}));
}

void warp::setCopies(scf::ForOp loop, int64_t copies) {
  Builder b(loop.getContext());
  annotate(loop, {},
           LLVM::LoopUnrollAttr::get(b.getContext(), {},
                                     b.getI32IntegerAttr(int32_t(copies)), {},
                                     {}, {}, {}, {}));
}

void warp::setRolled(scf::ForOp loop) {
  Builder b(loop.getContext());
  annotate(loop, {},
           LLVM::LoopUnrollAttr::get(b.getContext(), b.getBoolAttr(true), {},
                                     {}, {}, {}, {}, {}));
}

void warp::setPlain(scf::ForOp loop) {
  Builder b(loop.getContext());
  BoolAttr disable = b.getBoolAttr(true);
  annotate(loop,
           LLVM::LoopVectorizeAttr::get(b.getContext(), disable, {}, {}, {}, {},
                                        {}, {}),
           LLVM::LoopUnrollAttr::get(b.getContext(), disable, {}, {}, {}, {},
                                     {}, {}));
}
