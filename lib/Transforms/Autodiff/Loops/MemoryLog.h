//===- MemoryLog.h - Log of loaded values -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_MEMORYLOG_H
#define WARP_TRANSFORMS_AUTODIFF_MEMORYLOG_H

#include "OrderedReads.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace warp::autodiff {

/// A load in a loop whose values are kept, one for each iteration.
struct LoggedLoad {
  /// The body of the loop, by number, and which of the loads in it.
  int64_t site = 0, ordinal = 0;
  /// How many iterations there were before, of all runs of the loop.
  mlir::Value position;
};

/// The values that are kept while a kernel runs again.
struct MemoryLog {
  llvm::MapVector<mlir::Operation *, LoggedLoad> loads;
  int64_t sites = 0;
  /// Atomics whose result is used, each once in a thread: the launch keeps what
  /// they returned, by their number.
  llvm::MapVector<mlir::Operation *, int64_t> returned;
  /// Arrays, by leaf, of which each launch has to show that no thread touches
  /// what another one writes.
  llvm::SmallDenseSet<unsigned> checked;
  /// The contents that the launch has left stand for those from before: no
  /// thread may read an element before it writes it.
  bool isUnrecorded = false;
};

/// Chooses the loads, counts iterations in the kernel and makes the function
/// that fills the log, next to the kernel. Returns whether there is anything to
/// keep or to check; nothing has changed if not. `shared` are arrays of which
/// indices do not show whether threads conflict; `ordered` loads need no log.
bool makeMemoryLog(mlir::func::FuncOp kernel, const MemoryClasses &memory,
                   llvm::ArrayRef<unsigned> shared, const OrderedReads &ordered,
                   MemoryLog &log);

/// The element of a tape, which has rows, that is at a number.
llvm::SmallVector<mlir::Value>
getTapeIndices(mlir::OpBuilder &b, mlir::Location loc, mlir::Value at);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_MEMORYLOG_H
