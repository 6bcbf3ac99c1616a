//===- WidenControlFlow.cpp - Branches and loops of lanes -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A branch or loop on which lanes agree stays one. If they do not, short arms
// without effects are both computed and results chosen by lane; longer ones run
// if any lane wants them, under its mask.
//
// A loop that lanes leave at different times runs while any is left. A lane's
// results are held as it leaves: only results that are used afterwards cost
// that. Values all lanes that are still in the loop share, such as a counter,
// stays a scalar in it. Lanes that have left are not given the next threads:
// that gains 1.3 to 1.6x where neighbours differ at random, loses 0.7x where
// they are alike, and the code cannot tell which (benchmarks/refill.cpp).
//
//===----------------------------------------------------------------------===//

#include "RareBranch.h"
#include "RowRuns.h"
#include "Widening.h"

#include "Analysis/CostModel.h"

#include "mlir/Dialect/Math/IR/Math.h"

using namespace mlir;
using warp::Widening;

//===----------------------------------------------------------------------===//
// Branches
//===----------------------------------------------------------------------===//

/// Rough operations of code that lanes may compute without need; none if they
/// must not.
static std::optional<int64_t> flatCost(Region &region) {
  int64_t cost = 0;
  for (Block &block : region)
    for (Operation &op : block.without_terminator()) {
      if (auto branch = dyn_cast<scf::IfOp>(op)) {
        auto then = flatCost(branch.getThenRegion());
        auto otherwise = flatCost(branch.getElseRegion());
        if (!then || !otherwise)
          return std::nullopt;
        cost += *then + *otherwise + branch.getNumResults();
        continue;
      }
      if (op.getNumRegions() != 0 || !isPure(&op) ||
          isa<arith::DivSIOp, arith::DivUIOp, arith::RemSIOp, arith::RemUIOp>(
              op))
        return std::nullopt;
      if (isa<arith::DivFOp, math::SqrtOp, math::RsqrtOp>(op))
        cost += warp::cost::flatRoot;
      else if (isa<math::MathDialect>(op.getDialect()) &&
               !isa<math::AbsFOp, math::FmaOp, math::FloorOp, math::CeilOp,
                    math::CopySignOp>(op))
        cost += warp::cost::flatCall;
      else
        ++cost;
    }
  return cost;
}

static bool isFlat(scf::IfOp op) {
  if (op->hasAttr(warp::attr::rare))
    return false;
  auto then = flatCost(op.getThenRegion());
  auto otherwise = flatCost(op.getElseRegion());
  return then && otherwise && *then + *otherwise <= warp::cost::longestFlat;
}

void Widening::widenIf(scf::IfOp op) {
  if (!isVarying(op.getCondition()))
    return widenUniformIf(op);
  if (isFlat(op))
    return flatten(op);
  Location branchLoc = loc;
  Value outer = mask, condition = vector(op.getCondition());
  Values then = widenArm(op, op.thenBlock(), both(outer, condition));
  Values otherwise;
  if (op.elseBlock()) {
    loc = branchLoc;
    otherwise = widenArm(op, op.elseBlock(), without(outer, condition));
  }
  mask = outer;
  loc = branchLoc;
  unsigned next = 0;
  for (Value result : op.getResults()) {
    if (!isVarying(result)) {
      setScalar(result, scalar(op.thenYield().getOperand(
                            cast<OpResult>(result).getResultNumber())));
      continue;
    }
    setVector(result, choose(condition, then[next], otherwise[next]));
    ++next;
  }
}

/// One arm under its own mask; vectors of the results that differ.
Widening::Values Widening::widenArm(scf::IfOp op, Block *arm, Value armMask) {
  SmallVector<Type> types;
  SmallVector<Value> yielded;
  for (auto [result, value] :
       llvm::zip(op.getResults(), arm->getTerminator()->getOperands()))
    if (isVarying(result)) {
      types.push_back(lanesOf(result.getType()));
      yielded.push_back(value);
    }
  Values results;
  if (arm->without_terminator().empty()) {
    for (Value value : yielded)
      results.push_back(vector(value));
    return results;
  }
  mask = armMask;
  auto branch = scf::IfOp::create(b, loc, types, any(armMask),
                                  /*withElseRegion=*/!types.empty());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  widen(*arm);
  loc = op.getLoc();
  if (types.empty())
    return results;
  for (Value value : yielded)
    results.push_back(vector(value));
  b.setInsertionPointToEnd(branch.thenBlock());
  scf::YieldOp::create(b, loc, results);
  b.setInsertionPointToStart(branch.elseBlock());
  Values none;
  for (Type type : types)
    none.push_back(arith::ConstantOp::create(b, loc, b.getZeroAttr(type)));
  scf::YieldOp::create(b, loc, none);
  return Values(branch.getResults());
}

