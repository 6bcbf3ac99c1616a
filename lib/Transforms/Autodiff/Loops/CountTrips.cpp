//===- CountTrips.cpp - Tape size of a launch -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint with a global tape notes the trips of each loop that has a part in
// it. A copy of the adjoint without any other effect, and without what only
// those used, counts: bounds are computed, loops with a condition run forward,
// nothing is reversed. The runtime adds up the trips of all threads, and the
// adjoint gets them with where each thread's part begins. It notes nothing
// itself.
//
//===----------------------------------------------------------------------===//

#include "CountTrips.h"

#include "Autodiff/DeadValues.h"
#include "Autodiff/HiddenArguments.h"
#include "Autodiff/Reverse/Reverse.h"
#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

using namespace mlir;
using namespace warp::autodiff;

/// The arguments of a kind, by the loop that they are for.
static SmallVector<std::pair<int64_t, BlockArgument>>
findHidden(func::FuncOp function, warp::HiddenKind kind) {
  SmallVector<std::pair<int64_t, BlockArgument>> found;
  for (BlockArgument argument : function.getArguments()) {
    warp::HiddenAttr hidden = getHidden(argument);
    if (hidden && hidden.getKind() == kind)
      found.emplace_back(hidden.getLeaf(), argument);
  }
  return found;
}

/// Erases all that has an effect, other than on one of `kept`.
static void eraseEffects(func::FuncOp function,
                         ArrayRef<std::pair<int64_t, BlockArgument>> kept) {
  SmallVector<Operation *> effects;
  function.getBody().walk([&](Operation *op) {
    auto store = dyn_cast<warp::StoreOp>(op);
    bool isKept = store && llvm::any_of(kept, [&](auto &entry) {
                    return entry.second == store.getArray();
                  });
    if (hasOwnEffect(op) && !isKept)
      effects.push_back(op);
  });
  OpBuilder b(function.getContext());
  for (Operation *op : effects) {
    // Only cotangents come from these.
    b.setInsertionPoint(op);
    for (Value result : op->getResults())
      if (differentialType(result.getType()))
        result.replaceAllUsesWith(zero(b, op->getLoc(), result.getType()));
    if (op->use_empty())
      op->erase();
  }
}

func::FuncOp warp::autodiff::takeCounting(func::FuncOp adjoint) {
  auto noted = findHidden(adjoint, HiddenKind::Trips);
  if (noted.empty())
    return nullptr;
  func::FuncOp counting = adjoint.clone();
  counting.setName((adjoint.getName() + "_count").str());
  for (StringRef name : {StringRef(kernelAttrName), StringRef(attr::metrics),
                         StringRef(attr::oneThread), StringRef(attr::notices),
                         StringRef(attr::places)})
    counting->removeAttr(name);
  counting->setAttr(attr::counting, UnitAttr::get(adjoint.getContext()));
  adjoint->getParentOfType<ModuleOp>().insert(std::next(adjoint->getIterator()),
                                              counting);
  auto trips = findHidden(counting, HiddenKind::Trips);
  eraseEffects(counting, trips);
  eraseDead(counting.getBody());

  for (auto [site, array] : noted)
    for (Operation *user : llvm::make_early_inc_range(array.getUsers()))
      if (isa<StoreOp>(user))
        user->erase();
  eraseDead(adjoint.getBody());
  for (func::FuncOp function : {adjoint, counting})
    function.walk([](StoreOp store) { store->removeAttr(attr::taped); });
  return counting;
}
