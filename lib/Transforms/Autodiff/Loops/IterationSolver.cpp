//===- IterationSolver.cpp - Inversion of loop iterations -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An operation of an iteration is an equation between its operands and its
// result. Where all operands are known it gives the result, and where the
// result and all other operands are, it may give the operand:
//
//   r = x + y, x - y, x ^ y, ~x, -x      by integers, which wrap around
//   r = x * c                            c odd: times its inverse modulo 2^n
//   r = x ^ (x << c), x ^ (x >> c)       a product of such steps
//   r = (x << c) | (x >> n - c)          rotated back
//   r = cast x                           to an integer that is not narrower
//   ..., r = randf(x), ...               steps of PCG, whose lines all have an
//                                        inverse
//
// An integer that a loop carries is solved for from the value after the
// iteration. Floats are never: they round.
//
//===----------------------------------------------------------------------===//

#include "IterationSolver.h"

#include "Lowerings/Pcg.h"
#include "Analysis/Effects.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using namespace warp::autodiff;

//===----------------------------------------------------------------------===//
// Known values
//===----------------------------------------------------------------------===//

Value IterationSolver::find(Value primal) {
  Value value = trace(primal);
  if (!loop->isAncestor(value.getParentRegion()->getParentOp()))
    return reverse.recover(value);
  return known.lookup(value);
}

void IterationSolver::learn(Value primal, Value found) {
  known.try_emplace(trace(primal), found);
}

LogicalResult IterationSolver::run() {
  SmallVector<Operation *> left;
  for (Region &region : loop->getRegions())
    for (Operation &op : region.front().without_terminator())
      if (op.getNumRegions() == 0 && op.getNumResults() != 0)
        left.push_back(&op);
  for (size_t before = 0; before != known.size();) {
    before = known.size();
    for (Operation *op : left)
      if (failed(goForward(op)))
        return failure();
    for (Operation *op : llvm::reverse(left))
      goBackward(op);
  }
  return success();
}

/// True if an operation gives the same bits wherever it is. Arithmetic of floats
/// may not: products are fused with sums in one place and not in another.
static bool isExact(Operation *op) {
  return warp::isPlainRead(op) || isa<warp::CastOp, warp::ConstantOp>(op) ||
         (isMemoryEffectFree(op) &&
          llvm::none_of(op->getResultTypes(), [](Type type) {
            return bool(differentialType(type));
          }));
}

LogicalResult IterationSolver::goForward(Operation *op) {
  if (find(op->getResult(0)) || !isExact(op) ||
      !llvm::all_of(op->getOperands(), [&](Value v) { return find(v); }))
    return success();
  for (Value operand : op->getOperands())
    reverse.setRecovered(operand, find(operand));
  if (failed(reverse.replay(op)))
    return failure();
  for (Value result : op->getResults())
    learn(result, reverse.recover(result));
  return success();
}

//===----------------------------------------------------------------------===//
// Operands from results
//===----------------------------------------------------------------------===//

/// How many steps of PCG an operation takes its state through; 0 without one.
static unsigned countSteps(Operation *op) {
  using namespace warp;
  if (isa<RandfOp, RandiOp, RanduOp, SampleUnitRingOp>(op))
    return 1;
  if (isa<RandnOp, SampleUnitDiskOp, SampleUnitSquareOp,
          SampleUnitSphereSurfaceOp, SampleUnitHemisphereSurfaceOp,
          SampleTriangleOp>(op))
    return 2;
  if (isa<SampleUnitCubeOp, SampleUnitSphereOp, SampleUnitHemisphereOp>(op))
    return 3;
  return 0;
}

void IterationSolver::goBackward(Operation *op) {
  Value result = find(op->getResults().back());
  auto type = result ? dyn_cast<IntegerType>(result.getType()) : IntegerType();
  if (!type || type.getWidth() == 1 ||
      llvm::all_of(op->getOperands(), [&](Value v) { return find(v); }))
    return;
  if (unsigned steps = countSteps(op)) {
    for (; steps > 0; --steps)
      result = undoPcg(result);
    return learn(op->getOperand(0), result);
  }
  if (isa<warp::RandInitOp>(op))
    return solveRandInit(op, result);
  if (isa<warp::BitXorOp>(op))
    solveXor(op, result);
  if (isa<warp::BitXorOp, warp::BitOrOp, warp::AddOp>(op))
    solveRotation(op, result);
  if (isa<warp::MulOp>(op))
    return solveMul(op, result);
  solveArithmetic(op, result);
}

void IterationSolver::solveArithmetic(Operation *op, Value result) {
  if (auto cast = dyn_cast<warp::CastOp>(op)) {
    auto from = dyn_cast<IntegerType>(cast.getSource().getType());
    if (from && from.getWidth() != 1 &&
        from.getWidth() <= result.getType().getIntOrFloatBitWidth())
      learn(cast.getSource(),
            warp::CastOp::create(b, op->getLoc(), from, result));
    return;
  }
  if (isa<warp::InvertOp>(op))
    return learn(op->getOperand(0), emit<warp::InvertOp>(result));
  if (isa<warp::NegOp>(op))
    return learn(op->getOperand(0), emit<warp::NegOp>(result));
  if (!isa<warp::AddOp, warp::SubOp>(op))
    return;
  Value first = find(op->getOperand(0)), second = find(op->getOperand(1));
  if (!first && !second)
    return;
  if (isa<warp::AddOp>(op))
    return learn(op->getOperand(first ? 1 : 0),
                 emit<warp::SubOp>({result, first ? first : second}));
  if (first)
    learn(op->getOperand(1), emit<warp::SubOp>({first, result}));
  else
    learn(op->getOperand(0), emit<warp::AddOp>({result, second}));
}