/// Both arms, without a branch.
void Widening::flatten(scf::IfOp op) {
  Value condition = vector(op.getCondition());
  widen(*op.thenBlock());
  if (op.elseBlock())
    widen(*op.elseBlock());
  loc = op.getLoc();
  for (OpResult result : op->getResults()) {
    unsigned i = result.getResultNumber();
    Value then = op.thenYield().getOperand(i);
    if (!isVarying(result))
      setScalar(result, scalar(then));
    else
      setVector(result, choose(condition, vector(then),
                               vector(op.elseYield().getOperand(i))));
  }
}

void Widening::widenUniformIf(scf::IfOp op) {
  bool hasElse = op.elseBlock() != nullptr;
  auto branch = scf::IfOp::create(b, loc, formTypes(op.getResults()),
                                  scalar(op.getCondition()), hasElse);
  OpBuilder::InsertionGuard guard(b);
  auto fill = [&](Block *from, Block *to) {
    b.setInsertionPointToStart(to);
    widen(*from);
    loc = op.getLoc();
    Values forms;
    for (auto [result, value] :
         llvm::zip(op.getResults(), from->getTerminator()->getOperands()))
      appendForms(result, value, forms);
    if (!forms.empty())
      scf::YieldOp::create(b, loc, forms);
  };
  fill(op.thenBlock(), branch.thenBlock());
  if (hasElse)
    fill(op.elseBlock(), branch.elseBlock());
  takeForms(op.getResults(), branch.getResults());
}

//===----------------------------------------------------------------------===//
// Loops
//===----------------------------------------------------------------------===//

void Widening::widenFor(scf::ForOp op) {
  if (variance.isDivergent(op))
    return widenDivergentFor(op);
  Values inits;
  for (auto [argument, init] :
       llvm::zip_equal(op.getRegionIterArgs(), op.getInitArgs()))
    appendForms(argument, init, inits);
  Value begin = scalar(op.getLowerBound()), end = scalar(op.getUpperBound());
  int64_t run = warp::iterationsInRun(op, variance, lanes);
  if (run > 1) {
    // Counts modulo two to the number of bits, as the difference may need one
    // more.
    auto less = op.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                    : arith::CmpIPredicate::slt;
    Value none =
        arith::ConstantOp::create(b, loc, b.getZeroAttr(begin.getType()));
    Value whole = arith::ConstantOp::create(
        b, loc, b.getIntegerAttr(begin.getType(), -run));
    Value runs = arith::CmpIOp::create(b, loc, less, begin, end);
    Value trips = arith::SubIOp::create(b, loc, end, begin);
    trips = arith::AndIOp::create(b, loc, trips, whole);
    trips = arith::SelectOp::create(b, loc, runs, trips, none);
    Value middle = arith::AddIOp::create(b, loc, begin, trips);
    inits = widenIterations(op, begin, middle, run, inits).getResults();
    begin = middle;
  }
  auto loop = widenIterations(op, begin, end, 1, inits);
  takeResults(op.getRegionIterArgs(), op.getResults(), loop.getResults());
}

/// The iterations from `begin` up to `end`, so many together.
scf::ForOp Widening::widenIterations(scf::ForOp op, Value begin, Value end,
                                     int64_t count, ValueRange inits) {
  auto number = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc,
                                     b.getIntegerAttr(begin.getType(), value));
  };
  Value step = count > 1 ? number(count) : scalar(op.getStep());
  auto loop = scf::ForOp::create(b, loc, begin, end, step, inits, nullptr,
                                 op.getUnsignedCmp());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(loop.getBody());
  Values passed(loop.getRegionIterArgs());
  for (int64_t k = 0; k < count; ++k) {
    together[op] = {count, k};
    // Forms of another iteration.
    op->walk([&](Operation *inner) {
      for (Region &region : inner->getRegions())
        for (Value argument : region.getArguments())
          vectors.erase(argument);
      if (inner != op)
        for (Value result : inner->getResults())
          vectors.erase(result);
    });
    Value counter = loop.getInductionVar();
    if (k > 0)
      counter = arith::AddIOp::create(b, loc, counter, number(k));
    setScalar(op.getInductionVar(), counter);
    takeForms(op.getRegionIterArgs(), passed);
    widen(*op.getBody());
    loc = op.getLoc();
    Values next;
    for (auto [argument, value] :
         llvm::zip_equal(op.getRegionIterArgs(), op.getYieldedValues()))
      appendForms(argument, value, next);
    passed = next;
  }
  together.erase(op);
  if (!passed.empty())
    scf::YieldOp::create(b, loc, passed);
  return loop;
}

