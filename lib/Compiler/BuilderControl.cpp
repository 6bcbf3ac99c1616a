//===- BuilderControl.cpp - Branches and loops ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Results of a branch, and what a loop carries besides its initial values,
// are known only when it closes. So `scf.if` is created without results and
// replaced by one with results that takes its regions; likewise loops, whose
// bodies may get block arguments while they are open (`carry`).
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

using namespace mlir;

static void requireSame(warp::Builder::Impl &impl, ValueRange a, ValueRange b,
                        StringRef what) {
  if (TypeRange(a) == TypeRange(b))
    return;
  impl.failType(what.str() + " expects " + warp::quotedTypes(TypeRange(a)) +
                ", but got " + warp::quotedTypes(TypeRange(b)));
}

//===----------------------------------------------------------------------===//
// if
//===----------------------------------------------------------------------===//

void warp::Builder::beginIf(Value condition) {
  ContextLock lock;
  mlir::Value test = unwrap(condition);
  if (!test.getType().isInteger(1))
    impl->failType("a condition must be 'bool', but got " +
                   quoted(test.getType()));
  OpBuilder &b = impl->builder;
  auto op = scf::IfOp::create(b, impl->loc, TypeRange(), test,
                              /*addThenBlock=*/true, /*addElseBlock=*/true);
  impl->function().ifs.push_back(op);
  b.setInsertionPointToEnd(op.thenBlock());
}

void warp::Builder::beginElse() {
  ContextLock lock;
  auto &ifs = impl->function().ifs;
  if (ifs.empty())
    impl->fail(Error::Kind::Value, "no branch is open");
  impl->builder.setInsertionPointToEnd(ifs.back().elseBlock());
}

warp::Builder::Values warp::Builder::endIf(const Values &thenValues,
                                           const Values &elseValues) {
  ContextLock lock;
  auto &ifs = impl->function().ifs;
  if (ifs.empty())
    impl->fail(Error::Kind::Value, "no branch is open");
  SmallVector<mlir::Value> left = unwrap(thenValues);
  SmallVector<mlir::Value> right = unwrap(elseValues);
  requireSame(*impl, left, right, "a branch");
  OpBuilder &b = impl->builder;
  scf::IfOp open = ifs.pop_back_val();
  b.setInsertionPointToEnd(open.thenBlock());
  scf::YieldOp::create(b, impl->loc, left);
  b.setInsertionPointToEnd(open.elseBlock());
  scf::YieldOp::create(b, impl->loc, right);
  b.setInsertionPoint(open);
  scf::IfOp closed = open;
  if (!left.empty()) {
    closed = scf::IfOp::create(b, open.getLoc(), TypeRange(ValueRange(left)),
                               open.getCondition(), /*addThenBlock=*/false,
                               /*addElseBlock=*/false);
    closed.getThenRegion().takeBody(open.getThenRegion());
    closed.getElseRegion().takeBody(open.getElseRegion());
    closed->setDiscardableAttrs(open->getDiscardableAttrDictionary());
    open.erase();
  } else if (llvm::hasSingleElement(*open.elseBlock())) {
    open.elseBlock()->erase();
  }
  b.setInsertionPointAfter(closed);
  return wrap(closed.getResults());
}

//===----------------------------------------------------------------------===//
// Loops in general
//===----------------------------------------------------------------------===//

int warp::Builder::loopDepth() const {
  return impl->functions.empty() ? 0 : impl->functions.back().loops.size();
}

warp::Builder::Impl::Loop &
warp::Builder::Impl::innermostLoop(bool isFor) {
  auto &loops = function().loops;
  if (loops.empty() || loops.back().isFor != isFor)
    fail(Error::Kind::Value, "no such loop is open");
  return loops.back();
}

warp::Value warp::Builder::carry(int loop, Value init) {
  ContextLock lock;
  auto &loops = impl->function().loops;
  if (loop < 0 || loop >= static_cast<int>(loops.size()))
    impl->fail(Error::Kind::Value, "no open loop " + std::to_string(loop));
  Impl::Loop &open = loops[loop];
  mlir::Value first = unwrap(init);
  open.lateInits.push_back(first);
  mlir::Type type = first.getType();
  if (open.isFor)
    return wrap(open.op->getRegion(0).front().addArgument(type, impl->loc));
  auto op = llvm::cast<scf::WhileOp>(open.op);
  mlir::Value before = op.getBeforeBody()->addArgument(type, impl->loc);
  op.getConditionOp().getArgsMutable().append(before);
  return wrap(op.getAfterBody()->addArgument(type, impl->loc));
}

