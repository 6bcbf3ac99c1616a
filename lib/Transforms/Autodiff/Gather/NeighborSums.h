//===- NeighborSums.h - Stencil updates around a thread ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_NEIGHBORSUMS_H
#define WARP_TRANSFORMS_AUTODIFF_NEIGHBORSUMS_H

#include "Analysis/Forms.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/SetVector.h"

namespace warp::autodiff {

/// A thread index plus a small constant.
struct Shift {
  unsigned dimension;
  int64_t offset;
  bool operator==(const Shift &other) const {
    return dimension == other.dimension && offset == other.offset;
  }
};

/// A signed value of that form, or a form that is one.
std::optional<Shift> getShift(mlir::Value value);
std::optional<Shift> getShift(const Form &form);

/// One addition to an element near the thread's own.
struct NeighborSum {
  AccumulateOp op;
  /// From the thread to the element, by dimension of the launch.
  llvm::SmallVector<int64_t, 3> offsets;
};

/// An index of an element near the thread's own: it follows a dimension of the
/// launch, or is `fixed`, the same in all threads.
struct NeighborIndex {
  unsigned dimension = 0;
  mlir::Value fixed;
  bool operator==(const NeighborIndex &other) const;
};

/// All that a kernel does to the gradients of one array that have the same fixed
/// indices.
struct NeighborSums {
  /// The array of gradients.
  mlir::Value gradients;
  /// One per dimension of the array.
  llvm::SmallVector<NeighborIndex, 4> indices;
  llvm::SmallVector<NeighborSum> sums;
};

/// The gradients of an adjoint to which threads add around their own element
/// only, atomically as it is, and what can be computed for another thread,
/// before the launch, as well as by that thread itself. `rank` becomes the
/// number of thread indices. An array is there once for each choice of indices
/// that are the same in all threads. Additions in `borders` are left out.
llvm::SmallVector<NeighborSums>
findNeighborSums(mlir::func::FuncOp adjoint,
                 const llvm::DenseSet<mlir::Operation *> &borders,
                 unsigned &rank);

/// True if a value is the same in all threads of the launch.
bool isUniform(mlir::Value value);

/// The operations that compute the operands of an operation, the
/// conditions of the branches around it included.
llvm::SetVector<mlir::Operation *> getSlice(mlir::Operation *op);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_NEIGHBORSUMS_H