/// A result of a loop has the forms of the argument that it was, or fewer.
void Widening::takeResults(ValueRange arguments, ValueRange results,
                           ValueRange forms) {
  for (auto [argument, result] : llvm::zip_equal(arguments, results)) {
    unsigned count = formTypes(ValueRange(argument)).size();
    takeForms(ValueRange(argument), forms.take_front(count));
    if (isVarying(result))
      setVector(result, vector(argument));
    if (!isVarying(result) || hasBase(result))
      setScalar(result, scalar(argument));
    forms = forms.drop_front(count);
  }
}

namespace {
/// The values that a loop that lanes leave at different times carries besides
/// its own values: the lanes that are left, and for each result that is used
/// the values of those that are not.
struct Held {
  /// Positions among the results.
  SmallVector<unsigned> positions;

  explicit Held(ResultRange results) {
    for (OpResult result : results)
      if (!result.use_empty())
        positions.push_back(result.getResultNumber());
  }
};
} // namespace

/// Lanes have bounds of their own:
///
///     while any(live & k < end):  body under that mask;  k += step
void Widening::widenDivergentFor(scf::ForOp op) {
  Value outer = mask, counter = op.getInductionVar();
  Held held(op.getResults());
  Values inits{outer};
  for (unsigned i : held.positions)
    inits.push_back(vector(op.getInitArgs()[i]));
  appendForms(counter, op.getLowerBound(), inits);
  for (auto [argument, init] :
       llvm::zip_equal(op.getRegionIterArgs(), op.getInitArgs()))
    appendForms(argument, init, inits);
  SmallVector<Type> types(ValueRange(inits).getTypes());
  auto loop = scf::WhileOp::create(b, loc, types, inits);
  OpBuilder::InsertionGuard guard(b);
  SmallVector<Location> locations(types.size(), loc);

  SmallVector<Value> own{counter};
  llvm::append_range(own, op.getRegionIterArgs());
  auto enter = [&](Block *block) {
    mask = block->getArgument(0);
    takeForms(own, block->getArguments().drop_front(
                       1 + held.positions.size()));
  };
  Block *before = b.createBlock(&loop.getBefore(), {}, types, locations);
  enter(before);
  auto predicate = op.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                       : arith::CmpIPredicate::slt;
  Value inside = arith::CmpIOp::create(b, loc, predicate, vector(counter),
                                       vector(op.getUpperBound()));
  Value live = both(mask, inside);
  Values passed(before->getArguments());
  passed[0] = live;
  scf::ConditionOp::create(b, loc, any(live), passed);

  Block *after = b.createBlock(&loop.getAfter(), {}, types, locations);
  enter(after);
  live = mask;
  widen(*op.getBody());
  loc = op.getLoc();
  Values next{live};
  for (auto [i, position] : llvm::enumerate(held.positions))
    next.push_back(choose(live, vector(op.getYieldedValues()[position]),
                          after->getArgument(1 + i)));
  if (isVarying(counter))
    next.push_back(arith::AddIOp::create(b, loc, vector(counter),
                                         vector(op.getStep())));
  if (!isVarying(counter) || hasBase(counter))
    next.push_back(arith::AddIOp::create(b, loc, scalar(counter),
                                         scalar(op.getStep())));
  for (auto [argument, value] :
       llvm::zip_equal(op.getRegionIterArgs(), op.getYieldedValues()))
    appendForms(argument, value, next);
  scf::YieldOp::create(b, loc, next);
  mask = outer;
  for (auto [i, position] : llvm::enumerate(held.positions))
    setVector(op.getResult(position), loop.getResult(1 + i));
}

