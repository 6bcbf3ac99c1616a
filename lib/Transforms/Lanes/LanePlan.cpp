//===- LanePlan.cpp - Choice of scalar threads or lanes, and of the width -===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads stay scalar where lanes cannot be right: an array that differs from
// thread to thread has no form, and a loop that waits for what another thread
// writes would wait for ever if that thread were another lane. They also stay
// so where it does not pay (LaneCost.cpp).
//
//===----------------------------------------------------------------------===//

#include "LanePlan.h"

#include "LaneCalls.h"
#include "LaneCost.h"

#include "Analysis/Effects.h"
#include "Analysis/GeometryMemory.h"
#include "KernelFunction.h"
#include "Updates/Atomics.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using warp::LanePlan;
using warp::ThreadVariance;

//===----------------------------------------------------------------------===//
// Right
//===----------------------------------------------------------------------===//

/// Memory that another thread may change while a loop runs. That an array of
/// the launch is also points of a mesh, say, is nothing that threads wait for.
static bool isShared(Operation *op, const ThreadVariance &variance) {
  if (auto call = dyn_cast<func::CallOp>(op))
    return variance.readsWritten(call);
  auto access = dyn_cast<warp::AccessOp>(op);
  if (!access)
    return false;
  bool isFlag =
      variance.hasUnknownWrites() || !warp::isBehindHandle(access.getArray());
  return access.isUpdate() ||
         (access.mayRead() && isFlag && variance.isWritten(access.getArray()));
}

/// True if a loop goes on until another thread has done something: its
/// condition depends on what others may write, and is asked again after the
/// loop itself has read such a thing.
static bool mayWait(scf::WhileOp loop, const ThreadVariance &variance) {
  Value condition = loop.getConditionOp().getCondition();
  if (!variance.dependsOnWrites(condition))
    return false;
  llvm::DenseSet<Value> shared;
  auto isTainted = [&](ValueRange values) {
    return llvm::any_of(values, [&](Value v) { return shared.contains(v); });
  };
  for (size_t before = ~size_t(0); before != shared.size();) {
    before = shared.size();
    loop->walk([&](Operation *op) {
      bool tainted = isShared(op, variance) || isTainted(op->getOperands());
      for (Region &region : op->getRegions())
        for (Block &block : region) {
          ValueRange ends = block.getTerminator()->getOperands();
          tainted |= isTainted(ends);
          if (isTainted(ends))
            shared.insert_range(block.getArguments());
        }
      if (op != loop && tainted)
        shared.insert_range(op->getResults());
      if (tainted)
        op->walk([&](warp::ScratchStoreOp store) {
          shared.insert(store.getScratch());
        });
      if (auto inner = dyn_cast<scf::WhileOp>(op); inner && tainted) {
        shared.insert_range(inner.getBeforeArguments());
        shared.insert_range(inner.getAfterArguments());
      }
    });
  }
  return shared.contains(condition);
}

/// True if no other operation sees the gradients of an array.
static bool isOnlyGradient(warp::GradOp grad) {
  return isa<BlockArgument>(grad.getArray()) &&
         llvm::none_of(grad.getArray().getUsers(), [&](Operation *user) {
           return user != grad && isa<warp::GradOp>(user);
         });
}

/// True if threads come to an update once, and nothing else to its array: lanes
/// that make it one after another are as good as threads that do.
static bool isOnlyTurn(Operation *update, FunctionOpInterface kernel) {
  auto access = dyn_cast<warp::AccessOp>(update);
  if (!access || !warp::getVariant(kernel).getDisjoint() ||
      update->getParentOfType<LoopLikeOpInterface>())
    return false;
  Value array = access.getArray();
  auto grad = array.getDefiningOp<warp::GradOp>();
  return (grad ? isOnlyGradient(grad) : isa<BlockArgument>(array)) &&
         llvm::all_of(array.getUsers(), [&](Operation *user) {
           return user == update || isa<warp::DimOp>(user);
         });
}