//===----------------------------------------------------------------------===//
// for
//===----------------------------------------------------------------------===//

/// The value with a signless integer type of the same width.
static mlir::Value toSignless(warp::Builder::Impl &impl, mlir::Value value) {
  mlir::Type type = warp::getSignless(value.getType());
  return warp::CastOp::create(impl.builder, impl.loc, type, value);
}

static void checkBounds(warp::Builder::Impl &impl, mlir::Value lo,
                        mlir::Value hi, mlir::Value step) {
  mlir::Type type = lo.getType();
  if (!warp::isInteger(type) || hi.getType() != type || step.getType() != type)
    impl.failType("range expects integers of one type, but got " +
                  warp::quotedTypes({type, hi.getType(), step.getType()}));
}

/// A step known at compile time, or 0.
static int64_t knownStep(mlir::Value step) {
  std::optional<warp::Number> known = warp::wrap(step).constant();
  const int64_t *number = known ? std::get_if<int64_t>(&*known) : nullptr;
  return number ? *number : 0;
}

/// True if counting up to `hi` cannot leave the type after the last trip.
static bool staysInRange(mlir::Value hi, int64_t step) {
  if (step == 1)
    return true;
  std::optional<warp::Number> known = warp::wrap(hi).constant();
  const int64_t *bound = known ? std::get_if<int64_t>(&*known) : nullptr;
  if (!bound)
    return false;
  unsigned width = hi.getType().getIntOrFloatBitWidth();
  int64_t most = llvm::maxIntN(width);
  return *bound < 0 || step - 1 <= most - *bound;
}

warp::Value warp::Builder::tripCount(Value lo, Value hi, Value step) {
  ContextLock lock;
  mlir::Type type = unwrap(lo).getType();
  checkBounds(*impl, unwrap(lo), unwrap(hi), unwrap(step));
  unsigned width = type.getIntOrFloatBitWidth();
  Type count =
      wrap(impl->builder.getIntegerType(width, /*isSigned=*/false));
  auto binary = [&](const char *name, Value a, Value b) {
    return builtin(name, {a, b}).values[0];
  };
  // Distances wrap around to the right unsigned number.
  auto trips = [&](Value from, Value to, Value by) {
    Value distance = cast(binary("sub", to, from), count);
    Value runs = binary("lt", from, to);
    if (knownStep(unwrap(by)) == 1)
      return builtin("where", {runs, distance, zero(count)}).values[0];
    Value one = constant(count, int64_t(1));
    Value rounded = binary("div", binary("sub", distance, one),
                           cast(by, count));
    Value some = binary("add", rounded, one);
    return builtin("where", {runs, some, zero(count)}).values[0];
  };
  int64_t known = knownStep(unwrap(step));
  if (known > 0 || type.isUnsignedInteger())
    return trips(lo, hi, step);
  Value down = trips(hi, lo, builtin("neg", {step}).values[0]);
  if (known < 0)
    return down;
  Value none = zero(wrap(type));
  Value up = builtin("where", {binary("gt", step, none),
                               trips(lo, hi, step), zero(count)})
                 .values[0];
  Value descends = binary("lt", step, none);
  return builtin("where", {descends, down, up}).values[0];
}

warp::Builder::Values warp::Builder::beginFor(Value lo, Value hi, Value step,
                                              const Values &inits) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  mlir::Value first = unwrap(lo), by = unwrap(step);
  checkBounds(*impl, first, unwrap(hi), by);
  mlir::Type type = first.getType();
  bool direct = knownStep(by) > 0 && staysInRange(unwrap(hi), knownStep(by));
  // Others count trips from zero: a step beyond the last index may overflow.
  Value bound = direct ? hi : tripCount(lo, hi, step);
  mlir::Value last = toSignless(*impl, unwrap(bound));
  Value one = constant(wrap(type), int64_t(1));
  mlir::Value start =
      toSignless(*impl, direct ? first : unwrap(zero(wrap(type))));
  mlir::Value increment = toSignless(*impl, direct ? by : unwrap(one));
  auto op = scf::ForOp::create(b, impl->loc, start, last, increment,
                               unwrap(inits), nullptr,
                               !direct || type.isUnsignedInteger());
  Block *body = op.getBody();
  if (!body->empty())
    body->back().erase();
  impl->function().loops.push_back({op, {}, /*isFor=*/true});
  b.setInsertionPointToEnd(body);
  Value counter = wrap(
      CastOp::create(b, impl->loc, type, op.getInductionVar()).getResult());
  if (!direct) {
    Value offset = builtin("mul", {counter, step}).values[0];
    counter = builtin("add", {lo, offset}).values[0];
  }
  Values results{counter};
  for (mlir::Value carried : op.getRegionIterArgs())
    results.push_back(wrap(carried));
  return results;
}

