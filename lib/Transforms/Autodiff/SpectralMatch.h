//===- SpectralMatch.h - Pattern match of U diag(f(s)) V^T ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_SPECTRALMATCH_H
#define WARP_TRANSFORMS_AUTODIFF_SPECTRALMATCH_H

#include "WarpDialect/WarpOps.h"

namespace warp::autodiff {

/// left diag(values) right^T, with two results of a decomposition.
struct SpectralProduct {
  MulOp op;
  mlir::Operation *decomposition;
  mlir::OpResult left, right;
  /// The numbers on the diagonal.
  llvm::SmallVector<mlir::Value, 3> diagonal;

  bool isOfEigenvectors() const { return isa<Eig3Op>(decomposition); }
  mlir::Value values() const { return decomposition->getResult(1); }
};

/// Vectors of a decomposition of floats of 32 or 64 bits, or null. A matrix
/// that is put together of all entries of them is one with them.
mlir::OpResult getVectors(mlir::Value value);
/// The vectors that a value is the transpose of, or null.
mlir::OpResult getTransposedVectors(mlir::Value value);

/// An entry of vectors.
struct VectorEntry {
  mlir::OpResult vectors;
  int64_t row = 0, column = 0;
};
std::optional<VectorEntry> matchEntry(mlir::Value value);

/// left diag(numbers) right^T.
mlir::Value makeProduct(mlir::OpBuilder &builder, mlir::Location loc,
                        mlir::OpResult left, mlir::OpResult right,
                        mlir::ValueRange numbers);

/// Writes sums of outer products of all vectors of a decomposition as products
/// of matrices.
void writeSumsAsProducts(mlir::Operation *function);

/// The same for matrices each of whose entries is such a sum, of numbers.
void writeEntriesAsProducts(mlir::Operation *function);

/// The product that a multiplication makes; none if it is another one.
std::optional<SpectralProduct> matchProduct(MulOp op);

/// Makes branches on the way from the values to the diagonal choices between
/// what both sides compute, so that they have tangents. Loops stay.
void openBranches(const SpectralProduct &product);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_SPECTRALMATCH_H
