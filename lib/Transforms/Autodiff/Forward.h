//===- Forward.h - Kernels with tangents ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_FORWARD_H
#define WARP_TRANSFORMS_AUTODIFF_FORWARD_H

#include "Activity.h"
#include "Rules.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
class AtomicOp;
} // namespace warp

namespace warp::autodiff {

struct ForwardOptions {
  /// Per array leaf: it has tangents. Empty: all have.
  llvm::SmallVector<bool> active;
  Singular singular = Singular::Pinned;
};

/// Values that may have a tangent: floats and arrays of them.
class Varied {
public:
  Varied(mlir::func::FuncOp kernel, const ArrayLeaves &leaves,
         llvm::ArrayRef<bool> active);

  bool contains(mlir::Value value) const { return values.contains(value); }
  /// Positions of those that may have a tangent.
  llvm::SmallVector<unsigned> select(mlir::ValueRange range) const;

private:
  bool mark(mlir::Value value);
  bool spread(mlir::Operation *op);
  bool spreadThroughControlFlow(mlir::Operation *op);

  llvm::DenseSet<mlir::Value> values;
};

/// Builds the kernel that computes tangents beside values; Forward.cpp explains
/// how.
class ForwardBuilder {
public:
  ForwardBuilder(mlir::func::FuncOp primal, mlir::func::FuncOp dual,
                 const ForwardOptions &options);

  /// Fills the body of the dual kernel and adds its arguments.
  mlir::LogicalResult build();

private:
  void addTwins();
  mlir::LogicalResult run(mlir::Block &block);
  mlir::LogicalResult run(mlir::Operation *op);
  mlir::LogicalResult runRegions(mlir::Operation *op);
  mlir::LogicalResult runCall(mlir::func::CallOp op);
  mlir::LogicalResult runRule(mlir::Operation *op, mlir::Operation *clone);
  /// Returns nothing if the operation touches no memory.
  std::optional<mlir::LogicalResult> runMemory(mlir::Operation *op,
                                               mlir::Operation *clone);
  mlir::LogicalResult runAtomic(AtomicOp op, mlir::Operation *clone,
                                mlir::Value twin);
  /// Views and other descriptors made of an array: the same of its twin.
  mlir::Value viewTwin(mlir::Operation *clone, mlir::Value twin);

  /// Opens a block for `from`, with arguments for the tangents of those at
  /// `carried`, which are counted from `first`.
  void openBlock(mlir::Region &region, mlir::Block &from, unsigned first,
                 llvm::ArrayRef<unsigned> carried);
  mlir::LogicalResult closeBlock(mlir::Block &from, unsigned first,
                                 llvm::ArrayRef<unsigned> carried);

  llvm::SmallVector<mlir::Value> lookup(mlir::ValueRange primals) const;
  /// The tangents of those at `carried`, zeros made explicit.
  mlir::LogicalResult appendTangents(mlir::Location loc, mlir::ValueRange range,
                                     llvm::ArrayRef<unsigned> carried,
                                     llvm::SmallVectorImpl<mlir::Value> &to);
  mlir::Value getTangentOrZero(mlir::Value primal);

  mlir::OpBuilder builder;
  const ForwardOptions &options;
  mlir::func::FuncOp primal, dual;
  ArrayLeaves leaves;
  Varied varied;
  mlir::IRMapping values;
  /// Of primal values; of an array, its twin. Absent: zero.
  llvm::DenseMap<mlir::Value, mlir::Value> tangents;
  /// Twins of the arrays of the arguments.
  llvm::SmallVector<mlir::Value> twins;
};

/// Type of the tangent of a value or array; null if it has none.
mlir::Type getTangentType(mlir::Type type);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_FORWARD_H
