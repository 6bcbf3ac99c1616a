//===- TangentSlice.h - Forward slice of a result ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_TANGENTSLICE_H
#define WARP_TRANSFORMS_AUTODIFF_TANGENTSLICE_H

#include "Autodiff/Rules/Rules.h"

#include "llvm/ADT/SetVector.h"

namespace warp::autodiff {

/// Operations that depend on a result of another one, in their order.
class TangentSlice {
public:
  TangentSlice(mlir::Operation *origin, mlir::Value values)
      : origin(origin), values(values) {}

  /// Adds what `value` is computed by. Fails where that has no simple tangent.
  llvm::LogicalResult add(mlir::Value value) {
    return llvm::failure(!depends(value).has_value());
  }

  /// Tangents of `ends`, null for zero, from that of the values.
  llvm::SmallVector<mlir::Value> getTangents(RuleContext &context,
                                             mlir::ValueRange ends,
                                             mlir::Value seed,
                                             bool &failed) const;

  llvm::SetVector<mlir::Operation *> ops;

private:
  /// True if a value depends on the values; none if nobody knows.
  std::optional<bool> depends(mlir::Value value);
  std::optional<bool> dependsBy(mlir::Operation *op);

  mlir::Operation *origin;
  mlir::Value values;
  llvm::DenseMap<mlir::Value, std::optional<bool>> known;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_TANGENTSLICE_H
