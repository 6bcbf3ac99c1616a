//===- Cotangents.h - Cotangents of values, summed lazily -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_COTANGENTS_H
#define WARP_TRANSFORMS_AUTODIFF_COTANGENTS_H

#include "mlir/IR/Builders.h"

#include "llvm/ADT/MapVector.h"

#include <map>
#include <optional>

namespace warp {
class ExtractOp;
} // namespace warp

namespace warp::autodiff {

/// The cotangent of one value so far: a sum of whole values, and of
/// contributions to single components. Absent parts are zero.
struct Cotangent {
  mlir::Value whole;
  std::map<int64_t, mlir::Value> slots;

  bool isZero() const { return !whole && slots.empty(); }
};

/// Cotangents by primal value, in the order in which they first got one, so
/// that the same input gives the same text.
class Cotangents {
public:
  /// Adds to the cotangent of a primal value.
  void add(mlir::OpBuilder &builder, mlir::Location loc, mlir::Value primal,
           mlir::Value cotangent);
  /// Adds to one component, counted in row-major order.
  void addSlot(mlir::OpBuilder &builder, mlir::Location loc,
               mlir::Value primal, int64_t slot, mlir::Value cotangent);
  /// Removes the cotangent and returns it as one value; null if it is zero.
  mlir::Value take(mlir::OpBuilder &builder, mlir::Location loc,
                   mlir::Value primal);
  /// Removes the cotangent without summing its parts.
  Cotangent takeParts(mlir::Value primal);
  bool isZero(mlir::Value primal) const;
  /// Values that have a cotangent.
  llvm::SmallVector<mlir::Value> getPrimals() const;

private:
  llvm::MapVector<mlir::Value, Cotangent> map;
};

/// Number of the component, or of the first one of the row, that is extracted;
/// none unless the indices are constants in range.
std::optional<int64_t> getFirstSlot(ExtractOp op);
/// Indices of a component of a composite.
llvm::SmallVector<mlir::Value, 2> getSlotIndices(mlir::OpBuilder &builder,
                                                 mlir::Location loc,
                                                 mlir::Type type, int64_t slot);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_COTANGENTS_H
