//===- CombineOverWarps.cpp - Warp-aggregated atomics ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In iteration k of a loop, or in row i of a launch over a plane, the threads
// of a warp update the same element:
//
//   for k: atomic_add(w, k, v)          atomic_add(row, i, v)
//
// That is 32 updates one after the other at one address. Where all lanes come
// to the update together and agree on k and i, they combine their values by
// shuffles, and the first lane makes the only update. For an element with many
// components, each lane combines some, and updates one: 64 numbers of a matrix
// take two atomic instructions, which reach memory as whole lines, and a fifth
// of the shuffles.
//
// An iteration that updates in a branch leaves it with the values, or with
// zeros:
//
//   for k:                               for k:
//     if c: atomic_add(w, f(k), v)  ==>    v, j, here = if c: v, f(k), true
//                                                       else: 0, 0, false
//                                          if warp is full, enough lanes are
//                                              here, and agree on j:
//                                            the sum over all lanes, once
//                                          else: if here: atomic_add(w, j, v)
//
// Threads of a tile of pixels, which have the same x / 16, combine in groups of
// 16 lanes.
//
// A loop that reverses one which threads leave apart has them in step
// (LoopReversal.cpp): here the most trips of a warp are found.
//
// warp-plan-updates says which updates these are.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "CarryOut.h"
#include "Choices.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "WarpDialect/LaneOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_COMBINEOVERWARPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::AtomicComponentsOp;

/// True if threads of a warp update the same element if they agree on what is
/// added to `compared`.
static bool updatesOneElement(AtomicComponentsOp op,
                              const warp::ThreadVariance &variance,
                              llvm::SetVector<Value> &compared) {
  auto isKnown = [&](Value value) {
    return variance.isUniformIfEqual(value, compared);
  };
  return isKnown(op.getArray()) && llvm::all_of(op.getIndices(), isKnown) &&
         !compared.empty();
}

static Type elementOf(AtomicComponentsOp op) {
  return cast<warp::ArrayType>(op.getArray().getType()).getElementType();
}

static Value compare(OpBuilder &b, Location loc, arith::CmpIPredicate predicate,
                     Value value, int64_t number) {
  Value other = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(number));
  return arith::CmpIOp::create(b, loc, predicate, value, other);
}

static Value combineTwo(OpBuilder &b, AtomicComponentsOp op, Value x, Value y,
                        Type type) {
  return warp::combine(b, op.getLoc(), warp::combiningKind(op.getKind()), x, y,
                       type, /*anyOrder=*/true);
}

namespace {
/// Lanes that update one element together.
struct Team {
  /// How many, in lanes that follow each other.
  int64_t size;
  ValueRange indices;
  /// True if there is anything to add; null if there always is.
  Value any;
};
} // namespace

/// True where `isIt` holds in a team that has something to add.
static Value isLane(OpBuilder &b, Location loc, Value isIt, const Team &team) {
  return team.any ? arith::AndIOp::create(b, loc, isIt, team.any) : isIt;
}

static Value laneOf(OpBuilder &b, Location loc, const Team &team) {
  Value lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  if (team.size == warp::subgroupSizeAt(b))
    return lane;
  Value mask =
      arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(team.size - 1));
  return arith::AndIOp::create(b, loc, lane, mask);
}

/// The first lane updates the element.
static void updateOnce(OpBuilder &b, AtomicComponentsOp op, const Team &team) {
  Location loc = op.getLoc();
  SmallVector<Value> totals;
  for (auto [leaf, value] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents()))
    totals.push_back(warp::overLanes(
        b, loc, value,
        [&, type = leaf.type](Value x, Value y) {
          return combineTwo(b, op, x, y, type);
        },
        team.size));
  Value lane = laneOf(b, loc, team);
  Value isFirst = compare(b, loc, arith::CmpIPredicate::eq, lane, 0);
  isFirst = isLane(b, loc, isFirst, team);
  auto once = scf::IfOp::create(b, loc, isFirst, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(once.thenBlock());
  AtomicComponentsOp::create(b, loc, op.getResultTypes(), op.getKind(), totals,
                             op.getArray(), team.indices);
}