void Widening::widenWhile(scf::WhileOp op) {
  if (variance.isDivergent(op))
    return widenDivergentWhile(op);
  Values inits;
  for (auto [argument, init] :
       llvm::zip_equal(op.getBeforeArguments(), op.getInits()))
    appendForms(argument, init, inits);
  SmallVector<Type> beforeTypes(ValueRange(inits).getTypes());
  SmallVector<Type> afterTypes = formTypes(op.getAfterArguments());
  auto loop = scf::WhileOp::create(b, loc, afterTypes, inits);
  OpBuilder::InsertionGuard guard(b);
  Block *before =
      b.createBlock(&loop.getBefore(), {}, beforeTypes,
                    SmallVector<Location>(beforeTypes.size(), loc));
  takeForms(op.getBeforeArguments(), before->getArguments());
  widen(*op.getBeforeBody());
  loc = op.getLoc();
  Values passed;
  for (auto [argument, value] : llvm::zip_equal(
           op.getAfterArguments(), op.getConditionOp().getArgs()))
    appendForms(argument, value, passed);
  scf::ConditionOp::create(b, loc, scalar(op.getConditionOp().getCondition()),
                           passed);
  Block *after = b.createBlock(&loop.getAfter(), {}, afterTypes,
                               SmallVector<Location>(afterTypes.size(), loc));
  takeForms(op.getAfterArguments(), after->getArguments());
  widen(*op.getAfterBody());
  loc = op.getLoc();
  Values next;
  for (auto [argument, value] : llvm::zip_equal(
           op.getBeforeArguments(), op.getYieldOp().getOperands()))
    appendForms(argument, value, next);
  scf::YieldOp::create(b, loc, next);

  b.setInsertionPointAfter(loop);
  takeResults(op.getAfterArguments(), op.getResults(), loop.getResults());
}

void Widening::widenDivergentWhile(scf::WhileOp op) {
  Value outer = mask;
  Held held(op.getResults());
  Values inits{outer};
  for (unsigned i : held.positions)
    inits.push_back(arith::ConstantOp::create(
        b, loc, b.getZeroAttr(lanesOf(op.getResult(i).getType()))));
  for (auto [argument, init] :
       llvm::zip_equal(op.getBeforeArguments(), op.getInits()))
    appendForms(argument, init, inits);
  SmallVector<Type> beforeTypes(ValueRange(inits).getTypes());
  unsigned own = 1 + held.positions.size();
  SmallVector<Type> afterTypes(ArrayRef(beforeTypes).take_front(own));
  llvm::append_range(afterTypes, formTypes(op.getAfterArguments()));
  auto loop = scf::WhileOp::create(b, loc, afterTypes, inits);
  OpBuilder::InsertionGuard guard(b);

  Block *before =
      b.createBlock(&loop.getBefore(), {}, beforeTypes,
                    SmallVector<Location>(beforeTypes.size(), loc));
  mask = before->getArgument(0);
  takeForms(op.getBeforeArguments(), before->getArguments().drop_front(own));
  widen(*op.getBeforeBody());
  loc = op.getLoc();
  scf::ConditionOp condition = op.getConditionOp();
  Value was = before->getArgument(0);
  Value live = both(was, vector(condition.getCondition()));
  Values passed{live};
  // Lanes that go on hold their values, too; the last time counts.
  for (auto [i, position] : llvm::enumerate(held.positions))
    passed.push_back(choose(was, vector(condition.getArgs()[position]),
                            before->getArgument(1 + i)));
  for (auto [argument, value] :
       llvm::zip_equal(op.getAfterArguments(), condition.getArgs()))
    appendForms(argument, value, passed);
  scf::ConditionOp::create(b, loc, any(live), passed);

  Block *after = b.createBlock(&loop.getAfter(), {}, afterTypes,
                               SmallVector<Location>(afterTypes.size(), loc));
  mask = after->getArgument(0);
  takeForms(op.getAfterArguments(), after->getArguments().drop_front(own));
  widen(*op.getAfterBody());
  loc = op.getLoc();
  Values next(after->getArguments().take_front(own));
  for (auto [argument, value] : llvm::zip_equal(
           op.getBeforeArguments(), op.getYieldOp().getOperands()))
    appendForms(argument, value, next);
  scf::YieldOp::create(b, loc, next);
  mask = outer;
  for (auto [i, position] : llvm::enumerate(held.positions))
    setVector(op.getResult(position), loop.getResult(1 + i));
}
