//===- Decompositions.h - Parts of the decompositions -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Vectors here are their components; a matrix is given by its columns. Every
// algorithm works on a matrix scaled by a power of two, which costs no digits,
// and takes the same steps for every matrix: where a formula breaks down, both
// outcomes are computed and one is selected.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERINGS_DECOMPOSITIONS_H
#define WARP_TRANSFORMS_LOWERINGS_DECOMPOSITIONS_H

#include "Lowerings.h"

#include <array>

namespace warp::lowering {

/// Columns of a 3x3 matrix.
using Columns = std::array<Scalars, 3>;

Columns getColumns(llvm::ArrayRef<Scalar> rowMajor);
Scalars getRowMajor(const Columns &columns);
/// U diag(d) V^T; exactly symmetric where U is V.
Scalars multiplyDiagonal(const Columns &u, llvm::ArrayRef<Scalar> d,
                         const Columns &v);

/// Numbers times a power of two that brings the largest near 1, and the factor
/// back. Zeros stay as they are.
struct Scaled {
  Scalars scalars;
  Scalar scale, unscale;
};
Scaled scaleToUnit(llvm::ArrayRef<Scalar> numbers);

/// A vector scaled to length 1; the first axis for the zero vector.
Scalars getUnit(llvm::ArrayRef<Scalar> v);

/// Right-handed orthonormal basis: the first vector is a direction of `a`, the
/// second lies in the plane of `a` and `b`. Undetermined vectors are chosen.
Columns getBasis(llvm::ArrayRef<Scalar> a, llvm::ArrayRef<Scalar> b);

/// The rotation that makes a symmetric 2x2 matrix diagonal, by at most 45
/// degrees (Rutishauser, Numer. Math. 9, 1966).
struct JacobiRotation {
  Scalar tangent, sine, halfTangent;

  /// From the diagonal entries and the other one.
  JacobiRotation(Scalar p, Scalar q, Scalar other);
  /// Turns a pair of numbers; the closer the angle is to 0, the less rounding.
  void apply(Scalar &p, Scalar &q) const;
  void apply(Scalars &p, Scalars &q) const;
};

/// Exchanges two columns of a rotation, and what belongs to them, where
/// `condition` holds. One column changes sign, so that a rotation remains.
void exchange(Scalar condition, Scalars &p, Scalars &q);

/// A symmetric matrix as Q diag(d) Q^T, d decreasing and Q a rotation.
struct Eigen3 {
  Columns vectors;
  Scalars values;
};
/// For the symmetric part of a row-major matrix.
Eigen3 getEigen3(llvm::ArrayRef<Scalar> matrix);

/// U diag(sigma) V^T, U and V rotations, sigma decreasing in magnitude; only
/// the last one may be negative.
struct Svd3 {
  Columns u;
  Scalars sigma;
  Columns v;
};
Svd3 getSvd3(llvm::ArrayRef<Scalar> matrix);

} // namespace warp::lowering

#endif // WARP_TRANSFORMS_LOWERINGS_DECOMPOSITIONS_H
