//===- MatrixFormula.cpp - Formulas with entries of matrices --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "MatrixFormula.h"

#include "WarpDialect/WarpOps.h"

using namespace mlir;

namespace warp::autodiff {

MatrixFormula::MatrixFormula(RuleContext &context, const RuleInput &input)
    : context(context), input(input), f(context, input.operands, input.results),
      matrixType(input.operands[0].getType()),
      scalar(getElementScalar(matrixType)),
      size(cast<MatType>(matrixType).getRows()),
      roundoff(scalar.isF64() ? 0x1p-53 : 0x1p-24),
      matrix(f.wrap(input.operands[0])) {}

//===----------------------------------------------------------------------===//
// Components
//===----------------------------------------------------------------------===//

Expr MatrixFormula::extract(Expr composite,
                            std::initializer_list<int> indices) {
  if (composite.isNumber())
    return composite;
  OpBuilder &b = context.builder;
  SmallVector<Value, 2> values;
  for (int i : indices)
    values.push_back(ConstantOp::create(
        b, context.loc, IntegerAttr::get(b.getIntegerType(32, true), i)));
  return f.wrap(
      ExtractOp::create(b, context.loc, scalar, composite.value, values));
}

Expr MatrixFormula::make(Type type, ArrayRef<Expr> components) {
  SmallVector<Value> values;
  for (Expr x : components)
    values.push_back(f.materialize(x, scalar));
  return f.wrap(
      ConstructOp::create(context.builder, context.loc, type, values));
}

Expr MatrixFormula::makeVector(ArrayRef<Expr> components) {
  return make(VecType::get(scalar.getContext(), components.size(), scalar),
              components);
}

Expr MatrixFormula::makeMatrix(
    llvm::function_ref<Expr(int row, int col)> entry) {
  SmallVector<Expr, 9> entries;
  for (int row = 0; row < size; ++row)
    for (int col = 0; col < size; ++col)
      entries.push_back(entry(row, col));
  return make(matrixType, entries);
}

Expr MatrixFormula::determinantOf2(ArrayRef<Expr> entries) {
  Type type = MatType::get(scalar.getContext(), 2, 2, scalar);
  return f.call("determinant", {make(type, entries)});
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

Expr MatrixFormula::transpose(Expr m) {
  return m.isNumber() ? m : f.call("transpose", {m});
}

Expr MatrixFormula::getDiagonal(Expr m) {
  return m.isNumber() ? m : f.call("get_diag", {m});
}

Expr MatrixFormula::getSymmetricPart(Expr m) {
  return m.isNumber() ? m : 0.5 * (m + transpose(m));
}

Expr MatrixFormula::abs(Expr x) {
  return x.isNumber() ? f.number(std::abs(x.number)) : f.call("abs", {x});
}

std::pair<Expr, Expr> MatrixFormula::getEigen(Expr symmetric) {
  Operation *eigen = createBuiltin(context.builder, context.loc, "eig3",
                                   ValueRange(symmetric.value));
  return {f.wrap(eigen->getResult(0)), f.wrap(eigen->getResult(1))};
}

//===----------------------------------------------------------------------===//
// Singular points
//===----------------------------------------------------------------------===//

MatrixFormula::Quotient MatrixFormula::divide(Expr above, Expr terms,
                                              Expr below, Expr scale) {
  if (above.isNumber(0))
    return {above, f.number(0)};
  if (context.singular == Singular::Strict)
    return {above / below, f.number(0)};
  Expr isNoise = abs(above) <= 8 * roundoff * terms;
  Expr isClose = abs(below) <= 8 * roundoff * scale;
  // Noise is subtracted, so that the quotient keeps its derivative.
  Expr noise =
      f.call("where", {isNoise, f.call("stop_gradient", {above}), f.number(0)});
  Expr value = f.call("where", {isClose, f.number(0), (above - noise) / below});
  return {value, f.call("bit_and", {f.call("unot", {isNoise}), isClose})};
}

Expr areNearlyTheSame(Formula &f, Expr x, Expr y, Expr scale, double roundoff) {
  auto abs = [&](Expr z) { return f.call("abs", {z}); };
  Expr reach = f.number(std::cbrt(roundoff)) * f.call("max", {abs(x), abs(y)});
  if (!scale.isNumber(0))
    reach = f.call("max", {reach, f.number(8 * roundoff) * scale});
  return abs(x - y) <= reach;
}

void MatrixFormula::report(Expr isSingular) {
  if (isReported() && !isSingular.isNumber())
    context.report(isSingular.value);
}

//===----------------------------------------------------------------------===//
// Results of a rule
//===----------------------------------------------------------------------===//

SmallVector<Value> MatrixFormula::getAdjoints(Expr ofMatrix) {
  SmallVector<Value> adjoints(input.operands.size());
  if (input.wanted[0] && !ofMatrix.isNumber(0))
    adjoints[0] = f.materialize(ofMatrix, matrixType);
  return adjoints;
}

SmallVector<Value> MatrixFormula::getTangents(ArrayRef<Expr> ofResults) {
  SmallVector<Value> tangents;
  for (auto [x, result] : llvm::zip_equal(ofResults, input.results))
    tangents.push_back(
        x.isNumber(0) ? Value()
                      : f.materialize(x, differentialType(result.getType())));
  return tangents;
}

} // namespace warp::autodiff
