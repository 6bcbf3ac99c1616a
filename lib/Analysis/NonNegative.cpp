//===- NonNegative.cpp - Indices that need no wrapping --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A negative index counts from the end, which costs a comparison and a select
// per access and hides from LLVM that neighbouring threads touch neighbouring
// elements. Most indices can be told not to be negative: thread indices, loop
// counters, extents, sums and products of such; and `i - 1` where a branch
// around the access lets only positive `i` pass.
//
//===----------------------------------------------------------------------===//

#include "NonNegative.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/ControlFlowInterfaces.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;
using namespace warp;

/// A thread index of a launch: it and its successor fit 32 bits. In an entry it
/// is the block's first index plus the one within, on a GPU, or what is left of
/// a 64-bit counter; nothing else is marked so.
static bool isThreadIndex(mlir::Value value) {
  if (auto argument = dyn_cast<BlockArgument>(value))
    return isa<ThreadsOp>(argument.getOwner()->getParentOp());
  constexpr auto noWrap =
      arith::IntegerOverflowFlags::nsw | arith::IntegerOverflowFlags::nuw;
  if (auto sum = value.getDefiningOp<arith::AddIOp>())
    return bitEnumContainsAll(sum.getOverflowFlags(), noWrap);
  auto trunc = value.getDefiningOp<arith::TruncIOp>();
  return trunc &&
         trunc.getOverflowFlags() != arith::IntegerOverflowFlags::none;
}

/// Whether some comparison that holds if `condition` is `truth` satisfies
/// `test`. Takes conjunctions apart, also those that evaluate their second part
/// only if need be.
static bool impliesAny(mlir::Value condition, bool truth, int depth,
                       function_ref<bool(arith::CmpIOp, bool)> test) {
  Operation *op = condition.getDefiningOp();
  if (!op || depth == 0)
    return false;
  auto any = [&](mlir::Value part, bool is) {
    return impliesAny(part, is, depth - 1, test);
  };
  if (auto compare = dyn_cast<arith::CmpIOp>(op))
    return test(compare, truth);
  if (truth ? isa<arith::AndIOp>(op) : isa<arith::OrIOp>(op))
    return any(op->getOperand(0), truth) || any(op->getOperand(1), truth);
  if (isa<arith::XOrIOp>(op) && matchPattern(op->getOperand(1), m_One()))
    return any(op->getOperand(0), !truth);
  auto branch = dyn_cast<scf::IfOp>(op);
  if (!branch)
    return false;
  unsigned i = cast<OpResult>(condition).getResultNumber();
  mlir::Value then = branch.thenYield().getOperand(i);
  mlir::Value otherwise = branch.elseYield().getOperand(i);
  if (truth && matchPattern(otherwise, m_Zero()))
    return any(branch.getCondition(), true) || any(then, true);
  if (!truth && matchPattern(then, m_One()))
    return any(branch.getCondition(), false) || any(otherwise, false);
  return false;
}

/// Whether a comparison says that `value`, which is not negative, is at least
/// `bound`.
static bool saysAtLeast(arith::CmpIOp compare, bool truth, mlir::Value value,
                        const APInt &bound) {
  using Predicate = arith::CmpIPredicate;
  Predicate predicate = compare.getPredicate();
  mlir::Value left = compare.getLhs(), right = compare.getRhs();
  APInt number;
  if (right == value) {
    std::swap(left, right);
    switch (predicate) {
    case Predicate::slt: predicate = Predicate::sgt; break;
    case Predicate::sle: predicate = Predicate::sge; break;
    case Predicate::sgt: predicate = Predicate::slt; break;
    case Predicate::sge: predicate = Predicate::sle; break;
    default: break;
    }
  }
  if (left != value || !matchPattern(right, m_ConstantInt(&number)))
    return false;
  if (!truth)
    predicate = arith::invertPredicate(predicate);
  if (predicate == Predicate::sge)
    return number.sge(bound);
  return (predicate == Predicate::sgt ||
          (predicate == Predicate::ne && number.isZero())) &&
         (number + 1).sge(bound);
}

/// Whether the branches around `where` let only values of at least `bound`
/// pass.
static bool isGuarded(mlir::Value value, const APInt &bound, Block *where) {
  for (; where; where = where->getParentOp()->getBlock()) {
    auto branch = dyn_cast<scf::IfOp>(where->getParentOp());
    if (branch &&
        impliesAny(branch.getCondition(), where == branch.thenBlock(),
                   /*depth=*/16, [&](arith::CmpIOp compare, bool truth) {
                     return saysAtLeast(compare, truth, value, bound);
                   }))
      return true;
    if (!isa<RegionBranchOpInterface>(where->getParentOp()))
      return false;
  }
  return false;
}

static bool isNonNegative(mlir::Value value, Block *where, bool mayOverflow,
                          int depth) {
  APInt number;
  if (matchPattern(value, m_ConstantInt(&number)))
    return !number.isNegative();
  if (depth == 0)
    return false;
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *parent = argument.getOwner()->getParentOp();
    if (auto function = dyn_cast<FunctionOpInterface>(parent))
      return bool(function.getArgAttr(argument.getArgNumber(),
                                      warp::attr::nonNegative));
    auto loop = dyn_cast<scf::ForOp>(parent);
    if (isThreadIndex(value))
      return true;
    // Beyond 2^31 trips an index is out of bounds, like a sum that overflows.
    return loop && loop.getInductionVar() == value &&
           (mayOverflow || !loop.getUnsignedCmp()) &&
           isNonNegative(loop.getLowerBound(), where, false, depth - 1);
  }
  Operation *op = value.getDefiningOp();
  if (!op)
    return false;
  if (isa<arith::ExtUIOp, warp::DimOp>(op) || isThreadIndex(value) ||
      op->hasAttr(warp::attr::nonNegative))
    return true;
  auto operand = [&](unsigned i, bool mayOverflow = false) {
    return isNonNegative(op->getOperand(i), where, mayOverflow, depth - 1);
  };
  if (isa<arith::ExtSIOp, arith::IndexCastOp>(op))
    return operand(0, mayOverflow);
  if (isa<arith::AddIOp>(op) && isThreadIndex(op->getOperand(0)) &&
      matchPattern(op->getOperand(1), m_One()))
    return true;
  if (isa<arith::SubIOp>(op) &&
      matchPattern(op->getOperand(1), m_ConstantInt(&number)))
    return number.isStrictlyPositive() && operand(0) &&
           isGuarded(op->getOperand(0), number, where);
  if (isa<arith::AddIOp, arith::MulIOp>(op))
    return mayOverflow && operand(0, true) && operand(1, true);
  if (isa<arith::DivSIOp, arith::MinSIOp, arith::OrIOp, arith::XOrIOp>(op))
    return operand(0) && operand(1);
  if (isa<arith::MaxSIOp, arith::AndIOp>(op))
    return operand(0) || operand(1);
  if (isa<arith::RemSIOp, arith::ShRSIOp>(op))
    return operand(0);
  if (isa<arith::SelectOp>(op))
    return operand(1) && operand(2);
  return false;
}

/// A sum or product counts as not negative if its operands are: where it
/// overflows, the access is out of bounds of every array. That holds for the
/// index itself, not for what a remainder (say, of a hash) is taken of.
bool warp::isNonNegative(mlir::Value value, Block *where) {
  return ::isNonNegative(value, where, /*mayOverflow=*/true, /*depth=*/8);
}
