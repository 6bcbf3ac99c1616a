//===- ThreadVariance.cpp - Divergence analysis over threads --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A forward data flow over structured control flow. Every value has the set of
// things it depends on (thread indices, what only the thread knows, the moment)
// and, if it is linear in the last thread index, its step. Sets only grow and
// steps only get lost, so loops are visited until nothing changes.
//
// Control flow joins: what a branch yields depends on its condition unless both
// arms yield the same value; what a loop results in depends on when it ends.
// Inside of a loop that lanes leave at different times those that are still in
// it agree on everything that does not depend on the thread, such as a counter;
// after it they do not.
//
// A load of an array that the kernel writes may give other threads, which come
// earlier or later, another value: it depends on the moment.
//
// The quotient of the last index and 16, say, is the same for 16 threads if the
// index of the first is a multiple of 16: for lanes of groups that begin so.
//
//===----------------------------------------------------------------------===//

#include "ThreadVariance.h"

#include "ArrayOrigins.h"
#include "Effects.h"
#include "GeometryMemory.h"
#include "GridReads.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpAttributes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

#include <numeric>

using namespace mlir;
using warp::ThreadVariance;

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

/// An argument of the kernel or its gradients; null for any other array.
static Value getKnownRoot(Value array) {
  Value root = warp::rootOf(array);
  Value named = root;
  if (auto grad = root.getDefiningOp<warp::GradOp>())
    named = grad.getArray();
  auto argument = dyn_cast<BlockArgument>(named);
  bool known =
      argument && isa<FunctionOpInterface>(argument.getOwner()->getParentOp());
  return known ? root : Value();
}

void ThreadVariance::collectWrites() {
  auto note = [&](Value array) {
    Value root = getKnownRoot(array);
    writesUnknown |= !root;
    written.insert(root);
  };
  function->walk([&](Operation *op) {
    auto access = dyn_cast<warp::AccessOp>(op);
    if (access && access.mayWrite())
      note(access.getArray());
    auto call = dyn_cast<func::CallOp>(op);
    if (!call)
      return;
    warp::CallEffects effects = called.of(call);
    writesUnknown |= effects.writesOther;
    for (unsigned i : effects.writes.set_bits())
      note(call.getOperand(i));
  });
}

bool ThreadVariance::isWritten(Value array) const {
  if ((written.empty() && !writesUnknown) || warp::isGeometryMemory(array))
    return false;
  Value root = getKnownRoot(array);
  return mayOverlap || writesUnknown || !root || written.contains(root);
}

//===----------------------------------------------------------------------===//
// States
//===----------------------------------------------------------------------===//

ThreadVariance::ThreadVariance(FunctionOpInterface function,
                               std::optional<bool> disjoint, int64_t lanes)
    : function(function), lanes(lanes) {
  collectWrites();
  unsigned rank = 1;
  function->walk([&](Operation *op) {
    if (auto threads = dyn_cast<warp::ThreadsOp>(op))
      rank = threads.getIndices().size();
    else if (isa<warp::TidOp>(op))
      rank = std::max(rank, op->getNumResults());
  });
  lastIndex = 1 << (rank - 1);
  auto variant =
      function->getAttrOfType<warp::VariantAttr>(warp::attr::variant);
  mayOverlap = !disjoint.value_or(variant && variant.getDisjoint());
  for (BlockArgument argument : function.getArguments())
    states[argument] = State();
  propagate();
}

/// Memory that arguments do not overlap in the caller they do not here, as the
/// caller says of each if it is written.
ThreadVariance::ThreadVariance(func::FuncOp function,
                               ArrayRef<LaneArgument> arguments, bool anyWrites)
    : function(function), mayOverlap(false), lanes(0) {
  collectWrites();
  if (anyWrites)
    written.insert(Value());
  for (auto [argument, fact] :
       llvm::zip_equal(function.getArguments(), arguments)) {
    states[argument] =
        fact.varies ? State{uint16_t(Own | Moment), noStep} : State{Moment, 0};
    if (fact.isWritten)
      written.insert(argument);
  }
  propagate();
}

void ThreadVariance::propagate() {
  do {
    changed = false;
    visit(function.getFunctionBody());
  } while (changed);
}

ThreadVariance::State ThreadVariance::get(Value value) const {
  auto found = states.find(value);
  return found == states.end() ? State() : found->second;
}

