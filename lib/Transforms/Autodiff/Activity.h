//===- Activity.h - Which values carry derivatives --------------*- C++ -*-===//
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

#include "mlir/IR/Value.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/SetVector.h"

namespace warp::autodiff {

/// Float scalars and composites of them.
bool hasDerivative(mlir::Type type);

/// Array leaves of a function's arguments: arguments in order, and the arrays
/// within a struct in the order of its fields. The engine calls a leaf by its
/// number in that order.
class ArrayLeaves {
public:
  explicit ArrayLeaves(mlir::FunctionOpInterface function);

  unsigned size() const { return count; }
  /// Leaves that an array may be; no leaf if that is unknown.
  llvm::SmallVector<unsigned, 1> of(mlir::Value array) const;
  /// What the user calls a leaf: `x`, or `state.x`.
  std::string getName(unsigned leaf) const;

private:
  mutable mlir::FunctionOpInterface function;
  llvm::SmallVector<unsigned> first;
  unsigned count = 0;
};

class Activity {
public:
  /// `active` has one flag per leaf: the array has a gradient.
  Activity(mlir::FunctionOpInterface function, const ArrayLeaves &leaves,
           llvm::ArrayRef<bool> active);

  bool isActive(mlir::Value value) const {
    return varied.contains(value) && useful.contains(value);
  }
  bool isVaried(mlir::Value value) const { return varied.contains(value); }
  /// The array has a gradient.
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
