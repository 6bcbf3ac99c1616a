//===- LaneCost.cpp - Cost and profit of lanes ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A count of operations says what lanes gain on arithmetic and lose on gathers
// and on what is done lane by lane, against a thread alone, whose loops over
// rows the compiler makes vectors of.
//
//===----------------------------------------------------------------------===//

#include "LaneCost.h"

#include "Analysis/CostModel.h"
#include "Analysis/Effects.h"
#include "LaneCalls.h"
#include "LanePlan.h"
#include "RowRuns.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::LaneCost;
using warp::ThreadVariance;

/// A lane's share of an operation on numbers of up to 32 bits: 16 of them in a
/// vector, or as good as that; and of 64 bits.
static constexpr double laneShare = 1.0 / 12, wideLaneShare = 1.0 / 6;

namespace {

class CostCounter {
public:
  /// `exclusive`: updates are plain.
  CostCounter(const ThreadVariance &variance, bool exclusive,
              const warp::LaneCalls *calls)
      : variance(variance), exclusive(exclusive), calls(calls) {}

  void count(Block &block, double trips, double use) {
    for (Operation &op : block)
      count(&op, trips, use);
  }

  /// After the operations are counted.
  void visit(LoopLikeOpInterface loop) {
    cost.hasChain |= isChain(loop);
    findTightLoop(loop);
  }

  LaneCost cost;

private:
  bool isVarying(Value value) const {
    return !variance.isUniform(value, warp::Scope::Lanes);
  }
  void count(Operation *op, double trips, double use);
  void countAccess(warp::AccessOp op, double trips, double use);
  void countCall(func::CallOp op, double trips, double use);
  bool goesThroughRow(warp::AccessOp access) const;
  bool isStream(scf::ForOp loop) const;
  bool isRecurrence(scf::ForOp loop) const;
  double gainOfStream(scf::ForOp loop) const;
  bool isChain(LoopLikeOpInterface loop) const;
  bool isOfLanes(Operation *op) const;
  void findTightLoop(LoopLikeOpInterface loop);
  void add(double scalar, double vector, double trips, double use) {
    cost.scalar += scalar * trips;
    cost.vector += vector * trips / use;
  }

  const ThreadVariance &variance;
  bool exclusive;
  const warp::LaneCalls *calls;
};

} // namespace

static bool isShort(LoopLikeOpInterface loop) {
  auto trips = loop.getStaticTripCount();
  return trips && trips->ule(warp::cost::shortLoop);
}

/// True if an operation has the same bits in any order of its terms.
static bool isReordered(Operation *op) {
  return isa_and_present<arith::AddIOp, arith::MulIOp, arith::AndIOp,
                         arith::OrIOp, arith::XOrIOp, arith::MaxSIOp,
                         arith::MinSIOp, arith::MaxUIOp, arith::MinUIOp>(op);
}

/// True if all that a loop carries are sums, or the like, whose terms may be
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

/// True if an access is to the next element of its row in each iteration of a
/// long loop, and to another row in each lane.
bool CostCounter::goesThroughRow(warp::AccessOp access) const {
  ValueRange indices = access.getIndices();
  if (indices.size() < 2 || variance.step(indices.back()) != 0)
    return false;
  auto loop = access->getParentOfType<scf::ForOp>();
  return loop && !isShort(loop) &&
         variance.form(indices.back()).has(warp::Symbol::trip(loop)) &&
         llvm::any_of(indices.drop_back(),
                      [&](Value index) { return isVarying(index); });
}

/// True if an iteration may read an element that an earlier one writes:
/// `y[i, k] = f(y[i, k - 1])`. Such a loop carries its values through an array,
/// and no compiler makes vectors of its iterations.
bool CostCounter::isRecurrence(scf::ForOp loop) const {
  SmallVector<warp::AccessOp> reads, writes;
  for (auto access : loop.getBody()->getOps<warp::AccessOp>()) {
    if (access.mayWrite())
      writes.push_back(access);
    else
      reads.push_back(access);
  }
  warp::Symbol trip = warp::Symbol::trip(loop);
  auto reaches = [&](warp::AccessOp write, warp::AccessOp read) {
    if (write.getArray() != read.getArray() ||
        write.getIndices().size() != read.getIndices().size())
      return false;
    for (auto [to, from] :
         llvm::zip_equal(write.getIndices(), read.getIndices())) {
      const warp::Form &target = variance.form(to);
      std::optional<warp::Form> pace = target.coefficientOf(trip);
      std::optional<warp::Form> gap = target - variance.form(from);
      std::optional<int64_t> distance = gap ? gap->getConstant() : std::nullopt;
      if (!pace || !distance)
        continue;
      // An element is read that no iteration wrote yet, or in which only this
      // one does.
      std::optional<int64_t> step = pace->getConstant();
      if (*distance != 0 && step &&
          (*step == 0 || (*distance < 0) != (*step < 0)))
        return false;
      if (*distance == 0 && pace->getConstant() != 0)
        return false;
    }
    return true;
  };
  return llvm::any_of(writes, [&](warp::AccessOp write) {
    return llvm::any_of(
        reads, [&](warp::AccessOp read) { return reaches(write, read); });
  });
}