/// Why lanes cannot do an operation; empty if they can.
static std::string findObstacle(Operation *op, const ThreadVariance &variance,
                                FunctionOpInterface kernel) {
  auto isVarying = [&](Value value) {
    return !variance.isUniform(value, warp::Scope::Lanes);
  };
  if (op->getNumRegions() != 0 && !isa<scf::IfOp, scf::ForOp, scf::WhileOp>(op))
    return "'" + op->getName().getStringRef().str() + "' has no form for lanes";
  for (Value operand : op->getOperands())
    if (isa<warp::ArrayType>(operand.getType()) && isVarying(operand))
      return "an array differs from thread to thread";
  if (llvm::any_of(op->getResultTypes(), llvm::IsaPred<warp::ArrayType>) &&
      isVarying(op->getResult(0)))
    return "an array differs from thread to thread";
  if (auto loop = dyn_cast<scf::WhileOp>(op); loop && mayWait(loop, variance))
    return "a loop may wait for another thread";
  bool isDeterministic = warp::getVariant(kernel).isDeterministic();
  bool isInTurn = warp::getVariant(kernel).keepsThreadOrder();
  if ((isDeterministic && warp::tellsTurn(op)) ||
      (isInTurn && warp::mayTellTurn(op) && !isOnlyTurn(op, kernel)))
    return "updates that tell who came first are made in the order of threads";
  return "";
}

std::string warp::whyNotLanes(Region &body, const ThreadVariance &variance,
                              FunctionOpInterface kernel) {
  std::string reason;
  body.walk<WalkOrder::PreOrder>([&](Operation *op) {
    reason = findObstacle(op, variance, kernel);
    return reason.empty() ? WalkResult::advance() : WalkResult::interrupt();
  });
  return reason;
}

//===----------------------------------------------------------------------===//
// Worth it
//===----------------------------------------------------------------------===//

/// How much longer vectors with fewer lanes than there is room for take.
static double emptyShare(int64_t lanes, int64_t all) {
  return lanes < all ? double(all) / double(lanes) : 1;
}

/// Has groups of lanes begin at multiples of their size, with as many lanes as
/// share a quotient of the thread index, if that gains more than it costs:
/// lists by tile are then read once for all lanes.
static void alignLanes(LanePlan &plan, FunctionOpInterface kernel,
                       warp::ThreadsOp threads, const ThreadVariance &variance,
                       const warp::LaneCost &cost, int64_t all) {
  constexpr double gain = 1.3;
  constexpr int64_t fewest = 4;
  int64_t lanes = std::min(variance.getLongestRun(), all);
  if (plan.lanes > 1 && plan.lanes < all)
    lanes = std::min(lanes, plan.lanes);
  if (lanes < fewest)
    return;
  ThreadVariance aligned(kernel, std::nullopt, lanes);
  warp::LaneCost shared = warp::costOfLanes(
      *threads.getThread(), aligned, warp::getSchedule(kernel).getExclusive());
  int64_t bits = warp::getVariant(kernel).getTarget().getBits();
  int64_t room = std::min(bits / (shared.wide > shared.narrow ? 64 : 32), all);
  double before = plan.lanes > 1 ? cost.vector * emptyShare(plan.lanes, room)
                                 : cost.scalar / 1.2;
  if (shared.vector * emptyShare(lanes, room) * gain > before)
    return;
  plan.lanes = lanes;
  plan.isAligned = true;
  plan.reason = "worth it, in groups that share a quotient of the index";
}

/// Cost of a thread over that of a lane from which scalar code is compared with
/// lanes on live launches, along rows that code is compiled for.
static constexpr double leastOfTrials = 0.4;

