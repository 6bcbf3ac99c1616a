//===- SpectralMatch.cpp - Pattern match of U diag(f(s)) V^T --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/SpectralMatch.h"

#include "WarpDialect/Registry.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;
using namespace warp;
using namespace warp::autodiff;

static bool isZero(Value value) {
  auto constant = value.getDefiningOp<ConstantOp>();
  auto number = constant ? dyn_cast<FloatAttr>(constant.getValue()) : nullptr;
  return number && number.getValue().isZero();
}

static std::optional<int64_t> getIndex(Value value) {
  APInt number;
  if (!matchPattern(value, m_ConstantInt(&number)))
    return std::nullopt;
  return number.getSExtValue();
}

std::optional<VectorEntry> autodiff::matchEntry(Value value) {
  auto extract = value.getDefiningOp<ExtractOp>();
  if (!extract || extract.getIndices().size() != 2)
    return std::nullopt;
  OpResult vectors = getVectors(extract.getSource());
  auto row = getIndex(extract.getIndices()[0]);
  auto column = getIndex(extract.getIndices()[1]);
  if (!vectors || !row || !column)
    return std::nullopt;
  return VectorEntry{vectors, *row, *column};
}

/// The vectors all of whose entries, in their order, make a matrix, or null.
static OpResult getWhole(ConstructOp matrix) {
  auto type = dyn_cast<MatType>(matrix.getType());
  if (!type || matrix->getNumOperands() != type.getRows() * type.getCols())
    return {};
  OpResult whole;
  for (auto [i, operand] : llvm::enumerate(matrix->getOperands())) {
    auto entry = matchEntry(operand);
    int64_t at = i, columns = type.getCols();
    if (!entry || entry->row != at / columns || entry->column != at % columns ||
        (whole && entry->vectors != whole))
      return {};
    whole = entry->vectors;
  }
  return whole.getType() == type ? whole : OpResult();
}

OpResult autodiff::getVectors(Value value) {
  if (auto matrix = value.getDefiningOp<ConstructOp>())
    return getWhole(matrix);
  auto result = dyn_cast<OpResult>(value);
  if (!result || !isa<Svd3Op, Svd2Op, Eig3Op>(result.getOwner()) ||
      result.getOwner()->getNumResults() < 2 || result.getResultNumber() == 1)
    return {};
  Type scalar = getElementScalar(value.getType());
  return scalar.isF32() || scalar.isF64() ? result : OpResult();
}

OpResult autodiff::getTransposedVectors(Value value) {
  auto transpose = value.getDefiningOp<TransposeOp>();
  return transpose ? getVectors(transpose->getOperand(0)) : OpResult();
}

/// The numbers of a diagonal matrix of this size, or none.
static SmallVector<Value, 3> getDiagonal(Value matrix, int size) {
  SmallVector<Value, 3> numbers;
  if (auto diag = matrix.getDefiningOp<DiagOp>()) {
    Value vector = diag->getOperand(0);
    OpBuilder b(diag);
    for (int i = 0; i < size; ++i) {
      Value index = ConstantOp::create(
          b, diag.getLoc(), IntegerAttr::get(b.getIntegerType(32, true), i));
      numbers.push_back(ExtractOp::create(b, diag.getLoc(),
                                          getElementScalar(vector.getType()),
                                          vector, ValueRange(index)));
    }
    return numbers;
  }
  auto entries = matrix.getDefiningOp<ConstructOp>();
  if (!entries || static_cast<int>(entries->getNumOperands()) != size * size)
    return {};
  for (auto [i, entry] : llvm::enumerate(entries->getOperands()))
    if (int at = static_cast<int>(i); at % (size + 1) == 0)
      numbers.push_back(entry);
    else if (!isZero(entry))
      return {};
  return numbers;
}

Value autodiff::makeProduct(OpBuilder &b, Location loc, OpResult left,
                            OpResult right, ValueRange numbers) {
  auto call = [&](StringRef name, ValueRange operands) {
    return createBuiltin(b, loc, name, operands)->getResult(0);
  };
  Type type = left.getOwner()->getResult(1).getType();
  Value diagonal = ConstructOp::create(b, loc, type, numbers).getResult();
  Value scaled = call("mul", {left, call("diag", {diagonal})});
  return call("mul", {scaled, call("transpose", {right})});
}

std::optional<SpectralProduct> autodiff::matchProduct(MulOp op) {
  Value first = op->getOperand(0), second = op->getOperand(1), diagonal;
  OpResult left = getVectors(first), right = getTransposedVectors(second);
  if (auto inner = first.getDefiningOp<MulOp>(); inner && right) {
    left = getVectors(inner->getOperand(0));
    diagonal = inner->getOperand(1);
  } else if (inner = second.getDefiningOp<MulOp>(); inner && left) {
    diagonal = inner->getOperand(0);
    right = getTransposedVectors(inner->getOperand(1));
  }
  if (!left || !right || !diagonal || left.getOwner() != right.getOwner())
    return std::nullopt;
  auto numbers = getDiagonal(diagonal, cast<MatType>(left.getType()).getRows());
  if (numbers.empty())
    return std::nullopt;
  return SpectralProduct{op, left.getOwner(), left, right, numbers};
}

//===----------------------------------------------------------------------===//
// Branches between values and the diagonal
//===----------------------------------------------------------------------===//

/// True if both sides may be computed, and results be chosen one by one.
static bool mayOpen(scf::IfOp branch) {
  if (branch.getNumResults() == 0 ||
      !llvm::all_of(branch.getResultTypes(), [](Type type) {
        return isScalar(type) || isComposite(type);
      }))
    return false;
  auto result = branch->walk([&](Operation *op) {
    bool isPlain = op == branch || isa<scf::YieldOp>(op) ||
                   (op->getNumRegions() == 0 && isMemoryEffectFree(op));
    return isPlain ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted();
}

/// Computes both sides before the branch, and chooses.
static void open(scf::IfOp branch) {
  OpBuilder b(branch);
  SmallVector<Operation *, 2> ends = {branch.thenYield(), branch.elseYield()};
  for (Operation *end : ends)
    for (Operation &op :
         llvm::make_early_inc_range(end->getBlock()->without_terminator()))
      op.moveBefore(branch);
  for (auto [result, yes, no] : llvm::zip_equal(
           branch.getResults(), ends[0]->getOperands(), ends[1]->getOperands()))
    result.replaceAllUsesWith(createBuiltin(b, branch.getLoc(), "where",
                                            {branch.getCondition(), yes, no})
                                  ->getResult(0));
  branch.erase();
}

void autodiff::openBranches(const SpectralProduct &product) {
  SmallVector<Value> pending(product.diagonal.begin(), product.diagonal.end());
  llvm::DenseSet<Operation *> seen;
  llvm::SetVector<Operation *> branches;
  while (!pending.empty()) {
    Operation *op = pending.pop_back_val().getDefiningOp();
    if (!op || op == product.decomposition || !seen.insert(op).second)
      continue;
    if (isa<scf::IfOp>(op)) {
      op->walk([&](scf::IfOp inner) { branches.insert(inner); });
      op->walk([&](Operation *inner) {
        llvm::append_range(pending, inner->getOperands());
      });
    }
    llvm::append_range(pending, op->getOperands());
  }
  // Inner ones come first.
  for (Operation *op : branches)
    if (auto branch = cast<scf::IfOp>(op);
        !branch->isAncestor(product.decomposition) && mayOpen(branch))
      open(branch);
}
