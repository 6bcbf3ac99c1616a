//===- Batches.h - Blocks of a CPU that solve systems together --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_BATCHES_H
#define WARP_LIB_TRANSFORMS_BATCHES_H

#include "SystemCalls.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// What a block does, in turn: operations, or calls.
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
  /// Numbers that parts have from parts before them, and their places in the
  /// memory of a block.
  llvm::DenseMap<mlir::Value, int64_t> kept;
  /// Bytes from a block's memory to the next, and of all with what calls need.
  int64_t blockBytes = 0, bytes = 0;
};

/// Whether an operation only computes, so that every part makes a copy.
bool isRepeated(mlir::Operation *op);

/// Of a kernel of phase `launch` on a CPU; none where blocks have to run one
/// after the other, or have no small systems.
std::optional<Batches> findBatches(mlir::FunctionOpInterface kernel,
                                   ThreadsOp threads);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_BATCHES_H
