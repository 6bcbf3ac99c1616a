//===- AdjointSums.cpp - Fewer sums in an adjoint -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "AdjointSums.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "Autodiff/Rules/Rules.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;

namespace warp::autodiff {

void mergeSums(Block &block) {
  AccumulateOp last;
  for (Operation &op : llvm::make_early_inc_range(block)) {
    for (Region &region : op.getRegions())
      for (Block &inner : region)
        mergeSums(inner);
    auto sum = dyn_cast<AccumulateOp>(op);
    if (!sum) {
      bool readsPrimal =
          isPlainRead(&op) && !gradientOwner(cast<AccessOp>(op).getArray());
      if (!isMemoryEffectFree(&op) && !readsPrimal)
        last = nullptr;
      continue;
    }
    if (last && last.getArray() == sum.getArray() &&
        last.getIndices() == sum.getIndices()) {
      OpBuilder b(sum);
      Value total = add(b, sum.getLoc(), last.getValue(), sum.getValue());
      sum.getValueMutable().assign(total);
      last.erase();
    }
    last = sum;
  }
}

static bool isZeroConstant(Value value) {
  if (auto whole = value.getDefiningOp<ConstructOp>())
    return whole->getNumOperands() == 0;
  auto constant = value.getDefiningOp<ConstantOp>();
  auto number =
      constant ? dyn_cast<FloatAttr>(constant.getValue()) : FloatAttr();
  return number && number.getValue().isZero();
}

/// The first operation from `op` on that may touch gradients in `array`.
static Operation *findUse(Operation *op, Value array) {
  Value owner = gradientOwner(array);
  for (; op; op = op->getNextNode()) {
    auto access = dyn_cast<AccessOp>(op);
    bool isElsewhere = access && gradientOwner(access.getArray()) != owner;
    if (!isMemoryEffectFree(op) && !isElsewhere)
      return op;
  }
  return nullptr;
}

void storeSums(func::FuncOp adjoint) {
  SmallVector<StoreOp> stores;
  adjoint.walk([&](StoreOp store) {
    if (isZeroConstant(store.getValue()) && gradientOwner(store.getArray()))
      stores.push_back(store);
  });
  for (StoreOp store : stores) {
    Value array = store.getArray();
    auto sum =
        dyn_cast_or_null<AccumulateOp>(findUse(store->getNextNode(), array));
    if (!sum || !sum.getUnique() || sum.getArray() != array ||
        sum.getIndices() != store.getIndices())
      continue;
    auto taken = sum.getValue().getDefiningOp<LoadOp>();
    bool isSame = taken && taken->getBlock() == store->getBlock() &&
                  taken.getArray() == array &&
                  taken.getIndices() == store.getIndices() &&
                  findUse(taken->getNextNode(), array) == store;
    if (!isSame) {
      OpBuilder b(sum);
      StoreOp::create(b, sum.getLoc(), sum.getValue(), array, sum.getIndices());
    }
    store.erase();
    sum.erase();
  }
}

} // namespace warp::autodiff
