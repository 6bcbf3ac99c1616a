//===- Activity.h - Activity analysis ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A value is varied if it depends on an active array, and useful if an active
// array depends on it. Only values that are both, and whose type has a
// derivative, get cotangents: nothing is ever emitted for the others.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_ACTIVITY_H
#define WARP_TRANSFORMS_AUTODIFF_ACTIVITY_H

#include "Analysis/ArrayOrigins.h"

#include "mlir/IR/Builders.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/SetVector.h"

namespace warp {
class AccessOp;
} // namespace warp

namespace warp::autodiff {

/// Float scalars and composites of them.
bool hasDerivative(mlir::Type type);

/// The address of the gradients of what lies at an address, 0 if there are
/// none; null for any other array.
mlir::Value gradientAddress(mlir::Value array);

/// Rejects a write there, as it would have to take gradients or leave tangents.
mlir::LogicalResult checkAddress(AccessOp write);

/// The result of `body` if an address is not 0, else a zero of the type;
/// nothing without a type.
mlir::Value ifThere(mlir::OpBuilder &builder, mlir::Location loc,
                    mlir::Value address, mlir::Type type,
                    llvm::function_ref<mlir::Value()> body);

class Activity {
public:
  /// `active` has one flag per leaf: the array has a gradient.
  Activity(mlir::FunctionOpInterface function, const ArrayLeaves &leaves,
           llvm::ArrayRef<bool> active);

  bool isActive(mlir::Value value) const {
    return varied.contains(value) && useful.contains(value);
  }
  bool isVaried(mlir::Value value) const { return varied.contains(value); }
  /// The array has a gradient, or may have one at an address.
  bool isActiveArray(mlir::Value array) const;

  /// Casts from float to integer through which a useful value depends on an
  /// active array.
  llvm::ArrayRef<mlir::Operation *> getStops() const {
    return stops.getArrayRef();
  }

private:
  bool markVaried(mlir::Value value);
  bool markUseful(mlir::Value value);
  bool spreadVaried(mlir::Operation *op);
  bool spreadUseful(mlir::Operation *op);
  void findStops(mlir::FunctionOpInterface function);

  const ArrayLeaves &leaves;
  llvm::SmallVector<bool> active;
  llvm::DenseSet<mlir::Value> varied, useful;
  llvm::SetVector<mlir::Operation *> stops;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_ACTIVITY_H