/// The array of component `number` of each element.
static Value viewComponent(OpBuilder &b, AtomicComponentsOp op, Value number) {
  Location loc = op.getLoc();
  Type element = elementOf(op);
  SmallVector<Value> place{number};
  if (auto matrix = dyn_cast<warp::MatType>(element)) {
    Value columns = arith::ConstantOp::create(
        b, loc, b.getI32IntegerAttr(matrix.getCols()));
    place = {arith::DivUIOp::create(b, loc, number, columns),
             arith::RemUIOp::create(b, loc, number, columns)};
  }
  auto type = warp::ArrayType::get(b.getContext(), op.getIndices().size(),
                                   warp::getElementScalar(element));
  return warp::ComponentViewOp::create(b, loc, type, op.getArray(), place,
                                       StringAttr());
}

/// Each lane updates a component of the element, as many at a time as there are
/// lanes.
static void updateByLanes(OpBuilder &b, AtomicComponentsOp op,
                          const Team &team) {
  Location loc = op.getLoc();
  Value lane = laneOf(b, loc, team);
  Type type = warp::leavesOf(op).front().type;
  int64_t count = op.getNumResults();
  for (int64_t begin = 0; begin < count; begin += team.size) {
    SmallVector<Value> values(
        op.getComponents().drop_front(begin).take_front(team.size));
    int64_t size = values.size();
    Value total = warp::shareOverLanes(
        b, loc, lane, values,
        [&](Value x, Value y) { return combineTwo(b, op, x, y, type); },
        team.size);
    int64_t lanes = team.size / llvm::PowerOf2Ceil(size);
    auto constant = [&](int64_t value) {
      return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
    };
    Value number = arith::DivUIOp::create(b, loc, lane, constant(lanes));
    Value rest = arith::RemUIOp::create(b, loc, lane, constant(lanes));
    Value isOwn = arith::AndIOp::create(
        b, loc, compare(b, loc, arith::CmpIPredicate::eq, rest, 0),
        compare(b, loc, arith::CmpIPredicate::ult, number, size));
    isOwn = isLane(b, loc, isOwn, team);
    auto own = scf::IfOp::create(b, loc, isOwn, /*withElseRegion=*/false);
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(own.thenBlock());
    number = arith::AddIOp::create(b, loc, number, constant(begin));
    AtomicComponentsOp::create(b, loc, total.getType(), op.getKind(), total,
                               viewComponent(b, op, number), team.indices);
  }
}

static void update(OpBuilder &b, AtomicComponentsOp op, const Team &team) {
  if (op.getNumResults() > 1 && warp::isComposite(elementOf(op)))
    updateByLanes(b, op, team);
  else
    updateOnce(b, op, team);
}

/// Makes the update of a team where `together` holds, and else that of each
/// lane, if `isHere` is null or holds in it.
static void updateTogether(OpBuilder &b, AtomicComponentsOp op, Value together,
                           Value isHere, const Team &team) {
  Location loc = op.getLoc();
  auto branch = scf::IfOp::create(b, loc, together, /*withElseRegion=*/true);
  Block *alone = branch.elseBlock();
  if (isHere) {
    b.setInsertionPointToStart(alone);
    alone =
        scf::IfOp::create(b, loc, isHere, /*withElseRegion=*/false).thenBlock();
  }
  op->moveBefore(alone->getTerminator());
  b.setInsertionPointToStart(branch.thenBlock());
  update(b, op, team);
}

static void combineOverWarp(AtomicComponentsOp op, ArrayRef<Value> compared) {
  OpBuilder b(op);
  Value together = warp::isWarpTogether(b, op.getLoc(), compared);
  updateTogether(b, op, together, Value(),
                 {warp::subgroupSizeAt(b), op.getIndices(), Value()});
}

/// The outermost branch that an iteration of the loop around an update takes on
/// the way to it. None outside of loops, where it is the bounds of the launch.
static scf::IfOp outermostBranch(AtomicComponentsOp op) {
  scf::IfOp outermost;
  Operation *parent = op->getParentOp();
  for (; isa<scf::IfOp>(parent); parent = parent->getParentOp())
    outermost = cast<scf::IfOp>(parent);
  return isa<scf::ForOp, scf::WhileOp>(parent) ? outermost : scf::IfOp();
}

