//===- Inverse.cpp - Lowerings of determinants and inverses ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Both rest on 2x2 minors, each a difference of products without cancellation
// error. An inverse is taken of the matrix scaled by a power of two, so that
// its determinant neither overflows nor vanishes unless the matrix is singular.
//
//===----------------------------------------------------------------------===//

#include "Decompositions.h"
#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

/// Sum of three products.
static Scalar expand(Scalar a0, Scalar b0, Scalar a1, Scalar b1, Scalar a2,
                     Scalar b2) {
  return fma(a0, b0, fma(a1, b1, a2 * b2));
}

//===----------------------------------------------------------------------===//
// Minors
//===----------------------------------------------------------------------===//

/// Determinant and adjugate.
struct Adjugate {
  Scalar determinant;
  Scalars entries;
};

static Scalar determinant2(ArrayRef<Scalar> m) {
  return differenceOfProducts(m[0], m[3], m[1], m[2]);
}

static Adjugate adjugate2(ArrayRef<Scalar> m) {
  return {determinant2(m), {m[3], -m[1], -m[2], m[0]}};
}

/// Signed minor of the entry in row i, column j: rows and columns taken in
/// cyclic order give the sign.
static Scalar cofactor3(ArrayRef<Scalar> m, int i, int j) {
  auto at = [&](int row, int col) { return m[(row % 3) * 3 + col % 3]; };
  return differenceOfProducts(at(i + 1, j + 1), at(i + 2, j + 2),
                              at(i + 1, j + 2), at(i + 2, j + 1));
}

static Scalar determinant3(ArrayRef<Scalar> m) {
  return expand(m[0], cofactor3(m, 0, 0), m[1], cofactor3(m, 0, 1), m[2],
                cofactor3(m, 0, 2));
}

static Adjugate adjugate3(ArrayRef<Scalar> m) {
  Scalars entries;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      entries.push_back(cofactor3(m, j, i));
  return {expand(m[0], entries[0], m[1], entries[3], m[2], entries[6]),
          entries};
}

/// The six 2x2 minors of two rows of a 4x4 matrix, for the column pairs
/// 01, 02, 03, 12, 13, 23.
static Scalars minorsOfRows(ArrayRef<Scalar> m, int first) {
  ArrayRef<Scalar> a = m.slice(first * 4, 4), b = m.slice(first * 4 + 4, 4);
  Scalars minors;
  for (int i = 0; i < 4; ++i)
    for (int j = i + 1; j < 4; ++j)
      minors.push_back(differenceOfProducts(a[i], b[j], a[j], b[i]));
  return minors;
}

/// Laplace expansion by the upper and the lower two rows.
static Scalar determinant4(ArrayRef<Scalar> s, ArrayRef<Scalar> c) {
  return differenceOfProducts(s[0], c[5], s[1], c[4]) +
         differenceOfProducts(s[2], c[3], -s[3], c[2]) +
         differenceOfProducts(s[5], c[0], s[4], c[1]);
}

static Adjugate adjugate4(ArrayRef<Scalar> m) {
  Scalars s = minorsOfRows(m, 0), c = minorsOfRows(m, 2);
  // Row `row` of the matrix without column `col`, against three minors of the
  // other half.
  auto entry = [&](int row, ArrayRef<Scalar> minors, int col, double sign) {
    static constexpr int pairs[4][3] = {
        {5, 4, 3}, {5, 2, 1}, {4, 2, 0}, {3, 1, 0}};
    SmallVector<Scalar, 3> x;
    for (int j = 0; j < 4; ++j)
      if (j != col)
        x.push_back(sign < 0 ? -m[row * 4 + j] : m[row * 4 + j]);
    return expand(x[0], minors[pairs[col][0]], -x[1], minors[pairs[col][1]],
                  x[2], minors[pairs[col][2]]);
  };
  Scalars entries;
  for (int i = 0; i < 4; ++i) {
    double sign = i % 2 ? -1 : 1;
    entries.push_back(entry(1, c, i, sign));
    entries.push_back(entry(0, c, i, -sign));
    entries.push_back(entry(3, s, i, sign));
    entries.push_back(entry(2, s, i, -sign));
  }
  return {determinant4(s, c), entries};
}

//===----------------------------------------------------------------------===//
// Lowerings
//===----------------------------------------------------------------------===//

Scalars lowerDeterminant(Emitter &, Operands args) {
  ArrayRef<Scalar> m = args[0].scalars;
  if (m.size() == 4)
    return {determinant2(m)};
  if (m.size() == 9)
    return {determinant3(m)};
  return {determinant4(minorsOfRows(m, 0), minorsOfRows(m, 2))};
}

Scalars lowerInverse(Emitter &, Operands args) {
  Scaled scaled = scaleToUnit(args[0].scalars);
  ArrayRef<Scalar> m = scaled.scalars;
  Adjugate adjugate = m.size() == 4   ? adjugate2(m)
                      : m.size() == 9 ? adjugate3(m)
                                      : adjugate4(m);
  Scalar isSingular = adjugate.determinant == 0;
  Scalar factor = 1.0 / adjugate.determinant;
  return forEach(adjugate.entries, [&](Scalar x) {
    return select(isSingular, x.like(0), x * factor * scaled.scale);
  });
}

Scalars lowerInverseApprox(Emitter &emitter, Operands args) {
  return lowerInverse(emitter, args);
}

} // namespace warp::lowering
