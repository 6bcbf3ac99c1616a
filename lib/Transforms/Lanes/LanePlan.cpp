//===- LanePlan.cpp - Whether and how wide threads become lanes -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads stay scalar where lanes cannot be right: an array that differs from
// thread to thread has no form, and a loop that waits for what another thread
// writes would wait for ever if that thread were another lane. They also stay
// so where it does not pay: a count of operations says what lanes gain on
// arithmetic and lose on gathers and on what is done lane by lane.
//
//===----------------------------------------------------------------------===//

#include "LanePlan.h"

#include "Analysis/CostModel.h"
#include "Analysis/Effects.h"
#include "KernelFunction.h"
#include "Updates/Atomics.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::LanePlan;
using warp::ThreadVariance;

//===----------------------------------------------------------------------===//
// Right
//===----------------------------------------------------------------------===//

/// What another thread may change while a loop runs.
static bool isShared(Operation *op, const ThreadVariance &variance) {
  auto access = dyn_cast<warp::AccessOp>(op);
  return access &&
         (access.isUpdate() ||
          (access.mayRead() && variance.isWritten(access.getArray())));
}

/// Whether a loop goes on until another thread has done something: its
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

/// Why lanes cannot do an operation; empty if they can.
static std::string findObstacle(Operation *op, const ThreadVariance &variance) {
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
  return "";
}

//===----------------------------------------------------------------------===//
// Worth it
//===----------------------------------------------------------------------===//

namespace {

/// Rough cycles of one thread, alone and as one of many lanes.
struct Cost {
  double scalar = 0, vector = 0;
  /// Results by size, to find out how many lanes a vector has.
  double wide = 0, narrow = 0;
  double operations = 0;
  /// Operations of lanes in the code as it stands.
  int64_t varying = 0;
  bool hasLoop = false;
  /// Whether most of them are in a loop that two vectors in turn run quicker.
  bool hasChain = false;
};

class CostCounter {
public:
  /// `exclusive`: updates are plain.
  CostCounter(const ThreadVariance &variance, bool exclusive)
      : variance(variance), exclusive(exclusive) {}

  void count(Block &block, double trips, double use) {
    for (Operation &op : block)
      count(&op, trips, use);
  }

  /// After the operations are counted.
  void findChain(LoopLikeOpInterface loop) { cost.hasChain |= isChain(loop); }

  Cost cost;

private:
  bool isVarying(Value value) const {
    return !variance.isUniform(value, warp::Scope::Lanes);
  }
  void count(Operation *op, double trips, double use);
  bool isStream(scf::ForOp loop) const;
  bool isChain(LoopLikeOpInterface loop) const;
  void add(double scalar, double vector, double trips, double use) {
    cost.scalar += scalar * trips;
    cost.vector += vector * trips / use;
  }

  const ThreadVariance &variance;
  bool exclusive;
};

} // namespace

/// Whether an operation has the same bits in any order of its terms.
static bool isReordered(Operation *op) {
  return isa_and_present<arith::AddIOp, arith::MulIOp, arith::AndIOp,
                         arith::OrIOp, arith::XOrIOp, arith::MaxSIOp,
                         arith::MinSIOp, arith::MaxUIOp, arith::MinUIOp>(op);
}

/// Whether all that a loop carries are sums, or the like, whose terms may be
/// taken in any order.
static bool carriesSums(scf::ForOp loop) {
  return llvm::all_of(
      llvm::zip_equal(loop.getRegionIterArgs(), loop.getYieldedValues()),
      [&](auto pair) {
        auto [sum, next] = pair;
        Operation *last = next.getDefiningOp();
        for (Value v = next; v != sum;) {
          Operation *op = v.getDefiningOp();
          if (!isReordered(op) || op->getName() != last->getName() ||
              op->getBlock() != loop.getBody() || !v.hasOneUse())
            return false;
          // The other operand is a term.
          Operation *before = op->getOperand(0).getDefiningOp();
          bool isFirst = op->getOperand(0) == sum ||
                         (before && before->getName() == op->getName() &&
                          op->getOperand(1) != sum);
          v = op->getOperand(isFirst ? 0 : 1);
        }
        return sum.hasOneUse();
      });
}

