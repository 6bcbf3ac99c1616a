//===- SparseProduct.h - Sparse matrix-vector product -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SPARSEPRODUCT_H
#define WARP_SPARSEPRODUCT_H

#include "warp/Sequences.h"

namespace warp {

/// y = alpha * A x + beta * y, which does not read y if beta is zero. The
/// entries of row i are those from offsets[i] to offsets[i + 1]; offsets[0] is
/// zero.
struct SparseProduct {
  /// Float32 or Float64.
  NumberType kind;
  int64_t rows, width;
  const int32_t *offsets, *columns;
  const void *values;
  /// For how many entries there is room: the number of entries at least.
  int64_t capacity;
  const void *x;
  void *y;
  double alpha, beta;
};

/// On CUDA, where blocks share the entries whatever rows have, in an order that
/// depends on the matrix alone. Queued on a stream, temporary memory included:
/// graphs capture it.
WARP_API void multiplyRows(int device, const SparseProduct &product,
                           const Stream *stream = nullptr);

} // namespace warp

#endif // WARP_SPARSEPRODUCT_H