void IterationSolver::solveMul(Operation *op, Value result) {
  for (unsigned i : {0, 1}) {
    APInt factor;
    if (!matchPattern(op->getOperand(i), m_ConstantInt(&factor)) || !factor[0])
      continue;
    Value inverse = constant(result.getType(), factor.multiplicativeInverse());
    return learn(op->getOperand(1 - i), emit<warp::MulOp>({result, inverse}));
  }
}

/// The value that `shifted` shifts, and by how much, if that is `Shift` of a
/// value without a sign by a constant.
template <typename Shift>
static std::pair<Value, uint64_t> matchShift(Value shifted) {
  auto shift = shifted.getDefiningOp<Shift>();
  APInt count;
  if (!shift || !shifted.getType().isUnsignedInteger() ||
      !matchPattern(shift->getOperand(1), m_ConstantInt(&count)) ||
      count.isZero() || count.uge(shifted.getType().getIntOrFloatBitWidth()))
    return {nullptr, 0};
  return {shift->getOperand(0), count.getZExtValue()};
}

void IterationSolver::solveXor(Operation *op, Value result) {
  for (unsigned i : {0, 1}) {
    Value other = op->getOperand(1 - i), term = op->getOperand(i);
    if (Value found = find(other)) {
      learn(term, emit<warp::BitXorOp>({result, found}));
      continue;
    }
    auto [left, leftBy] = matchShift<warp::LShiftOp>(term);
    auto [right, rightBy] = matchShift<warp::RShiftOp>(term);
    if (left && trace(left) == trace(other))
      learn(other, undoShiftedXor<warp::LShiftOp>(
                       result, constant(result.getType(), leftBy), leftBy));
    else if (right && trace(right) == trace(other))
      learn(other, undoShiftedXor<warp::RShiftOp>(
                       result, constant(result.getType(), rightBy), rightBy));
  }
}

/// No bit is in both terms, so that it does not matter how they are joined.
void IterationSolver::solveRotation(Operation *op, Value result) {
  Type type = result.getType();
  for (unsigned i : {0, 1}) {
    auto [left, leftBy] = matchShift<warp::LShiftOp>(op->getOperand(i));
    auto [right, rightBy] = matchShift<warp::RShiftOp>(op->getOperand(1 - i));
    if (!left || !right || trace(left) != trace(right) ||
        leftBy + rightBy != type.getIntOrFloatBitWidth())
      continue;
    Value down = emit<warp::RShiftOp>({result, constant(type, leftBy)});
    Value up = emit<warp::LShiftOp>({result, constant(type, rightBy)});
    learn(left, emit<warp::BitOrOp>({down, up}));
  }
}

/// The state is pcg(seed), or pcg(seed + pcg(offset)).
void IterationSolver::solveRandInit(Operation *op, Value result) {
  Value sum = undoPcg(result);
  Location loc = op->getLoc();
  auto finish = [&](unsigned operand, Value word) {
    Value primal = op->getOperand(operand);
    learn(primal, warp::CastOp::create(b, loc, primal.getType(), word));
  };
  if (op->getNumOperands() == 1)
    return finish(0, sum);
  if (Value offset = find(op->getOperand(1))) {
    Value hashed = warp::RandInitOp::create(b, loc, TypeRange(sum.getType()),
                                            ValueRange(offset))
                       ->getResult(0);
    return finish(0, emit<warp::SubOp>({sum, hashed}));
  }
  if (Value seed = find(op->getOperand(0))) {
    Value word = warp::CastOp::create(b, loc, sum.getType(), seed);
    finish(1, undoPcg(emit<warp::SubOp>({sum, word})));
  }
}

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

template <typename Op> Value IterationSolver::emit(ValueRange operands) {
  return Op::create(b, loop->getLoc(), TypeRange(operands[0].getType()),
                    operands)
      ->getResult(0);
}

Value IterationSolver::constant(Type type, const APInt &value) {
  return warp::ConstantOp::create(b, loop->getLoc(),
                                  b.getIntegerAttr(type, value));
}

Value IterationSolver::constant(Type type, uint64_t value) {
  return constant(type, APInt(type.getIntOrFloatBitWidth(), value));
}

/// x from x ^ (x shifted). As steps, 1 + S with a nilpotent S has the inverse
/// (1 + S)(1 + S^2)(1 + S^4)..., until nothing is left of the width.
template <typename Shift>
Value IterationSolver::undoShiftedXor(Value value, Value shift,
                                      unsigned smallest) {
  unsigned width = value.getType().getIntOrFloatBitWidth();
  for (; smallest < width; smallest *= 2) {
    value = emit<warp::BitXorOp>({value, emit<Shift>({value, shift})});
    shift = emit<warp::AddOp>({shift, shift});
  }
  return value;
}

/// The state before a step of PCG, line by line from the last. The shift of a
/// line shifts by is in bits that it leaves alone.
Value IterationSolver::undoPcg(Value state) {
  namespace pcg = warp::pcg;
  Type type = state.getType();
  auto number = [&](uint32_t value) { return constant(type, value); };
  auto inverse = [&](uint32_t value) {
    return constant(type, APInt(32, value).multiplicativeInverse());
  };
  Value word = undoShiftedXor<warp::RShiftOp>(state, number(pcg::lastShift),
                                              pcg::lastShift);
  Value mixed = emit<warp::MulOp>({word, inverse(pcg::mixer)});
  Value top = emit<warp::RShiftOp>({mixed, number(pcg::topShift)});
  Value shift = emit<warp::AddOp>({top, number(pcg::leastShift)});
  Value next = undoShiftedXor<warp::RShiftOp>(mixed, shift, pcg::leastShift);
  Value product = emit<warp::SubOp>({next, number(pcg::increment)});
  return emit<warp::MulOp>({product, inverse(pcg::multiplier)});
}
