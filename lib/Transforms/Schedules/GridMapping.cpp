//===- GridMapping.cpp - Launch indices of the threads of a grid ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::GridMapping;

void GridMapping::rewrite() {
  Region &body = threads.getBody();
  Block *mapped = b.createBlock(&body, body.begin());
  for (int64_t d = 0; d < rank; ++d)
    dims.push_back(LaunchExtentOp::create(b, loc, b.getI32Type(), d));
  Values sums = build();
  b.setInsertionPointToEnd(mapped);
  YieldOp::create(b, loc, sums);
  thread->erase();
}

bool GridMapping::hasPlainThreads() const {
  return index32 && !flat && !variant.getDebug() &&
         !site.function->hasAttr(attr::blockThreads);
}

Value GridMapping::gridIndex(Axis axis, Type type) {
  Value block = narrow(read(GridValue::blockId, axis), type);
  Value start = mul(block, narrow(read(GridValue::blockDim, axis), type));
  return add(start, narrow(read(GridValue::threadId, axis), type));
}

void GridMapping::enterIf(Value condition) {
  auto branch = scf::IfOp::create(b, loc, condition, /*withElseRegion=*/false);
  b.setInsertionPointToStart(branch.thenBlock());
}

Value GridMapping::enterLoop(Value begin, Value end, Value step) {
  auto loop = scf::ForOp::create(b, loc, begin, end, step);
  b.setInsertionPointToStart(loop.getBody());
  return loop.getInductionVar();
}

bool warp::hasLoop(Operation &op) {
  return op.walk([](LoopLikeOpInterface) { return WalkResult::interrupt(); })
      .wasInterrupted();
}

bool warp::onlyLoads(Operation &op, bool loops) {
  WalkResult result = op.walk([](Operation *inner) {
    bool reads = isa<LoadComponentsOp>(inner) ||
                 inner->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                 isMemoryEffectFree(inner);
    return reads ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted() && (loops || !hasLoop(op));
}

Value warp::cloneComputation(OpBuilder &b, Value value, Operation &scope,
                             IRMapping &map) {
  Operation *op = value.getDefiningOp();
  if (op && !map.contains(value) && scope.isProperAncestor(op)) {
    for (Value operand : op->getOperands())
      cloneComputation(b, operand, scope, map);
    b.clone(*op, map);
  }
  return map.lookupOrDefault(value);
}

void warp::cloneInterleaved(OpBuilder &b, Operation &op,
                            MutableArrayRef<IRMapping> copies) {
  for (IRMapping &copy : copies)
    b.clone(op, copy);
}

void warp::cloneShared(OpBuilder &b, Operation &op,
                       MutableArrayRef<IRMapping> copies) {
  bool agree =
      op.getNumRegions() == 0 &&
      llvm::all_of(op.getOperands(), [&](Value operand) {
        return llvm::all_equal(llvm::map_range(copies, [&](IRMapping &copy) {
          return copy.lookupOrDefault(operand);
        }));
      });
  if (!agree)
    return cloneInterleaved(b, op, copies);
  Operation *shared = b.clone(op, copies.front());
  for (IRMapping &copy : copies.drop_front())
    copy.map(op.getResults(), shared->getResults());
}
