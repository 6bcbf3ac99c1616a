//===- SpectralProducts.cpp - U diag(f(s)) V^T of a decomposition ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If values s repeat, the derivative of U diag(x) V^T with x = f(s) holds
// the divided difference (x_j - x_i) / (s_j - s_i), whose limit is a derivative
// of f. No cotangent of U, s and V shows it: those of U and V have x_j - x_i,
// which is zero, and that of s has the derivative of f times entries of the
// diagonal alone. So a product is written again where values repeat, or nearly
// do, as functions that are smooth there: with the rotation R = U V^T and the
// symmetric S = R^T A = V diag(s) V^T,
//
//   U diag(x) V^T = R H,   V diag(x) V^T = H,   U diag(x) U^T = R H R^T,
//
// where H is that function of S. `sym_spectral3` is given the divided
// differences; of two rows, H = mean(x) I + slope (S - mean(s) I). Eigenvectors
// have S = A and H itself. S is taken in the basis at hand, as a constant,
// where it is diagonal: cotangents of values that repeat are of one basis
// alone.
//
// A divided difference of values that nearly repeat is the mean of the
// derivatives at both, which is as good as the difference is small to the
// second power; taking quotients is as bad as roundoff over the difference.
// Derivatives come from forward mode through what lies between s and x.
//
// The decomposition has a copy for these products, so that a report of values
// that are told apart is about its other uses. Once the derivative is made,
// both become one.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/SpectralProducts.h"
#include "Autodiff/Rules/MatrixFormula.h"
#include "Autodiff/SpectralMatch.h"
#include "Autodiff/TangentSlice.h"
#include "RareBranch.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using namespace warp;
using namespace warp::autodiff;

//===----------------------------------------------------------------------===//
// Writing them again
//===----------------------------------------------------------------------===//

namespace {

class Completion {
public:
  Completion(SpectralProduct &product, TangentSlice &slice)
      : product(product), slice(slice), builder(product.op),
        context{builder, product.op.getLoc()},
        f(context, product.decomposition->getOperands(), {}),
        scalar(getElementScalar(product.op->getResult(0).getType())),
        size(cast<MatType>(product.op->getResult(0).getType()).getRows()) {}

  LogicalResult run();

private:
  void copyDecomposition();
  Expr extract(Value vector, int i);
  Value construct(Type type, ArrayRef<Expr> numbers);
  Expr areNearlyTheSame(int i, int j, bool forSlopes);
  Expr slope(int i, int j);
  Expr functionOf(Expr symmetric);
  Expr functionOf(Expr symmetric, Expr vectors);
  Expr again();

  SpectralProduct &product;
  TangentSlice &slice;
  OpBuilder builder;
  RuleContext context;
  Formula f;
  Type scalar;
  int size;
  bool isRefused = false;
};

} // namespace

void Completion::copyDecomposition() {
  OpBuilder b(product.decomposition);
  b.setInsertionPointAfter(product.decomposition);
  IRMapping copies;
  Operation *copy = b.clone(*product.decomposition, copies);
  copy->setAttr(completeAttrName, b.getUnitAttr());
  TangentSlice copied(copy, copy->getResult(1));
  for (Operation *op : slice.ops) {
    b.setInsertionPointAfter(op);
    copied.ops.insert(b.clone(*op, copies));
  }
  slice = copied;
  product.decomposition = copy;
  product.left = copy->getResult(product.left.getResultNumber());
  product.right = copy->getResult(product.right.getResultNumber());
  for (Value &number : product.diagonal)
    number = copies.lookupOrDefault(number);
}

Expr Completion::extract(Value vector, int i) {
  Value index =
      ConstantOp::create(builder, context.loc,
                         IntegerAttr::get(builder.getIntegerType(32, true), i));
  return f.wrap(ExtractOp::create(builder, context.loc, scalar, vector,
                                  ValueRange(index)));
}

Value Completion::construct(Type type, ArrayRef<Expr> numbers) {
  SmallVector<Value> parts = llvm::map_to_vector(
      numbers, [&](Expr x) { return f.materialize(x, scalar); });
  return ConstructOp::create(builder, context.loc, type, parts);
}

/// By the measure of the rules. Values that are equal for their size alone are
/// left out if `forSlopes`: functions may tell such values apart.
Expr Completion::areNearlyTheSame(int i, int j, bool forSlopes) {
  Value values = product.values();
  auto size = [&](int k) { return f.call("abs", {extract(values, k)}); };
  Expr largest =
      forSlopes ? f.number(0) : f.call("max", {size(0), size(this->size - 1)});
  return autodiff::areNearlyTheSame(f, extract(values, i), extract(values, j),
                                    largest,
                                    scalar.isF64() ? 0x1p-53 : 0x1p-24);
}