/// Whether the iterations of one thread are as good as lanes: straight-line
/// code that carries nothing but sums of integers, over elements that follow
/// each other while those of neighbouring threads do not.
bool CostCounter::isStream(scf::ForOp loop) const {
  bool hasRows = false, carries = loop.getNumRegionIterArgs() != 0;
  if (!carriesSums(loop))
    return false;
  for (Operation &op : loop.getBody()->without_terminator()) {
    auto access = dyn_cast<warp::AccessOp>(op);
    if (!access && (op.getNumRegions() != 0 || !isMemoryEffectFree(&op)))
      return false;
    if (!access || access.getIndices().empty())
      continue;
    // By how much it grows from one iteration to the next.
    const warp::Form &index = variance.form(access.getIndices().back());
    warp::Symbol trip = warp::Symbol::trip(loop);
    bool follows = index.has(trip);
    std::optional<warp::Form> pace = index.coefficientOf(trip);
    if ((access.isUpdate() && !(exclusive && op.use_empty())) ||
        (follows && !(pace && pace->equals(variance.form(loop.getStep())))) ||
        !index.without(trip).isDefinedOutside(loop))
      return false;
    hasRows |= (access.mayWrite() || carries) && follows &&
               llvm::any_of(access.getIndices(),
                            [&](Value index) { return isVarying(index); }) &&
               variance.step(access.getIndices().back()) != 1;
  }
  return hasRows;
}

/// The longest way from what an iteration is given to what it passes on, in
/// operations.
static int64_t longestWay(LoopLikeOpInterface loop) {
  llvm::DenseMap<Value, int64_t> ways;
  for (Value value : loop.getRegionIterArgs())
    ways[value] = 0;
  if (auto branch = dyn_cast<scf::WhileOp>(*loop))
    for (Value value : branch.getAfterArguments())
      ways[value] = 0;
  int64_t longest = 0;
  loop->walk([&](Operation *op) {
    int64_t way = -1;
    auto visit = [&](Operation *inner) {
      for (Value operand : inner->getOperands())
        if (auto found = ways.find(operand); found != ways.end())
          way = std::max(way, found->second);
    };
    // What is inside has been visited.
    visit(op);
    for (Region &region : op->getRegions())
      for (Block &block : region)
        visit(block.getTerminator());
    if (op == loop || way < 0)
      return;
    for (Value result : op->getResults())
      ways[result] = way + 1;
    longest = std::max(longest, way);
  });
  return longest;
}

/// Whether the iterations of a loop wait for each other rather than for memory,
/// or do more for all lanes together than for each: with twice the lanes they
/// take as long.
bool CostCounter::isChain(LoopLikeOpInterface loop) const {
  if (auto trips = loop.getStaticTripCount(); trips && trips->ult(8))
    return false;
  int64_t own = 0, shared = 0, apart = 0;
  loop->walk([&](Operation *op) {
    if (op->getNumRegions() != 0 || op->hasTrait<OpTrait::IsTerminator>() ||
        op->hasTrait<OpTrait::ConstantLike>())
      return;
    bool varies =
        llvm::any_of(op->getResults(), [&](Value v) { return isVarying(v); }) ||
        llvm::any_of(op->getOperands(), [&](Value v) { return isVarying(v); });
    ++(varies ? own : shared);
    if (varies && isa<warp::AccessOp>(op))
      apart += std::max<int64_t>(op->getNumResults(), 3);
  });
  constexpr int64_t least = 24;
  return own >= least && 2 * own >= cost.varying && 8 * apart <= own &&
         (4 * longestWay(loop) >= own || shared >= 2 * own);
}

