//===- LowerTilesLoops.cpp - Scalars, and loops over elements -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "KernelFunction.h"
#include "Transforms/Launch/UnrollLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Scalars
//===----------------------------------------------------------------------===//

Value TileLowering::number(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

bool TileLowering::isConstant(Value value, int64_t number) {
  APInt constant;
  return matchPattern(value, m_ConstantInt(&constant)) &&
         constant.getSExtValue() == number;
}

/// x op y, where `neutral` changes nothing.
template <typename Op>
Value TileLowering::combined(Value x, Value y, int64_t neutral) {
  if (isConstant(y, neutral))
    return x;
  if (isConstant(x, neutral) && Op::template hasTrait<OpTrait::IsCommutative>())
    return y;
  return Op::create(b, loc, x, y, arith::IntegerOverflowFlags::nsw);
}

Value TileLowering::add(Value x, Value y) {
  return combined<arith::AddIOp>(x, y, 0);
}

Value TileLowering::sub(Value x, Value y) {
  return combined<arith::SubIOp>(x, y, 0);
}

Value TileLowering::mul(Value x, Value y) {
  return combined<arith::MulIOp>(x, y, 1);
}

Value TileLowering::less(Value x, Value y) {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, x, y);
}

Value TileLowering::both(Value x, Value y) {
  if (!x || !y)
    return x ? x : y;
  return arith::AndIOp::create(b, loc, x, y);
}

Value TileLowering::toIndex(Value value) { return cast(value, i32); }

Value TileLowering::cast(Value value, Type type) {
  if (value.getType() == type)
    return value;
  return CastOp::create(b, loc, type, value);
}

Value TileLowering::builtin(StringRef name, ValueRange operands) {
  return createBuiltin(b, loc, name, operands)->getResult(0);
}

Value TileLowering::zero(Type type) { return makeZero(b, loc, type); }

Value TileLowering::constant(Type type, double value) {
  TypedAttr attribute;
  if (auto real = dyn_cast<FloatType>(type))
    attribute = b.getFloatAttr(real, value);
  else
    attribute = b.getIntegerAttr(type, int64_t(value));
  return ConstantOp::create(b, loc, attribute);
}

Values TileLowering::inlineBody(Block &body, ValueRange arguments) {
  IRMapping map;
  map.map(body.getArguments(), arguments);
  for (Operation &op : body.without_terminator())
    b.clone(op, map);
  return llvm::map_to_vector(body.getTerminator()->getOperands(),
                             [&](Value v) { return map.lookupOrDefault(v); });
}

//===----------------------------------------------------------------------===//
// Loops
//===----------------------------------------------------------------------===//

void TileLowering::barrier() {
  if (threads > 1)
    BarrierOp::create(b, loc);
}

