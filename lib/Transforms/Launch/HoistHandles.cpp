//===- HoistHandles.cpp - Hoisting of handle lookups ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "HoistHandles.h"
#include "KernelFunction.h"

#include "Analysis/GeometryMemory.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;

/// True if a value is an argument of the kernel, or found from handles that
/// are: the same wherever that is done.
static bool isFixed(Value value) {
  Operation *op = value.getDefiningOp();
  if (!op)
    return isa<FunctionOpInterface>(value.getParentBlock()->getParentOp());
  if (op->hasTrait<OpTrait::ConstantLike>())
    return true;
  auto call = dyn_cast<warp::LibraryCallOp>(op);
  auto load = dyn_cast<warp::LoadComponentsOp>(op);
  bool isOfHandle = (call && warp::findsSlot(call)) ||
                    (load && warp::isGeometryMemory(load.getArray())) ||
                    isa<warp::ArrayAtOp>(op);
  return isOfHandle && llvm::all_of(op->getOperands(), isFixed);
}

/// The outermost loop that an operation is in.
static Operation *loopAround(Operation *op) {
  Operation *loop = nullptr;
  for (Operation *parent = op->getParentOp();
       parent && !isa<FunctionOpInterface>(parent);
       parent = parent->getParentOp())
    if (isa<LoopLikeOpInterface>(parent))
      loop = parent;
  return loop;
}

/// Moves what a value is found from, then the operation that finds it.
static void moveBefore(Value value, Operation *loop) {
  Operation *op = value.getDefiningOp();
  if (!op || !loop->isProperAncestor(op))
    return;
  for (Value operand : op->getOperands())
    moveBefore(operand, loop);
  op->moveBefore(loop);
}

void warp::hoistHandles(FunctionOpInterface kernel) {
  // The transform of a volume is twelve numbers of 64 bits, for which threads
  // of a GPU would give up a third of those that hide each other's waiting.
  if (getTarget(kernel).isSimt())
    return;
  SmallVector<Value> fixed;
  kernel.walk([&](Operation *op) {
    if (isa<LibraryCallOp, LoadComponentsOp>(op) && op->getNumResults() != 0 &&
        isFixed(op->getResult(0)))
      fixed.push_back(op->getResult(0));
  });
  for (Value value : fixed)
    if (Operation *loop = loopAround(value.getDefiningOp()))
      moveBefore(value, loop);
}
