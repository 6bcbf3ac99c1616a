//===- Batches.h - Batched linear systems of CPU blocks ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_BATCHES_H
#define WARP_LIB_TRANSFORMS_BATCHES_H

#include "SystemCalls.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// A part of the work of a block: operations, or calls.
struct BatchPart {
  llvm::SmallVector<mlir::Operation *> ops;
  std::optional<SystemCalls> calls;
};

/// How a kernel is made of parts that several blocks go through together, one
/// part after the other.
struct Batches {
  /// Blocks of a batch: lanes of the widest vectors.
  static constexpr int64_t width = 16;

  llvm::SmallVector<BatchPart> parts;
  /// Numbers that parts use of earlier parts, and their offsets in the scratch
  /// space of a block.
  llvm::DenseMap<mlir::Value, int64_t> kept;
  /// Bytes from the scratch space of a block to the next, and of all with the
  /// scratch of calls.
  int64_t blockBytes = 0, bytes = 0;
};

/// True if an operation only computes, so that every part copies it.
bool isRepeated(mlir::Operation *op);

/// The batches of a kernel of phase `launch` on a CPU; none where blocks have
/// to run one after the other, or have no small systems.
std::optional<Batches> findBatches(mlir::FunctionOpInterface kernel,
                                   ThreadsOp threads);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_BATCHES_H