/// True if the iterations of one thread are as good as lanes: straight-line
/// code that carries nothing but sums of integers, over elements that follow
/// each other while those of neighbouring threads do not.
bool CostCounter::isStream(scf::ForOp loop) const {
  bool hasRows = false, carries = loop.getNumRegionIterArgs() != 0;
  if (isShort(loop) || !carriesSums(loop))
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
    // The regions of the operation have been visited.
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

bool CostCounter::isOfLanes(Operation *op) const {
  auto varies = [&](Value value) { return isVarying(value); };
  return llvm::any_of(op->getResults(), varies) ||
         llvm::any_of(op->getOperands(), varies);
}

/// A loop without others that all lanes leave together, in which operations
/// wait for each other rather than for memory: lanes have at most one access,
/// side by side.
void CostCounter::findTightLoop(LoopLikeOpInterface loop) {
  if (isShort(loop))
    return;
  int64_t own = 0, accesses = 0;
  bool isInnermost = true, isTight = !variance.isDivergent(loop);
  loop->walk([&](Operation *op) {
    auto inner = dyn_cast<LoopLikeOpInterface>(op);
    isInnermost &= !inner || inner == loop || isShort(inner);
    if (op->getNumRegions() != 0 || !isOfLanes(op) ||
        op->hasTrait<OpTrait::IsTerminator>())
      return;
    ++own;
    bool isAccess = isa<warp::LoadComponentsOp, warp::StoreComponentsOp>(op);
    accesses += isAccess;
    isTight &= isAccess
                   ? variance.step(op->getOperands().back()) == 1
                   : isMemoryEffectFree(op) && !isa<warp::LibraryCallOp>(op);
  });
  if (!isInnermost)
    return;
  cost.largestLoop = std::max(cost.largestLoop, own);
  cost.isTight &= isTight && accesses <= 1;
}

/// True if the iterations of a loop wait for each other rather than for memory,
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
    bool varies = isOfLanes(op);
    ++(varies ? own : shared);
    if (varies && isa<warp::AccessOp>(op))
      apart += std::max<int64_t>(op->getNumResults(), 3);
  });
  constexpr int64_t least = 24;
  return own >= least && 2 * own >= cost.varying && 8 * apart <= own &&
         (4 * longestWay(loop) >= own || shared >= 2 * own);
}

static bool hasWide(TypeRange types) {
  return llvm::any_of(types, [](Type type) {
    return type.isIntOrFloat() && type.getIntOrFloatBitWidth() > 32;
  });
}

/// True if no loop is around it that goes on for long.
static bool isStraight(Operation *op) {
  for (Operation *parent = op->getParentOp();
       !isa<warp::ThreadsOp, FunctionOpInterface>(parent);
       parent = parent->getParentOp()) {
    if (auto loop = dyn_cast<LoopLikeOpInterface>(parent);
        loop && !isShort(loop))
      return false;
  }
  return true;
}

/// A lane's share of gathering one of some numbers.
static double gatherCost(Operation *op, ValueRange numbers, double use) {
  if (use < 1)
    return (hasWide(numbers.getTypes()) ? 2 : 1) *
           warp::cost::divergentGatherCost;
  return isStraight(op) && numbers.size() < 4 ? warp::cost::straightGatherCost
                                              : warp::cost::gatherCost;
}

/// True if lanes load or store a number of a row together with the next ones.
static bool isInRun(Operation *op, const ThreadVariance &variance) {
  constexpr int64_t lanes = 16;
  auto load = dyn_cast<warp::LoadComponentsOp>(op);
  auto store = dyn_cast<warp::StoreComponentsOp>(op);
  bool isRow = (load && warp::isRowLoad(load, variance)) ||
               (store && warp::isRowStore(store, variance));
  return isRow && warp::iterationsInRun(cast<scf::ForOp>(op->getParentOp()),
                                        variance, lanes) > 1;
}

void CostCounter::countAccess(warp::AccessOp op, double trips, double use) {
  auto store = dyn_cast<warp::StoreComponentsOp>(*op);
  cost.hasRows |= goesThroughRow(op);
  ValueRange numbers =
      store ? ValueRange(store.getComponents()) : ValueRange(op->getResults());
  double count = numbers.size();
  bool follows = variance.step(op->getOperands().back()) == 1;
  // To take these apart is much code. Outside of loops it gains nothing to do
  // it for two vectors in turn.
  if (count > 4)
    cost.operations += 4 * count;
  Value array = op.getArray();
  double each = isInRun(op, variance)           ? warp::cost::rowCost
                : !follows                      ? gatherCost(op, numbers, use)
                : warp::isPartOfPacked(array)   ? warp::cost::fieldCost
                : warp::hasDenseElements(array) ? 2 * laneShare
                                                : gatherCost(op, numbers, use);
  add(count, each * count, trips, use);
}

