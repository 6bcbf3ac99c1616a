//===- SpectralEntries.cpp - Products of vectors entry by entry -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A matrix whose entry (i, j) is sum_k x_k u_ik v_jk, over all columns of U and
// V, is U diag(x) V^T, and is written so. Such entries are what loops over i, j
// and k leave once they are unrolled. Factors stand in any order, so a term is
// the bag of its factors.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/SpectralMatch.h"

#include "WarpDialect/Registry.h"

#include "mlir/IR/Matchers.h"
#include "llvm/ADT/SetVector.h"

#include <algorithm>

using namespace mlir;
using namespace warp;
using namespace warp::autodiff;

/// A square matrix's entries by rows, if all of them are known.
static SmallVector<Value> getEntries(Value matrix) {
  auto type = cast<MatType>(matrix.getType());
  int64_t size = type.getRows();
  SmallVector<Value> entries(size * size);
  while (auto insert = matrix.getDefiningOp<InsertOp>()) {
    APInt row, column;
    if (insert.getIndices().size() != 2 ||
        !matchPattern(insert.getIndices()[0], m_ConstantInt(&row)) ||
        !matchPattern(insert.getIndices()[1], m_ConstantInt(&column)) ||
        row.uge(size) || column.uge(size))
      return {};
    // The last one to be written stays.
    Value &entry = entries[row.getZExtValue() * size + column.getZExtValue()];
    if (!entry)
      entry = insert.getValue();
    matrix = insert.getTarget();
  }
  auto whole = matrix.getDefiningOp<ConstructOp>();
  bool hasAll = whole && whole->getNumOperands() == entries.size();
  for (auto [i, entry] : llvm::enumerate(entries)) {
    if (!entry && hasAll)
      entry = whole->getOperand(i);
    if (!entry)
      return {};
  }
  return entries;
}

/// More than an entry of a product has. Operands may be shared, so a few
/// operations may stand for very many leaves.
static constexpr size_t mostLeaves = 64;

/// Adds what a tree of operations of one kind has at its leaves, from left to
/// right; false if it has too many.
template <typename Op>
static bool collect(Value value, SmallVectorImpl<Value> &leaves) {
  SmallVector<Value> open{value};
  while (!open.empty()) {
    if (open.size() + leaves.size() > mostLeaves)
      return false;
    Value next = open.pop_back_val();
    if (auto op = next.getDefiningOp<Op>())
      for (Value operand : llvm::reverse(op->getOperands()))
        open.push_back(operand);
    else
      leaves.push_back(next);
  }
  return true;
}

namespace {
/// Left and right vectors, and for each column the factors of its terms.
struct Bags {
  OpResult left, right;
  SmallVector<SmallVector<Value>, 3> factors;
};
} // namespace

/// Takes the factor that is some entry of vectors out of a bag.
static bool take(SmallVectorImpl<Value> &bag, OpResult vectors, int64_t row,
                 int64_t column) {
  for (auto it = bag.begin(); it != bag.end(); ++it)
    if (auto entry = matchEntry(*it); entry && entry->vectors == vectors &&
                                      entry->row == row &&
                                      entry->column == column) {
      bag.erase(it);
      return true;
    }
  return false;
}

/// The factors of each column's term in entry (row, column); none if it is not
/// a sum over all columns.
static std::optional<Bags> matchSum(Value entry, OpResult left, OpResult right,
                                    int64_t row, int64_t column) {
  int64_t size = cast<MatType>(left.getType()).getRows();
  Bags bags{left, right, {}};
  bags.factors.resize(size);
  llvm::SmallDenseSet<int64_t> seen;
  SmallVector<Value> terms;
  if (!collect<AddOp>(entry, terms))
    return std::nullopt;
  for (Value term : terms) {
    if (matchPattern(term, m_AnyZeroFloat()))
      continue;
    SmallVector<Value> bag;
    if (!collect<MulOp>(term, bag))
      return std::nullopt;
    int64_t number = 0;
    while (number < size &&
           (seen.contains(number) || !take(bag, left, row, number)))
      ++number;
    if (number == size || !take(bag, right, column, number))
      return std::nullopt;
    seen.insert(number);
    bags.factors[number] = std::move(bag);
  }
  return static_cast<int64_t>(seen.size()) == size ? std::optional(bags)
                                                   : std::nullopt;
}

static bool haveSameFactors(const Bags &a, const Bags &b) {
  return llvm::all_of(llvm::zip(a.factors, b.factors), [](auto pair) {
    auto &[one, other] = pair;
    return one.size() == other.size() &&
           std::is_permutation(one.begin(), one.end(), other.begin());
  });
}

/// True if all entries are those of one product of these vectors.
static std::optional<Bags> matchAll(ArrayRef<Value> entries, OpResult left,
                                    OpResult right) {
  int64_t size = cast<MatType>(left.getType()).getRows();
  std::optional<Bags> first;
  for (auto [i, entry] : llvm::enumerate(entries)) {
    int64_t at = i;
    auto bags = matchSum(entry, left, right, at / size, at % size);
    if (!bags || (first && !haveSameFactors(*first, *bags)))
      return std::nullopt;
    if (!first)
      first = std::move(bags);
  }
  return first;
}

/// Decompositions that an entry has factors of.
static llvm::SmallSetVector<Operation *, 2> findDecompositions(Value entry) {
  llvm::SmallSetVector<Operation *, 2> found;
  SmallVector<Value> terms, factors;
  if (!collect<AddOp>(entry, terms) ||
      !llvm::all_of(terms,
                    [&](Value term) { return collect<MulOp>(term, factors); }))
    return found;
  for (Value factor : factors)
    if (auto vectors = matchEntry(factor))
      found.insert(vectors->vectors.getOwner());
  return found;
}

static std::optional<Bags> matchMatrix(Value matrix) {
  SmallVector<Value> entries = getEntries(matrix);
  if (entries.empty())
    return std::nullopt;
  for (Operation *decomposition : findDecompositions(entries.front()))
    for (OpResult left : decomposition->getResults())
      for (OpResult right : decomposition->getResults())
        if (left.getType() == matrix.getType() &&
            right.getType() == matrix.getType())
          if (auto bags = matchAll(entries, left, right))
            return bags;
  return std::nullopt;
}

void autodiff::writeEntriesAsProducts(Operation *function) {
  SmallVector<Value> matrices;
  function->walk([&](Operation *op) {
    if (!isa<InsertOp, ConstructOp>(op))
      return;
    auto type = dyn_cast<MatType>(op->getResult(0).getType());
    bool isPart = llvm::all_of(
        op->getUsers(), [](Operation *user) { return isa<InsertOp>(user); });
    if (type && type.getRows() == type.getCols() && type.getRows() <= 3 &&
        !isPart)
      matrices.push_back(op->getResult(0));
  });
  for (Value matrix : matrices) {
    std::optional<Bags> bags = matchMatrix(matrix);
    if (!bags)
      continue;
    OpBuilder b(matrix.getDefiningOp());
    Location loc = matrix.getLoc();
    SmallVector<Value> numbers;
    for (ArrayRef<Value> factors : bags->factors) {
      Value number;
      for (Value factor : factors)
        number =
            number
                ? createBuiltin(b, loc, "mul", {number, factor})->getResult(0)
                : factor;
      if (!number)
        number = ConstantOp::create(
            b, loc, b.getFloatAttr(getElementScalar(matrix.getType()), 1.0));
      numbers.push_back(number);
    }
    matrix.replaceAllUsesWith(
        makeProduct(b, loc, bags->left, bags->right, numbers));
  }
}