LanePlan warp::planLanes(FunctionOpInterface kernel, ThreadsOp threads,
                         const ThreadVariance &variance,
                         const LaneCalls *calls) {
  LanePlan plan;
  plan.reason = whyNotLanes(threads.getBody(), variance, kernel);
  if (!plan.reason.empty())
    return plan;
  LaneCost cost = costOfLanes(*threads.getThread(), variance,
                              getSchedule(kernel).getExclusive(), calls);
  VariantAttr variant = getVariant(kernel);
  if (variant.getLanes() != 0) {
    plan.lanes = variant.getLanes();
    plan.reason = "asked for";
    return plan;
  }
  int64_t all = cost.chooseLanes(variant.getTarget().getBits()), lanes = all;
  // A live launch may find that lanes gain where the model says little.
  plan.dependsOnRows =
      variant.getRank() > 1 &&
      (cost.isWorthIt(all, all) || cost.scalar >= leastOfTrials * cost.vector);
  if (variant.getInnerExtent() != 0)
    lanes = std::min(all, variant.getInnerExtent());
  // A set of a first-level cache has 8 lines or 12.
  constexpr int64_t lines = 8;
  plan.dependsOnFarRows = cost.hasRows && all > lines;
  if (plan.dependsOnFarRows && variant.getFarRows())
    lanes = all = std::min(lanes, lines);
  // Most lanes of a launch of a few threads are idle.
  constexpr int64_t few = 4;
  plan.dependsOnFew = cost.isWorthIt(lanes, all) && !cost.isWorthIt(few, all);
  if (plan.dependsOnFew && variant.getUnderfilled()) {
    plan.reason = "few threads, of which much is done one by one";
  } else if (cost.isWorthIt(lanes, all)) {
    plan.lanes = lanes;
    plan.reason = "worth it";
  } else {
    plan.reason = "most is done lane by lane";
  }
  // Functions are widened for what differs wherever lanes begin.
  if (variant.getInnerExtent() == 0 && !calls)
    alignLanes(plan, kernel, threads, variance, cost, all);
  return plan;
}

//===----------------------------------------------------------------------===//
// Views
//===----------------------------------------------------------------------===//

/// Puts the indices of a view in front of those of an access to it, if the user
/// is one.
static bool accessThrough(warp::ViewOp view, Operation *user) {
  OpBuilder b(user);
  unsigned count = view.getIndices().size();
  if (auto dim = dyn_cast<warp::DimOp>(user)) {
    dim.getArrayMutable().assign(view.getArray());
    dim.setDim(dim.getDim() + count);
    return true;
  }
  if (auto inner = dyn_cast<warp::ViewOp>(user)) {
    SmallVector<Value> indices(view.getIndices());
    llvm::append_range(indices, inner.getIndices());
    inner.getArrayMutable().assign(view.getArray());
    inner.getIndicesMutable().assign(indices);
    return true;
  }
  if (isa<warp::SliceOp, warp::ComponentViewOp>(user)) {
    auto whole = cast<warp::ArrayType>(view.getArray().getType());
    auto part = cast<warp::ArrayType>(user->getResult(0).getType());
    Type viewType = part;
    Operation *early = b.clone(*user);
    early->setOperand(0, view.getArray());
    early->getResult(0).setType(warp::ArrayType::get(
        b.getContext(), whole.getRank(), part.getElementType()));
    if (auto slice = dyn_cast<warp::SliceOp>(early))
      slice.setDim(slice.getDim() + count);
    Value late = warp::ViewOp::create(b, user->getLoc(), viewType,
                                      early->getResult(0), view.getIndices());
    user->getResult(0).replaceAllUsesWith(late);
    user->erase();
    return true;
  }
  auto assign = [&](auto access) {
    SmallVector<Value> indices(view.getIndices());
    llvm::append_range(indices, access.getIndices());
    access.getArrayMutable().assign(view.getArray());
    access.getIndicesMutable().assign(indices);
  };
  if (auto load = dyn_cast<warp::LoadComponentsOp>(user))
    assign(load);
  else if (auto store = dyn_cast<warp::StoreComponentsOp>(user))
    assign(store);
  else if (auto update = dyn_cast<warp::AtomicComponentsOp>(user))
    assign(update);
  else if (auto cas = dyn_cast<warp::AtomicCasOp>(user))
    assign(cas);
  else
    return false;
  return true;
}

void warp::foldViews(FunctionOpInterface kernel) {
  for (bool changed = true; changed;) {
    changed = false;
    SmallVector<ViewOp> views;
    kernel->walk([&](ViewOp view) { views.push_back(view); });
    for (ViewOp view : views) {
      for (Operation *user :
           llvm::make_early_inc_range(view.getResult().getUsers()))
        changed |= accessThrough(view, user);
      if (view->use_empty())
        view->erase();
    }
  }
}