void CostCounter::count(Operation *op, double trips, double use) {
  if (auto loop = dyn_cast<scf::ForOp>(op); loop && isStream(loop)) {
    CostCounter inside(variance, exclusive);
    inside.count(*loop.getBody(), trips * warp::cost::loopTrips, use);
    cost.hasLoop = true;
    cost.scalar += inside.cost.scalar / warp::cost::streamGain;
    cost.vector += inside.cost.vector;
    cost.operations += inside.cost.operations;
    cost.varying += inside.cost.varying;
    return;
  }
  if (isa<scf::ForOp, scf::WhileOp>(op)) {
    cost.hasLoop = true;
    trips *= warp::cost::loopTrips;
    if (variance.isDivergent(op))
      use = std::min(use, warp::cost::laneUse);
  }
  for (Region &region : op->getRegions())
    for (Block &block : region)
      count(block, trips, use);
  if (op->getNumRegions() != 0 || op->hasTrait<OpTrait::ConstantLike>())
    return;
  cost.operations += trips;
  // A lane's share: 16 of them in a vector, or as good as that.
  constexpr double share = 1.0 / 12;
  bool varies =
      llvm::any_of(op->getOperands(), [&](Value v) { return isVarying(v); }) ||
      llvm::any_of(op->getResults(), [&](Value v) { return isVarying(v); });
  if (!varies)
    return add(1, share, trips, use);
  ++cost.varying;
  for (Type type : op->getResultTypes())
    if (type.isIntOrFloat() && !type.isInteger(1))
      (type.getIntOrFloatBitWidth() > 32 ? cost.wide : cost.narrow) += trips;
  bool isLoad = isa<warp::LoadComponentsOp>(op);
  if (isLoad || isa<warp::StoreComponentsOp>(op)) {
    double count =
        isLoad ? op->getNumResults()
               : cast<warp::StoreComponentsOp>(op).getComponents().size();
    bool follows = variance.step(op->getOperand(op->getNumOperands() - 1)) == 1;
    // To take these apart is much code. Outside of loops it gains nothing to do
    // it for two vectors in turn.
    if (count > 4)
      cost.operations += 4 * count;
    Value array = cast<warp::AccessOp>(op).getArray();
    double gather = trips == 1 && count < 4 ? warp::cost::straightGatherCost
                                            : warp::cost::gatherCost;
    double each = !follows                        ? gather
                  : warp::isPartOfPacked(array)   ? warp::cost::fieldCost
                  : warp::hasDenseElements(array) ? 2 * share
                                                  : gather;
    return add(count, each * count, trips, use);
  }
  if (auto update = dyn_cast<warp::AtomicComponentsOp>(op)) {
    bool isOnePlace = llvm::none_of(
        update.getIndices(), [&](Value index) { return isVarying(index); });
    double count = update.getComponents().size();
    double each = isOnePlace ? 1 : 4 * count + warp::cost::laneCost;
    return add(4 * count, each, trips, use);
  }
  if (auto call = dyn_cast<warp::LibraryCallOp>(op)) {
    const warp::LibraryFunction *function =
        warp::findLibraryFunction(call.getCallee());
    if (function && function->shared >= 0) {
      // Its addresses are of 64 bits, but it is called half as often by twice
      // the lanes.
      cost.narrow += 2 * warp::cost::callCost * trips;
      return add(warp::cost::callCost, warp::cost::callCost, trips, 1);
    }
    return add(warp::cost::searchCost,
               warp::cost::searchCost + warp::cost::laneCost, trips, 1);
  }
  if (!warp::isConversion(op) && !isMemoryEffectFree(op))
    return add(warp::cost::laneCost, 2 * warp::cost::laneCost, trips, 1);
  double work = 1;
  if (isa<arith::DivFOp, math::SqrtOp>(op))
    work = warp::cost::rootCost;
  else if (isa<arith::DivSIOp, arith::DivUIOp, arith::RemSIOp, arith::RemUIOp>(
               op))
    work = warp::cost::divisionCost;
  else if (isa<math::MathDialect>(op->getDialect()) &&
           !isa<math::AbsFOp, math::FmaOp, math::FloorOp, math::CeilOp,
                math::CopySignOp>(op))
    work = warp::cost::callCost;
  add(work, work * share, trips, use);
}

/// Vectors of that many bits, one or several at a time.
static int64_t chooseLanes(const Cost &cost, int64_t bits) {
  int64_t lanes = bits / (cost.wide > cost.narrow ? 64 : 32);
  // Two vectors in turn hide the latency of short bodies, and of chains.
  constexpr int64_t most = 200;
  bool isShort =
      cost.operations <= (cost.hasLoop ? 40 * warp::cost::loopTrips : 24);
  bool isChain = cost.hasChain && cost.varying <= most;
  return isShort || isChain ? 2 * lanes : lanes;
}

LanePlan warp::planLanes(FunctionOpInterface kernel, ThreadsOp threads,
                         const ThreadVariance &variance) {
  LanePlan plan;
  threads.getBody().walk<WalkOrder::PreOrder>([&](Operation *op) {
    plan.reason = findObstacle(op, variance);
    return plan.reason.empty() ? WalkResult::advance()
                               : WalkResult::interrupt();
  });
  if (!plan.reason.empty())
    return plan;
  CostCounter counter(variance, getRecipe(kernel).getExclusive());
  counter.count(*threads.getThread(), 1, 1);
  // What threads sum up, one after the other, each waits for.
  counter.cost.scalar += warp::cost::sumLatency *
                         threads.getThread()->getTerminator()->getNumOperands();
  threads.getThread()->walk(
      [&](LoopLikeOpInterface loop) { counter.findChain(loop); });
  const Cost &cost = counter.cost;
  int64_t wanted = getVariant(kernel).getLanes();
  if (wanted == 0 && cost.scalar < 1.2 * cost.vector) {
    plan.reason = "most is done lane by lane";
    return plan;
  }
  int64_t bits = getVariant(kernel).getTarget().getBits();
  plan.lanes = wanted ? wanted : chooseLanes(cost, bits);
  plan.reason = wanted ? "asked for" : "worth it";
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