void TileLowering::ifHolds(Value condition, function_ref<void()> make) {
  if (!condition)
    return make();
  auto branch = scf::IfOp::create(b, loc, condition, /*withElse=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  make();
}

Value TileLowering::ifHolds(Value condition, Type type,
                            function_ref<Value()> make) {
  if (!condition)
    return make();
  auto branch = scf::IfOp::create(b, loc, TypeRange(type), condition,
                                  /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, make());
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, zero(type));
  return branch.getResult(0);
}

void TileLowering::byFirstThread(function_ref<void()> make) {
  Value first;
  if (threads > 1)
    first = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, thread,
                                  number(0));
  ifHolds(first, make);
}

Values TileLowering::loop(Value begin, Value end, Value step, ValueRange sums,
                          function_ref<Values(Value, ValueRange)> body) {
  auto op = scf::ForOp::create(b, loc, begin, end, step, sums);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(op.getBody());
  Values next = body(op.getInductionVar(), op.getRegionIterArgs());
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(op.getResults());
}

void TileLowering::loop(int64_t end, function_ref<void(Value)> body) {
  loop(number(0), number(end), number(1), {}, [&](Value i, ValueRange) {
    body(i);
    return Values();
  });
}

/// Keeps the innermost loop over elements on a CPU for the vectoriser. Copies
/// of its body in its place, which LLVM makes before that if they are few,
/// would leave it the next loop, whose iterations are not neighbours in memory.
static void keepForVectors(scf::ForOp loop) {
  constexpr int64_t fewest = 8, most = 256;
  std::optional<int64_t> trips = getConstantTrips(loop);
  if (!trips || *trips < fewest || *trips > most || loop.getNumResults() != 0)
    return;
  WalkResult inner = loop.getBody()->walk(
      [](LoopLikeOpInterface) { return WalkResult::interrupt(); });
  if (!inner.wasInterrupted())
    setRolled(loop);
}

Values TileLowering::nest(ArrayRef<int64_t> shape, Values &indices,
                          ValueRange sums, Body body) {
  if (indices.size() == shape.size())
    return body(indices, sums);
  int64_t extent = shape[indices.size()];
  auto inner = [&](Value i, ValueRange sums) {
    indices.push_back(i);
    Values next = nest(shape, indices, sums, body);
    indices.pop_back();
    return next;
  };
  if (extent == 1)
    return inner(number(0), sums);
  Values made = loop(number(0), number(extent), number(1), sums, inner);
  if (sums.empty() && !getTarget(kernel).isSimt())
    keepForVectors(cast<scf::ForOp>(*std::prev(b.getInsertionPoint())));
  return made;
}

/// The elements from `first` on, fewer than there are threads.
Values TileLowering::shareLeft(ArrayRef<int64_t> shape, int64_t first,
                               ValueRange sums, Body body) {
  int64_t left = ShapedType::getNumElements(shape) - first;
  auto branch =
      scf::IfOp::create(b, loc, sums.getTypes(), less(thread, number(left)),
                        /*withElseRegion=*/!sums.empty());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  Values next = body(unravel(add(thread, number(first)), shape), sums);
  if (sums.empty())
    return {};
  scf::YieldOp::create(b, loc, next);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, sums);
  return branch.getResults();
}

Values TileLowering::share(ArrayRef<int64_t> shape, ValueRange sums,
                           Body body) {
  Values indices;
  if (threads == 1)
    return nest(shape, indices, sums, body);
  int64_t count = 1;
  for (int64_t extent : shape)
    count *= extent;
  int64_t rounds = count / threads, left = count % threads;
  bool isSimt = getTarget(kernel).isSimt();
  if (left != 0 && (rounds <= 1 || state.isDistributed || !isSimt))
    return loop(thread, number(count), number(threads), sums,
                [&](Value e, ValueRange sums) {
                  return body(unravel(e, shape), sums);
                });
  auto treat = [&](Value number, ValueRange sums) {
    state.round = number;
    Value e = add(mul(number, this->number(threads)), thread);
    return body(unravel(e, shape), sums);
  };
  if (rounds > 1 && !state.isDistributed) {
    // As many rounds as are known can have copies, whose loads do not wait for
    // each other; the first threads take what is left.
    Values next = loop(number(0), number(rounds), number(1), sums, treat);
    // Memory is busy as long as many elements are on their way to each thread.
    constexpr int64_t copies = 8;
    if (!sums.empty() && rounds > copies && isSimt)
      setCopies(next[0].getDefiningOp<scf::ForOp>(), copies);
    return left == 0 ? next : shareLeft(shape, rounds * threads, next, body);
  }
  // Registers have no numbers.
  Values next(sums);
  for (int64_t t = 0; t < rounds; ++t)
    next = treat(number(t), next);
  return next;
}

void TileLowering::share(ArrayRef<int64_t> shape,
                         function_ref<void(ValueRange)> body) {
  share(shape, {}, [&](ValueRange indices, ValueRange) {
    body(indices);
    return Values();
  });
}

} // namespace warp::tiles