/// Takes an update out of a branch, with the lanes that do not make it. True in
/// those that do.
static Value moveAfter(scf::IfOp outermost, AtomicComponentsOp op) {
  OpBuilder b(op), before(outermost);
  Location loc = op.getLoc();
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  SmallVector<warp::Carried> carried;
  auto carry = [&](Value value, Value otherwise) {
    carried.push_back({value, otherwise, nullptr});
  };
  auto truth = [&](OpBuilder &at, bool value) -> Value {
    return arith::ConstantOp::create(at, loc, at.getBoolAttr(value));
  };
  for (auto [leaf, value] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents()))
    carry(value, warp::identity(before, loc, kind, leaf.type));
  for (Value index : op.getIndices())
    carry(index, arith::ConstantOp::create(
                     before, loc, before.getZeroAttr(index.getType())));
  carry(truth(b, true), truth(before, false));
  warp::carryOut(carried, op->getBlock(), outermost->getBlock());

  SmallVector<Value> values = llvm::map_to_vector(
      carried, [](const warp::Carried &one) { return one.value; });
  Value isHere = values.pop_back_val();
  size_t components = op.getNumResults();
  SmallVector<Value> indices(ArrayRef(values).drop_front(components));
  b.setInsertionPointAfterValue(isHere);
  op->moveBefore(b.getInsertionBlock(), b.getInsertionPoint());
  op.getComponentsMutable().assign(ArrayRef(values).take_front(components));
  op.getIndicesMutable().assign(indices);
  return isHere;
}

/// Makes an update in groups of so many lanes, of which some may not make it.
static void combineInTeams(AtomicComponentsOp op, Value isHere, int64_t size) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  int64_t least = warp::cost::leastCombined * (warp::subgroupSizeAt(b) / size);
  warp::WarpVote vote =
      warp::voteInWarp(b, loc, isHere, op.getIndices(), size, least);
  updateTogether(b, op, vote.together, isHere, {size, vote.agreed, vote.any});
}

namespace {

struct CombineOverWarps : warp::impl::CombineOverWarpsBase<CombineOverWarps> {
  void getDependentDialects(DialectRegistry &registry) const override {
    CombineOverWarpsBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    if (!warp::getTarget(entry).isSimt())
      return;
    SmallVector<AtomicComponentsOp> updates;
    entry->walk([&](AtomicComponentsOp op) {
      // Iterations that are in no tile of a ring, too.
      warp::UpdateScope scope = warp::getUpdate(op).getScope();
      if (scope == warp::UpdateScope::lanes || scope == warp::UpdateScope::ring)
        updates.push_back(op);
    });
    if (updates.empty())
      return findTrips(entry);
    // New operations leave the values that the analysis knows as they are.
    warp::ThreadVariance variance(entry);
    for (AtomicComponentsOp op : updates)
      combine(op, variance);
    findTrips(entry);
  }

  /// Last, as the analysis knows what it finds.
  static void findTrips(FunctionOpInterface entry) {
    entry->walk([](warp::MostTripsOp op) {
      OpBuilder b(op);
      op.replaceAllUsesWith(warp::mostInWarp(b, op.getLoc(), op.getOwn()));
      op.erase();
    });
  }

  static void combine(AtomicComponentsOp op,
                      const warp::ThreadVariance &variance) {
    llvm::SetVector<Value> compared;
    if (!variance.isUniformIfEqual(op.getArray(), compared))
      return;
    bool isOneArray = compared.empty();
    OpBuilder b(op);
    int64_t size = warp::subgroupSizeAt(b), run = warp::getUpdate(op).getRun();
    bool hasRuns = run > 0 && run < size;
    if (hasRuns && !isOneArray)
      return;
    bool isKnown = !hasRuns && updatesOneElement(op, variance, compared);
    // The bounds of the launch are a branch that hides what the plan knows.
    if (!hasRuns && !isKnown)
      compared.insert_range(op.getIndices());
    std::string threads =
        hasRuns ? std::to_string(run) + " threads" : std::string("a warp");
    warp::noteChoice(op->getParentOfType<FunctionOpInterface>(), "update",
                     "one for " + threads,
                     "its threads update the same element", op);
    scf::IfOp outermost = outermostBranch(op);
    bool isAfter = outermost && isOneArray &&
                   op.getArray().getParentRegion()->isAncestor(
                       outermost->getParentRegion());
    if (!isAfter && !hasRuns)
      return combineOverWarp(op, compared.getArrayRef());
    Value isHere = isAfter ? moveAfter(outermost, op)
                           : arith::ConstantOp::create(b, op.getLoc(),
                                                       b.getBoolAttr(true));
    combineInTeams(op, isHere, hasRuns ? run : size);
  }
};

} // namespace
