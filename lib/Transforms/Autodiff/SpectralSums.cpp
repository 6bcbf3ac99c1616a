//===- SpectralSums.cpp - Sums of outer products of singular vectors ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// sum_i x_i outer(u_i, v_i) over all columns of U and V is U diag(x) V^T, and
// is written so. Factors may stand at the outer product or at one of its
// vectors. Other terms stay a sum. A column is a row of the transpose,
// or its entries one by one.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/SpectralMatch.h"

#include "WarpDialect/Registry.h"

#include "mlir/IR/Matchers.h"
#include "llvm/ADT/MapVector.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;
using namespace warp;
using namespace warp::autodiff;

namespace {

struct Column {
  OpResult vectors;
  int64_t number = 0;
};

/// One term: factors times the outer product of two columns.
struct Term {
  SmallVector<Value> factors;
  Column left, right;
};

} // namespace

static std::optional<Column> matchColumn(Value vector) {
  if (auto row = vector.getDefiningOp<ExtractOp>()) {
    OpResult vectors = getTransposedVectors(row.getSource());
    if (!vectors || row.getIndices().size() != 1)
      return std::nullopt;
    APInt number;
    if (!matchPattern(row.getIndices()[0], m_ConstantInt(&number)))
      return std::nullopt;
    return Column{vectors, number.getSExtValue()};
  }
  auto entries = vector.getDefiningOp<ConstructOp>();
  if (!entries || entries->getNumOperands() == 0)
    return std::nullopt;
  std::optional<Column> column;
  for (auto [row, operand] : llvm::enumerate(entries->getOperands())) {
    auto entry = matchEntry(operand);
    if (!entry || entry->row != static_cast<int64_t>(row))
      return std::nullopt;
    if (column &&
        (column->vectors != entry->vectors || column->number != entry->column))
      return std::nullopt;
    column = Column{entry->vectors, entry->column};
  }
  bool isWhole = static_cast<int64_t>(entries->getNumOperands()) ==
                 cast<MatType>(column->vectors.getType()).getRows();
  return isWhole ? column : std::nullopt;
}

/// Takes scalar factors off a vector or matrix.
static Value takeFactors(Value value, SmallVectorImpl<Value> &factors) {
  while (auto product = value.getDefiningOp<MulOp>()) {
    Value first = product->getOperand(0), second = product->getOperand(1);
    if (!isScalar(first.getType()) && !isScalar(second.getType()))
      break;
    bool isFirst = isScalar(first.getType());
    factors.push_back(isFirst ? first : second);
    value = isFirst ? second : first;
  }
  return value;
}

static std::optional<Term> matchTerm(Value value) {
  Term term;
  auto outer = takeFactors(value, term.factors).getDefiningOp<OuterOp>();
  if (!outer)
    return std::nullopt;
  auto left = matchColumn(takeFactors(outer->getOperand(0), term.factors));
  auto right = matchColumn(takeFactors(outer->getOperand(1), term.factors));
  if (!left || !right || left->number != right->number ||
      left->vectors.getOwner() != right->vectors.getOwner())
    return std::nullopt;
  term.left = *left;
  term.right = *right;
  return term;
}

/// The terms of a sum, whose parts nothing else uses.
static void collectTerms(Value value, bool isTop, SmallVectorImpl<Value> &terms,
                         llvm::DenseSet<Operation *> &inner) {
  auto sum = value.getDefiningOp<AddOp>();
  if (!sum || (!isTop && !value.hasOneUse())) {
    auto whole = value.getDefiningOp<ConstructOp>();
    if (!whole || whole->getNumOperands() != 0)
      terms.push_back(value);
    return;
  }
  inner.insert(sum);
  for (Value operand : sum->getOperands())
    collectTerms(operand, false, terms, inner);
}

/// Writes a sum with a product for each decomposition that has all columns.
static void rewrite(AddOp sum, ArrayRef<Value> values) {
  using Key = std::pair<Value, Value>;
  llvm::MapVector<Key, SmallVector<Term>> groups;
  SmallVector<std::pair<Value, Key>> parts;
  for (Value value : values) {
    auto term = matchTerm(value);
    Key key = term ? Key(term->left.vectors, term->right.vectors) : Key();
    parts.emplace_back(value, key);
    if (term)
      groups[key].push_back(*term);
  }
  OpBuilder b(sum);
  Location loc = sum.getLoc();
  auto call = [&](StringRef name, ValueRange operands) {
    return createBuiltin(b, loc, name, operands)->getResult(0);
  };
  SmallVector<Value> terms;
  llvm::DenseSet<Value> replaced;
  for (auto &[key, group] : groups) {
    auto type = cast<MatType>(key.first.getType());
    SmallVector<Value, 3> numbers(type.getRows());
    for (const Term &term : group) {
      Value number;
      for (Value factor : term.factors)
        number = number ? call("mul", {number, factor}) : factor;
      if (!number)
        number = ConstantOp::create(
            b, loc, b.getFloatAttr(getElementScalar(type), 1.0));
      Value &entry = numbers[term.left.number];
      entry = entry ? call("add", {entry, number}) : number;
    }
    if (llvm::is_contained(numbers, Value()))
      continue;
    terms.push_back(makeProduct(b, loc, cast<OpResult>(key.first),
                                cast<OpResult>(key.second), numbers));
    for (auto &[value, other] : parts)
      if (other == key)
        replaced.insert(value);
  }
  if (terms.empty())
    return;
  for (auto &[value, key] : parts)
    if (!replaced.contains(value))
      terms.push_back(value);
  Value total = terms.front();
  for (Value term : ArrayRef(terms).drop_front())
    total = call("add", {total, term});
  sum->getResult(0).replaceAllUsesWith(total);
  sum->erase();
}

void autodiff::writeSumsAsProducts(Operation *function) {
  SmallVector<AddOp> sums;
  function->walk([&](AddOp sum) {
    if (isa<MatType>(sum->getResult(0).getType()))
      sums.push_back(sum);
  });
  llvm::DenseSet<Operation *> inner;
  for (AddOp sum : llvm::reverse(sums)) {
    if (inner.contains(sum))
      continue;
    SmallVector<Value> terms;
    collectTerms(sum->getResult(0), true, terms, inner);
    rewrite(sum, terms);
  }
}