void ThreadVariance::join(Value value, State state) {
  auto [place, inserted] = states.try_emplace(value, state);
  if (inserted) {
    changed = true;
    return;
  }
  State joined = place->second;
  joined.sources |= state.sources;
  if (joined.step != state.step)
    joined.step = noStep;
  if (!varies(joined))
    joined.step = 0;
  changed |= !(joined == place->second);
  place->second = joined;
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

void ThreadVariance::visit(Region &region) {
  for (Block &block : region)
    for (Operation &op : block)
      visit(&op);
}

/// True if an operation does nothing but say which thread this is.
bool ThreadVariance::visitIndices(Operation *op) {
  auto index = [&](unsigned d) {
    return State{uint16_t(1 << d), lastIndex == 1 << d};
  };
  if (auto tid = dyn_cast<warp::TidOp>(op)) {
    for (OpResult result : tid->getResults())
      join(result, index(result.getResultNumber()));
    return true;
  }
  auto read = op->getNumResults() == 1 ? warp::getGridRead(op->getResult(0))
                                       : std::nullopt;
  if (!read)
    return false;
  State state;
  switch (read->value) {
  case warp::GridValue::threadId:
    state = index(unsigned(read->axis));
    break;
  case warp::GridValue::blockId:
    state.sources = Place;
    break;
  case warp::GridValue::blockDim:
  case warp::GridValue::gridDim:
    break;
  case warp::GridValue::laneId:
    state = {Own, noStep};
    break;
  }
  join(op->getResult(0), state);
  return true;
}

void ThreadVariance::visit(Operation *op) {
  if (auto threads = dyn_cast<warp::ThreadsOp>(op)) {
    for (auto [d, index] : llvm::enumerate(threads.getIndices()))
      join(index, {uint16_t(1 << d), lastIndex == 1 << d});
    return visit(threads.getBody());
  }
  if (isa<scf::IfOp>(op))
    return visitIf(op);
  if (isa<scf::ForOp>(op))
    return visitFor(op);
  if (isa<scf::WhileOp>(op))
    return visitWhile(op);
  if (visitIndices(op))
    return;
  if (isa<warp::AgreeOp, warp::MostTripsOp>(op))
    return join(op->getResult(0), {Moment, 0});
  if (isa<warp::ScratchOp, warp::ScratchLoadOp, warp::ScratchStoreOp>(op))
    return visitScratch(op);
  for (Region &region : op->getRegions())
    visit(region);
  State state = transfer(op);
  for (Value result : op->getResults())
    join(result, state);
}

bool ThreadVariance::readsWritten(func::CallOp call) const {
  warp::CallEffects effects = called.of(call);
  return (effects.readsOther && hasWrites()) ||
         llvm::any_of(effects.reads.set_bits(), [&](unsigned i) {
           return isWritten(call.getOperand(i));
         });
}

bool ThreadVariance::isOneCall(func::CallOp call) const {
  return !called.of(call).mayWrite() &&
         llvm::none_of(call.getOperands(),
                       [&](Value value) { return varies(get(value)); });
}

ThreadVariance::State ThreadVariance::transferCall(func::CallOp call) {
  State state;
  for (Value operand : call.getOperands())
    state.sources |= get(operand).sources;
  if (called.of(call).mayWrite())
    state.sources |= Own | Moment | Written;
  else if (readsWritten(call))
    state.sources |= Moment | Written;
  state.step = varies(state) ? noStep : 0;
  return state;
}

/// The dependences of the results of an operation without regions.
ThreadVariance::State ThreadVariance::transfer(Operation *op) {
  if (auto call = dyn_cast<func::CallOp>(op))
    return transferCall(call);
  State state;
  for (Value operand : op->getOperands())
    state.sources |= get(operand).sources;
  // Rows differ, but not in length.
  if (isa<warp::DimOp>(op))
    state = get(form(op->getResult(0)).getSymbol()->getValue());
  auto access = dyn_cast<warp::AccessOp>(op);
  bool isLoad = access && !access.mayWrite();
  if (isLoad && isWritten(access.getArray()))
    state.sources |= Moment | Written;
  else if (!isLoad && !warp::isConversion(op) && !isMemoryEffectFree(op))
    state.sources |= access && access.isUpdate() ? Own | Moment | Written : Own;
  else if (auto call = dyn_cast<warp::LibraryCallOp>(op);
           call && call.getCallee() == warp::threadMemory)
    state.sources |= Own;
  if (int64_t run = runOf(op); run > 1 && !(state.sources & Own)) {
    longestRun = std::max(longestRun, run);
    if (lanes > 1 && run % lanes == 0)
      state.sources = (state.sources & ~lastIndex) | Run;
  }
  state.step = varies(state) ? stepOf(op) : 0;
  return state;
}

/// For a quotient of the last index plus what all lanes share, or for its bits
/// from some place on: the power of two of threads that have the same if the
/// index of the first is a multiple of that. 1 for all else.
int64_t ThreadVariance::runOf(Operation *op) const {
  APInt number;
  if (!isa<arith::DivSIOp, arith::DivUIOp, arith::ShRSIOp, arith::ShRUIOp,
           arith::AndIOp>(op) ||
      !matchPattern(op->getOperand(1), m_ConstantInt(&number)) ||
      !varies(get(op->getOperand(0))) || number.getSignificantBits() > 32)
    return 1;
  Value value = op->getOperand(0);
  int64_t by = number.getSExtValue();
  if (isa<arith::ShRSIOp, arith::ShRUIOp>(op))
    by = by >= 0 && by < 31 ? int64_t(1) << by : 1;
  // The bits below the lowest that is kept.
  if (isa<arith::AndIOp>(op))
    by = by & -by;
  // Quotients round towards zero.
  if (by < 2 || (isa<arith::DivSIOp>(op) && !isNonNegative(value, nullptr)))
    return 1;
  Symbol last = Symbol::thread(llvm::Log2_32(lastIndex));
  const Form &sum = form(value);
  std::optional<Form> own = sum.coefficientOf(last);
  std::optional<int64_t> factor = own ? own->getConstant() : std::nullopt;
  if (!factor || *factor < 1 || !llvm::isPowerOf2_64(*factor))
    return 1;
  Form rest = sum.without(last);
  uint64_t shared = std::gcd(uint64_t(by), rest.getDivisor());
  for (const Term &term : rest.terms)
    for (Symbol symbol : term.product)
      if (agreement(symbol, Scope::Lanes) == Agreement::No)
        return 1;
  int64_t run = int64_t(shared & -shared) / *factor;
  return std::max<int64_t>(run, 1);
}

/// Memory of the thread has the state of everything that is stored there:
/// where, and whether all lanes come to the store.
void ThreadVariance::visitScratch(Operation *op) {
  if (auto scratch = dyn_cast<warp::ScratchOp>(op))
    return join(scratch.getResult(), {Moment, 0});
  if (auto load = dyn_cast<warp::ScratchLoadOp>(op)) {
    State state = get(load.getScratch());
    State index = get(load.getIndex());
    // Lanes that use different slots have memory of their own.
    if (varies(index))
      join(load.getScratch(), {index.sources, noStep});
    state.sources |= index.sources;
    state.step = varies(state) ? noStep : 0;
    return join(load.getResult(), state);
  }
  auto store = cast<warp::ScratchStoreOp>(op);
  State state = get(store.getValue());
  state.sources |= get(store.getIndex()).sources | Moment;
  for (Operation *around = op->getParentOp(); around != function;
       around = around->getParentOp()) {
    if (isDivergent(around))
      state.sources |= Own;
    for (Value decision : decisionsOf(around))
      state.sources |= get(decision).sources & Written;
  }
  state.step = varies(state) ? noStep : 0;
  join(store.getScratch(), state);
}

int64_t ThreadVariance::stepOf(Operation *op) const {
  auto of = [&](unsigned i) { return get(op->getOperand(i)).step; };
  auto factor = [&](unsigned i) -> std::optional<int64_t> {
    APInt number;
    if (!matchPattern(op->getOperand(i), m_ConstantInt(&number)) ||
        number.getSignificantBits() > 32)
      return std::nullopt;
    return number.getSExtValue();
  };
  auto scaled = [](int64_t step, int64_t by) {
    int64_t product;
    bool fits = step != noStep && !llvm::MulOverflow(step, by, product);
    return fits ? product : noStep;
  };
  if (isa<arith::AddIOp, warp::AddOp>(op))
    return of(0) == noStep || of(1) == noStep ? noStep : of(0) + of(1);
  if (isa<arith::SubIOp, warp::SubOp>(op))
    return of(0) == noStep || of(1) == noStep ? noStep : of(0) - of(1);
  if (isa<arith::MulIOp, warp::MulOp>(op)) {
    if (auto by = factor(1))
      return scaled(of(0), *by);
    if (auto by = factor(0))
      return scaled(of(1), *by);
    return noStep;
  }
  if (isa<arith::ShLIOp>(op))
    if (auto by = factor(1); by && *by >= 0 && *by < 31)
      return scaled(of(0), int64_t(1) << *by);
  if (isa<arith::ExtSIOp, arith::ExtUIOp, arith::IndexCastOp, arith::TruncIOp,
          warp::CastOp>(op))
    return stepOfCast(op);
  if (isa<arith::SelectOp>(op) && !varies(get(op->getOperand(0))))
    return of(1) == of(2) ? of(1) : noStep;
  return noStep;
}

/// An unsigned number that may have been a negative one before has no step:
/// where it wraps, in a lane that is not there or does not come to the access,
/// others would count from it.
int64_t ThreadVariance::stepOfCast(Operation *op) const {
  Value source = op->getOperand(0);
  unsigned from = getIntegerBits(source.getType());
  unsigned to = getIntegerBits(op->getResult(0).getType());
  if (from <= 1 || to < 32)
    return noStep;
  bool isSigned =
      isa<arith::ExtSIOp, arith::IndexCastOp>(op) ||
      (isa<warp::CastOp>(op) && !source.getType().isUnsignedInteger());
  if (to > from && !isSigned && !isNonNegative(source, nullptr))
    return noStep;
  return get(source).step;
}

//===----------------------------------------------------------------------===//
// Control flow
//===----------------------------------------------------------------------===//

void ThreadVariance::visitIf(Operation *op) {
  auto branch = cast<scf::IfOp>(op);
  visit(branch.getThenRegion());
  visit(branch.getElseRegion());
  State condition = get(branch.getCondition());
  for (OpResult result : op->getResults()) {
    unsigned i = result.getResultNumber();
    Value then = branch.thenYield().getOperand(i);
    Value otherwise = branch.elseYield().getOperand(i);
    State state = get(then), other = get(otherwise);
    if (then != otherwise) {
      if (state.step != other.step || varies(condition))
        state.step = noStep;
      state.sources |= other.sources | condition.sources;
    }
    if (!varies(state))
      state.step = 0;
    join(result, state);
  }
}

void ThreadVariance::visitFor(Operation *op) {
  auto loop = cast<scf::ForOp>(op);
  State lower = get(loop.getLowerBound()), step = get(loop.getStep());
  State counter{uint16_t(lower.sources | step.sources | Moment), noStep};
  if (!varies(counter))
    counter.step = 0;
  else if (!varies(step))
    counter.step = lower.step;
  join(loop.getInductionVar(), counter);
  auto moment = [&](State state) {
    state.sources |= Moment;
    return state;
  };
  for (auto [argument, init] :
       llvm::zip_equal(loop.getRegionIterArgs(), loop.getInitArgs()))
    join(argument, moment(get(init)));
  visit(loop.getRegion());
  uint16_t end =
      lower.sources | step.sources | get(loop.getUpperBound()).sources;
  for (auto [argument, yielded, result] :
       llvm::zip_equal(loop.getRegionIterArgs(), loop.getYieldedValues(),
                       loop.getResults())) {
    if (yielded != argument)
      join(argument, moment(get(yielded)));
    State state = get(argument);
    if (yielded != argument) {
      state.sources |= end;
      if (isDivergent(op))
        state.step = noStep;
    }
    join(result, state);
  }
}

void ThreadVariance::visitWhile(Operation *op) {
  auto loop = cast<scf::WhileOp>(op);
  for (auto [argument, init] :
       llvm::zip_equal(loop.getBeforeArguments(), loop.getInits())) {
    State state = get(init);
    state.sources |= Moment;
    join(argument, state);
  }
  visit(loop.getBefore());
  scf::ConditionOp condition = loop.getConditionOp();
  State end = get(condition.getCondition());
  for (auto [argument, result, passed] : llvm::zip_equal(
           loop.getAfterArguments(), loop.getResults(), condition.getArgs())) {
    State state = get(passed);
    join(argument, state);
    state.sources |= end.sources;
    if (varies(end))
      state.step = noStep;
    join(result, state);
  }
  visit(loop.getAfter());
  for (auto [argument, yielded] : llvm::zip_equal(
           loop.getBeforeArguments(), loop.getYieldOp().getOperands())) {
    State state = get(yielded);
    state.sources |= Moment;
    join(argument, state);
  }
}
