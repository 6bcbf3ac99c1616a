//===- KeptCalls.h - Out-of-line functions ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A kernel within its budget has all calls inlined. A longer one keeps calls of
// the largest functions that have several, so that its length follows that of
// the program's text. Such a function becomes an internal function of the
// target: arguments and results by value, arrays as descriptors; on CPUs as
// vectors if threads are lanes (Transforms/Lanes/LaneCalls.h).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_KEPTCALLS_H
#define WARP_LIB_COMPILER_KEPTCALLS_H

#include "mlir/Dialect/Func/IR/FuncOps.h"

#include <optional>

namespace warp {

/// A function in the graph of calls.
struct CallNode {
  mlir::func::FuncOp function;
  /// Scalar operations of its own.
  double own = 0;
  /// Numbers of the functions it calls, one for each call. They come before it.
  llvm::SmallVector<unsigned> callees;
};

/// Operations that become of one once values are scalars.
double scalarOperations(mlir::Operation *op);

/// The functions that may stay, and the scalar operations from which they do.
struct KeptCalls {
  /// A call costs about as much as so many operations, and hides from an
  /// optimiser what they work on.
  static constexpr double shortest = 64;

  llvm::SmallVector<bool> mayStay;
  double least = 0;
};

/// The choice for a kernel, which comes last; none within its budget. The
/// largest functions stay, until the code has no more scalar operations than
/// the budget, or all that may stay do.
/// mayUpdate: also functions that update elements atomically or print.
std::optional<KeptCalls> chooseKeptCalls(llvm::ArrayRef<CallNode> nodes,
                                         double budget, bool mayUpdate);

} // namespace warp

#endif // WARP_LIB_COMPILER_KEPTCALLS_H
