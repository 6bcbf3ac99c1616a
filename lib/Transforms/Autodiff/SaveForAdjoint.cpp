//===- SaveForAdjoint.cpp - Residuals saved for the adjoint ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "SaveForAdjoint.h"

#include "HiddenArguments.h"
#include "KernelFunction.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

/// Arguments of the kernel like those of the adjoint, by number of the access.
static llvm::DenseMap<int64_t, BlockArgument> addSaved(func::FuncOp kernel,
                                                       func::FuncOp adjoint) {
  llvm::DenseMap<int64_t, BlockArgument> saved;
  for (BlockArgument argument : adjoint.getArguments())
    if (HiddenAttr hidden = getHidden(argument);
        hidden && hidden.getKind() == HiddenKind::Saved)
      saved[hidden.getLeaf()] = addHidden(kernel, hidden, argument.getType());
  return saved;
}

bool saveForAdjoint(func::FuncOp kernel, func::FuncOp adjoint,
                    const MemoryClasses &memory) {
  auto saved = addSaved(kernel, adjoint);
  if (saved.empty())
    return false;
  SmallVector<Operation *> reads;
  kernel.walk([&](AccessOp access) {
    if (!access.getRead().empty())
      reads.push_back(access);
  });
  for (Operation *op : reads) {
    BlockArgument array = saved.lookup(memory.getNumber(op));
    if (!array)
      continue;
    OpBuilder b(op->getContext());
    b.setInsertionPointAfter(op);
    SmallVector<Type> types(4, b.getIntegerType(32, true));
    auto tid = TidOp::create(b, op->getLoc(), types);
    StoreOp::create(b, op->getLoc(), op->getResult(0), array, tid.getResults());
  }
  kernel->removeAttr(kernelAttrName);
  kernel->setAttr(attr::augmented, UnitAttr::get(kernel.getContext()));
  return true;
}

} // namespace warp::autodiff
