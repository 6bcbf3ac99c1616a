//===- ForwardStores.cpp - Store-to-load forwarding -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One walk in program order keeps a list of elements whose contents are known:
// they were stored, or loaded, and not written since. A branch starts with the
// list as it is, a loop with what nothing in it writes; after either, what it
// may have written is unknown.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "Autodiff/Loops/CarryElements.h"
#include "Autodiff/OwnUpdates.h"
#include "KernelFunction.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_FORWARDSTORES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp::autodiff;

namespace {

struct Known {
  Access access;
  unsigned leaf;
  Value value;
};
using Contents = SmallVector<Known>;

struct ForwardStores : warp::impl::ForwardStoresBase<ForwardStores> {
  using ForwardStoresBase::ForwardStoresBase;

  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    warp::ArrayLeaves leavesOfKernel(kernel);
    leaves = &leavesOfKernel;
    if (unique) {
      splitOwnUpdates(kernel, leavesOfKernel);
      carryElements(kernel, leavesOfKernel);
    }
    Contents contents;
    forward(kernel.getFunctionBody().front(), contents);
  }

  void forward(Block &block, Contents &contents) {
    for (Operation &op : llvm::make_early_inc_range(block)) {
      if (op.getNumRegions() != 0)
        forwardRegions(&op, contents);
      else if (warp::isPlainRead(&op))
        forwardLoad(cast<warp::AccessOp>(op), contents);
      else
        forget(&op, contents);
    }
  }

  void forwardRegions(Operation *op, Contents &contents) {
    Contents before = contents;
    op->walk([&](Operation *inner) { forget(inner, contents); });
    // Facts about an element inside do not hold before and after.
    llvm::erase_if(contents, [&](Known &known) {
      return op->isProperAncestor(known.access.op);
    });
    bool isLoop = isa<LoopLikeOpInterface>(op);
    for (Region &region : op->getRegions())
      for (Block &block : region) {
        Contents inner = isLoop ? contents : before;
        forward(block, inner);
      }
  }

  void forwardLoad(warp::AccessOp load, Contents &contents) {
    std::optional<Access> access = getAccess(load);
    auto leaf = leaves->of(load.getArray());
    if (leaf.size() != 1 || load.getMask())
      return;
    Value result = load.getRead().front();
    for (Known &known : contents)
      if (known.leaf == leaf.front() && areSame(known.access, *access) &&
          known.value.getType() == result.getType()) {
        result.replaceAllUsesWith(known.value);
        load->erase();
        return;
      }
    contents.push_back({*access, leaf.front(), result});
  }

  /// Takes what an operation may write out of the list, and adds what it does.
  void forget(Operation *op, Contents &contents) {
    if (warp::isCallWithArrays(op))
      return contents.clear();
    std::optional<Access> access = getAccess(op);
    if (!access || !access->isWrite)
      return;
    auto leaf = leaves->of(access->array);
    // Nothing is known of gradients, which no argument's elements overlap.
    if (unique && warp::gradientOwner(access->array))
      return;
    llvm::erase_if(contents, [&](Known &known) {
      if (leaf.size() != 1 || !unique)
        return leaf.size() != 1 || known.leaf != leaf.front() ||
               !areApart(known.access, *access);
      return known.leaf == leaf.front() && !areApart(known.access, *access);
    });
    auto store = dyn_cast<warp::AccessOp>(op);
    if (store && leaf.size() == 1 &&
        store.getEffect() == warp::AccessEffect::Write && !store.getMask())
      contents.push_back({*access, leaf.front(), store.getWritten().front()});
  }

  const warp::ArrayLeaves *leaves = nullptr;
};

} // namespace