warp::Builder::Values warp::Builder::endFor(const Values &yields,
                                            const Values &late) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  for (Value value : late)
    carry(loopDepth() - 1, zero(value.type()));
  Impl::Loop open = impl->innermostLoop(/*isFor=*/true);
  auto op = llvm::cast<scf::ForOp>(open.op);
  SmallVector<mlir::Value> values = unwrap(yields);
  llvm::append_range(values, unwrap(late));
  SmallVector<mlir::Value> inits(op.getInitArgs());
  llvm::append_range(inits, open.lateInits);
  requireSame(*impl, inits, values, "a loop");
  b.setInsertionPointToEnd(op.getBody());
  scf::YieldOp::create(b, impl->loc, values);
  b.setInsertionPoint(op);
  if (!open.lateInits.empty()) {
    auto closed = scf::ForOp::create(b, op.getLoc(), op.getLowerBound(),
                                     op.getUpperBound(), op.getStep(), inits,
                                     nullptr, op.getUnsignedCmp());
    closed.getRegion().takeBody(op.getRegion());
    op.erase();
    op = closed;
  }
  impl->function().loops.pop_back();
  b.setInsertionPointAfter(op);
  return wrap(op.getResults());
}

//===----------------------------------------------------------------------===//
// while
//===----------------------------------------------------------------------===//

warp::Builder::Values warp::Builder::beginWhile(const Values &inits) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  SmallVector<mlir::Value> values = unwrap(inits);
  TypeRange types{ValueRange(values)};
  auto op = scf::WhileOp::create(b, impl->loc, types, values);
  SmallVector<Location> locations(values.size(), impl->loc);
  Block *before = b.createBlock(&op.getBefore(), {}, types, locations);
  b.createBlock(&op.getAfter(), {}, types, locations);
  impl->function().loops.push_back({op, {}, /*isFor=*/false});
  b.setInsertionPointToEnd(before);
  return wrap(before->getArguments());
}

warp::Builder::Values
warp::Builder::whileCondition(Value condition, const Values &forwarded) {
  ContextLock lock;
  auto op = llvm::cast<scf::WhileOp>(impl->innermostLoop(false).op);
  SmallVector<mlir::Value> values = unwrap(forwarded);
  requireSame(*impl, op.getInits(), values, "a loop");
  scf::ConditionOp::create(impl->builder, impl->loc, unwrap(condition),
                           values);
  impl->builder.setInsertionPointToEnd(op.getAfterBody());
  return wrap(op.getAfterBody()->getArguments());
}

warp::Builder::Values warp::Builder::endWhile(const Values &yields,
                                              const Values &late) {
  ContextLock lock;
  OpBuilder &b = impl->builder;
  for (Value value : late)
    carry(loopDepth() - 1, zero(value.type()));
  Impl::Loop open = impl->innermostLoop(/*isFor=*/false);
  auto op = llvm::cast<scf::WhileOp>(open.op);
  SmallVector<mlir::Value> values = unwrap(yields);
  llvm::append_range(values, unwrap(late));
  SmallVector<mlir::Value> inits(op.getInits());
  llvm::append_range(inits, open.lateInits);
  requireSame(*impl, inits, values, "a loop");
  b.setInsertionPointToEnd(op.getAfterBody());
  scf::YieldOp::create(b, impl->loc, values);
  b.setInsertionPoint(op);
  if (!open.lateInits.empty()) {
    auto closed = scf::WhileOp::create(b, op.getLoc(),
                                       TypeRange(ValueRange(inits)), inits);
    closed.getBefore().takeBody(op.getBefore());
    closed.getAfter().takeBody(op.getAfter());
    op.erase();
    op = closed;
  }
  impl->function().loops.pop_back();
  b.setInsertionPointAfter(op);
  return wrap(op.getResults());
}