/// The divided difference of the diagonal between two values.
Expr Completion::slope(int i, int j) {
  SmallVector<Expr, 3> along(size, f.number(0));
  along[i] = f.number(0.5);
  along[j] = f.number(-0.5);
  Value values = product.values();
  SmallVector<Value> tangents = slice.getTangents(
      context, product.diagonal, construct(values.getType(), along), isRefused);
  if (isRefused)
    return f.number(0);
  auto tangent = [&](int k) {
    return tangents[k] ? f.wrap(tangents[k]) : f.number(0);
  };
  Expr limit = tangent(i) - tangent(j);
  Expr isClose = areNearlyTheSame(i, j, true);
  Expr gap = extract(values, i) - extract(values, j);
  Expr divisor = f.call("where", {isClose, f.number(1), gap});
  Expr quotient =
      (f.wrap(product.diagonal[i]) - f.wrap(product.diagonal[j])) / divisor;
  return f.call("where", {isClose, limit, quotient});
}

/// That function of a symmetric matrix that is diagonal: its values, in order.
Expr Completion::functionOf(Expr symmetric) {
  SmallVector<Expr, 3> diagonal = llvm::map_to_vector<3>(
      product.diagonal, [&](Value v) { return f.wrap(v); });
  Type vector = product.values().getType();
  if (size == 3) {
    SmallVector<Expr, 3> slopes = {slope(1, 2), slope(0, 2), slope(0, 1)};
    return f.call("sym_spectral3",
                  {symmetric, f.wrap(construct(vector, diagonal)),
                   f.wrap(construct(vector, slopes))});
  }
  Value values = product.values();
  Expr rise = slope(0, 1);
  Expr mean = f.number(0.5) * (extract(values, 0) + extract(values, 1));
  Expr level = f.number(0.5) * (diagonal[0] + diagonal[1]) - rise * mean;
  Expr numbers[] = {level, f.number(0), f.number(0), level};
  return rise * symmetric +
         f.wrap(construct(symmetric.value.getType(), numbers));
}

/// That function of any symmetric matrix whose eigenvectors are now those of
/// the decomposition: which they are matters to the cotangents of values that
/// repeat.
Expr Completion::functionOf(Expr symmetric, Expr vectors) {
  auto fix = [&](Expr x) { return f.call("stop_gradient", {x}); };
  Expr basis = fix(vectors), back = f.call("transpose", {basis});
  Expr inBasis = back * symmetric * basis;
  // It is diagonal but for rounding errors, which would turn the basis.
  Expr values = f.call("diag", {fix(f.wrap(product.values()))});
  return basis * functionOf(values + (inBasis - fix(inBasis))) * back;
}

Expr Completion::again() {
  Operation *decomposition = product.decomposition;
  Expr a = f.wrap(decomposition->getOperand(0));
  Expr u = f.wrap(decomposition->getResult(0));
  if (product.isOfEigenvectors())
    return functionOf(f.number(0.5) * (a + f.call("transpose", {a})), u);
  Expr v = f.wrap(decomposition->getResult(2));
  Expr rotation = u * f.call("transpose", {v});
  Expr back = f.call("transpose", {rotation});
  Expr result = functionOf(back * a, v);
  if (product.left.getResultNumber() == 0)
    result = rotation * result;
  if (product.right.getResultNumber() == 0)
    result = result * back;
  return result;
}

LogicalResult Completion::run() {
  copyDecomposition();
  Location loc = product.op.getLoc();
  Expr isClose = areNearlyTheSame(0, 1, false);
  if (size == 3)
    isClose = f.call("bit_or", {isClose, areNearlyTheSame(1, 2, false)});
  Type type = product.op->getResult(0).getType();
  auto branch = scf::IfOp::create(builder, loc, TypeRange(type), isClose.value,
                                  /*withElseRegion=*/true);
  branch->setAttr(attr::rare, builder.getUnitAttr());
  builder.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(builder, loc, again().value);
  builder.setInsertionPointToStart(branch.elseBlock());
  SmallVector<Expr, 3> diagonal = llvm::map_to_vector<3>(
      product.diagonal, [&](Value v) { return f.wrap(v); });
  Value vector = construct(product.values().getType(), diagonal);
  Expr plain = f.wrap(product.left) * f.call("diag", {f.wrap(vector)}) *
               f.call("transpose", {f.wrap(product.right)});
  scf::YieldOp::create(builder, loc, plain.value);
  product.op->getResult(0).replaceAllUsesWith(branch.getResult(0));
  product.op->erase();
  return failure(isRefused);
}

LogicalResult autodiff::completeSpectralProducts(func::FuncOp function) {
  writeSumsAsProducts(function);
  writeEntriesAsProducts(function);
  SmallVector<MulOp> candidates;
  function.walk([&](MulOp op) { candidates.push_back(op); });
  for (MulOp op : candidates) {
    std::optional<SpectralProduct> product = matchProduct(op);
    if (!product)
      continue;
    openBranches(*product);
    product = matchProduct(op);
    TangentSlice slice(product->decomposition, product->values());
    bool isSimple = llvm::all_of(product->diagonal, [&](Value number) {
      return succeeded(slice.add(number));
    });
    if (isSimple && failed(Completion(*product, slice).run()))
      return failure();
  }
  return success();
}
