//===- Lowerings.h - Lowering rules of builtins -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A lowering is one function, `lower<Operation>`, from the components of the
// operands to the components of the results. It is called with 16-bit floats
// already widened to f32, and what it returns is rounded back, so no lowering
// deals with them. Where the record of a builtin says `ByFunction`, a function
// of that name must exist in one of the files of this folder.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERINGS_LOWERINGS_H
#define WARP_TRANSFORMS_LOWERINGS_LOWERINGS_H

#include "Scalar.h"

#include "WarpDialect/WarpTypes.h"

namespace warp::lowering {

/// One operand: its type and its components.
struct Parts {
  mlir::Type type;
  llvm::ArrayRef<Scalar> scalars;

  size_t size() const { return scalars.size(); }
  Scalar operator[](size_t i) const { return scalars[i]; }
  /// Component of a matrix.
  Scalar operator()(size_t row, size_t col) const {
    return scalars[row * llvm::cast<MatType>(type).getCols() + col];
  }
};

using Operands = llvm::ArrayRef<Parts>;
using LoweringFunction = Scalars (*)(Emitter &, Operands);

/// The lowering of an operation, or null if it is not a builtin.
LoweringFunction lookupLowering(llvm::StringRef opName);

/// Applies `function` to each component.
template <typename Function>
Scalars forEach(llvm::ArrayRef<Scalar> a, Function function) {
  Scalars result;
  for (Scalar x : a)
    result.push_back(function(x));
  return result;
}

/// Applies `function` to corresponding components; one scalar stands beside
/// every component of the other operand.
template <typename Function>
Scalars zipWith(llvm::ArrayRef<Scalar> a, llvm::ArrayRef<Scalar> b,
            Function function) {
  Scalars result;
  for (size_t i = 0, n = std::max(a.size(), b.size()); i < n; ++i)
    result.push_back(
        function(a[a.size() == 1 ? 0 : i], b[b.size() == 1 ? 0 : i]));
  return result;
}

// Shared by several families.

Scalar dot(llvm::ArrayRef<Scalar> a, llvm::ArrayRef<Scalar> b);
Scalars cross(llvm::ArrayRef<Scalar> a, llvm::ArrayRef<Scalar> b);
Scalars multiplyQuats(llvm::ArrayRef<Scalar> a, llvm::ArrayRef<Scalar> b);
Scalars multiplyTransforms(llvm::ArrayRef<Scalar> a,
                           llvm::ArrayRef<Scalar> b);
Scalars rotate(llvm::ArrayRef<Scalar> q, llvm::ArrayRef<Scalar> v);
Scalars rotateInverse(llvm::ArrayRef<Scalar> q, llvm::ArrayRef<Scalar> v);
/// Vector of length 1, or `otherwise` for the zero vector.
Scalars normalize(llvm::ArrayRef<Scalar> v, llvm::ArrayRef<Scalar> otherwise);
Scalar length(llvm::ArrayRef<Scalar> v);
/// A random point of the cube of side 1 around 0, and the new state.
Scalars pointInCube(Scalar state, unsigned dimensions);
/// a b - c d with an error of at most 1.5 units in the last place (Jeannerod,
/// Louvet and Muller, Math. Comp. 82, 2013).
Scalar differenceOfProducts(Scalar a, Scalar b, Scalar c, Scalar d);

} // namespace warp::lowering

#endif // WARP_TRANSFORMS_LOWERINGS_LOWERINGS_H
