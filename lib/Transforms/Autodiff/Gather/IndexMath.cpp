//===- IndexMath.cpp - Indices as sums of known values --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "IndexMath.h"

#include "Analysis/Effects.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

namespace warp::autodiff {

static Value skipCasts(Value value) {
  while (auto cast = value.getDefiningOp<CastOp>()) {
    if (!isa<IntegerType, IndexType>(cast.getSource().getType()))
      break;
    value = cast.getSource();
  }
  return value;
}

std::optional<int64_t> getConstantInteger(Value value) {
  IntegerAttr attr;
  if (!matchPattern(skipCasts(value), m_Constant(&attr)))
    return std::nullopt;
  return attr.getType().isUnsignedInteger() ? attr.getValue().getZExtValue()
                                            : attr.getValue().getSExtValue();
}

std::optional<unsigned> getThreadDimension(Value value) {
  if (value.getDefiningOp<TidOp>())
    return cast<OpResult>(value).getResultNumber();
  return std::nullopt;
}

/// Several `warp.tid` operations give the same indices.
static bool isSame(Value a, Value b) {
  return a == b || (getThreadDimension(a) &&
                    getThreadDimension(a) == getThreadDimension(b));
}

//===----------------------------------------------------------------------===//
// Sums
//===----------------------------------------------------------------------===//

void IndexSum::add(const IndexSum &other, int64_t factor) {
  constant += factor * other.constant;
  for (auto [value, coefficient] : other.terms) {
    auto *found = llvm::find_if(
        terms, [&, v = value](auto &term) { return isSame(term.first, v); });
    if (found == terms.end())
      found = terms.insert(terms.end(), {value, 0});
    found->second += factor * coefficient;
  }
  llvm::erase_if(terms, [](auto &term) { return term.second == 0; });
}

IndexSum IndexSum::of(Value value) {
  value = skipCasts(value);
  IndexSum sum;
  if (auto constant = getConstantInteger(value)) {
    sum.constant = *constant;
    return sum;
  }
  Operation *op = value.getDefiningOp();
  if (isa_and_nonnull<AddOp, SubOp>(op)) {
    sum = of(op->getOperand(0));
    sum.add(of(op->getOperand(1)), isa<AddOp>(op) ? 1 : -1);
    return sum;
  }
  if (isa_and_nonnull<NegOp>(op)) {
    sum.add(of(op->getOperand(0)), -1);
    return sum;
  }
  if (isa_and_nonnull<MulOp>(op))
    for (unsigned i : {0, 1})
      if (auto factor = getConstantInteger(op->getOperand(i))) {
        sum.add(of(op->getOperand(1 - i)), *factor);
        return sum;
      }
  sum.terms.emplace_back(value, 1);
  return sum;
}

IndexSum IndexSum::operator-(const IndexSum &other) const {
  IndexSum difference = *this;
  difference.add(other, -1);
  return difference;
}

int64_t IndexSum::coefficientOf(Value value) const {
  for (auto &term : terms)
    if (isSame(term.first, value))
      return term.second;
  return 0;
}

//===----------------------------------------------------------------------===//
// Uniform values
//===----------------------------------------------------------------------===//

bool isUniform(Value value, bool withCounters) {
  auto isOperandUniform = [&](Value v) { return isUniform(v, withCounters); };
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *owner = argument.getOwner()->getParentOp();
    if (isa<FunctionOpInterface>(owner))
      return true;
    auto loop = dyn_cast<scf::ForOp>(owner);
    return withCounters && loop && argument == loop.getInductionVar() &&
           isOperandUniform(loop.getLowerBound()) &&
           isOperandUniform(loop.getStep());
  }
  Operation *op = value.getDefiningOp();
  return op->getNumRegions() == 0 && (isPure(op) || isPlainRead(op)) &&
         !isa<TidOp>(op) && llvm::all_of(op->getOperands(), isOperandUniform);
}

} // namespace warp::autodiff