/// How much quicker the loop of one thread is than its operations one by one.
double CostCounter::gainOfStream(scf::ForOp loop) const {
  if (isRecurrence(loop))
    return warp::cost::recurrenceGain;
  // Their reduction of large arguments is a branch, which lanes take together
  // and the compiler's vectors of iterations do not have.
  auto isBranched = [](Operation &op) {
    return isa<math::SinOp, math::CosOp, math::TanOp>(op);
  };
  return llvm::any_of(*loop.getBody(), isBranched) ? 1 : warp::cost::streamGain;
}

/// A function for all lanes, or for what they share.
void CostCounter::countCall(func::CallOp op, double trips, double use) {
  const warp::LaneFunction *function = calls ? calls->find(op) : nullptr;
  if (!function)
    return add(warp::cost::callCost, warp::cost::callCost * laneShare, trips,
               use);
  const LaneCost &inner = function->cost;
  add(inner.scalar + warp::cost::callCost,
      inner.vector + warp::cost::callCost * laneShare, trips, use);
  cost.operations += inner.operations * trips;
  cost.wide += inner.wide * trips;
  cost.narrow += inner.narrow * trips;
  cost.hasLoop |= inner.hasLoop;
}

void CostCounter::count(Operation *op, double trips, double use) {
  if (auto call = dyn_cast<func::CallOp>(op))
    return countCall(call, trips, use);
  if (auto loop = dyn_cast<scf::ForOp>(op); loop && isStream(loop)) {
    CostCounter inside(variance, exclusive, calls);
    inside.count(*loop.getBody(), trips * warp::cost::loopTrips, use);
    cost.hasLoop = true;
    cost.scalar += inside.cost.scalar / gainOfStream(loop);
    cost.vector += inside.cost.vector;
    cost.operations += inside.cost.operations;
    cost.varying += inside.cost.varying;
    cost.wide += inside.cost.wide;
    cost.narrow += inside.cost.narrow;
    cost.hasRows |= inside.cost.hasRows;
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
  const double share =
      hasWide(op->getResultTypes()) || hasWide(op->getOperandTypes())
          ? wideLaneShare
          : laneShare;
  if (!isOfLanes(op))
    return add(1, share, trips, use);
  ++cost.varying;
  for (Type type : op->getResultTypes())
    if (type.isIntOrFloat() && !type.isInteger(1))
      (type.getIntOrFloatBitWidth() > 32 ? cost.wide : cost.narrow) += trips;
  if (isa<warp::LoadComponentsOp, warp::StoreComponentsOp>(op))
    return countAccess(cast<warp::AccessOp>(op), trips, use);
  if (auto update = dyn_cast<warp::AtomicComponentsOp>(op)) {
    bool isOnePlace = llvm::none_of(
        update.getIndices(), [&](Value index) { return isVarying(index); });
    double count = update.getComponents().size();
    double each = isOnePlace ? 1 : 4 * count + warp::cost::laneCost;
    // Lanes that have left a loop take no turn.
    return add(4 * count, each, trips, isOnePlace ? use : 1);
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
  if (isa<warp::ScratchLoadOp, warp::ScratchStoreOp>(op)) {
    // A slot holds a vector; lanes that use different slots gather.
    bool apart = isVarying(op->getOperand(op->getNumOperands() - 1));
    return add(1, apart ? warp::cost::gatherCost : 2 * share, trips, use);
  }
  if (auto get = dyn_cast<warp::TableGetOp>(op)) {
    int64_t count = get.getTable().getNumElements();
    return add(1,
               count <= warp::cost::selectedElements
                   ? double(count) * share
                   : warp::cost::straightGatherCost,
               trips, use);
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

LaneCost warp::costOfLanes(Block &body, const ThreadVariance &variance,
                           bool exclusive, const LaneCalls *calls) {
  CostCounter counter(variance, exclusive, calls);
  counter.count(body, 1, 1);
  // Each thread waits for the sums of its predecessors.
  if (isa<ThreadsOp>(body.getParentOp()))
    counter.cost.scalar +=
        warp::cost::sumLatency * body.getTerminator()->getNumOperands();
  body.walk([&](LoopLikeOpInterface loop) { counter.visit(loop); });
  return counter.cost;
}

bool LaneCost::isWorthIt(int64_t lanes, int64_t all) const {
  double least = lanes >= std::min<int64_t>(all, 16) ? 1.2 : lanes >= 8 ? 2 : 3;
  return scalar >= least * vector;
}

int64_t LaneCost::chooseLanes(int64_t bits) const {
  int64_t lanes = bits / (wide > narrow ? 64 : 32);
  // Two vectors in turn hide the latency of short bodies, and of chains.
  constexpr int64_t most = 200;
  constexpr int64_t mostInTurn = 40, mostAround = 120;
  if (isTight && largestLoop > 0 && largestLoop <= mostInTurn &&
      varying <= mostAround)
    return 4 * lanes;
  bool isShort = operations <= (hasLoop ? 40 * warp::cost::loopTrips : 24);
  // Values of 64 bits are two vectors already.
  bool isMixed = wide <= narrow && 2 * wide > narrow;
  bool isDoubled = (isShort && !isMixed) || (hasChain && varying <= most);
  return isDoubled ? 2 * lanes : lanes;
}
