//===- IndexMath.h - Indices as sums of known values ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_INDEXMATH_H
#define WARP_TRANSFORMS_AUTODIFF_INDEXMATH_H

#include "mlir/IR/Operation.h"

#include <optional>

namespace warp::autodiff {

/// An integer as `constant + sum of coefficient * value`. Values are thread
/// indices, loop counters, arguments and whatever else is not a sum. Casts
/// between integers are looked through: indices are small.
struct IndexSum {
  int64_t constant = 0;
  llvm::SmallVector<std::pair<mlir::Value, int64_t>, 2> terms;

  static IndexSum of(mlir::Value value);
  IndexSum operator-(const IndexSum &other) const;
  int64_t coefficientOf(mlir::Value value) const;
  std::optional<int64_t> getConstant() const {
    return terms.empty() ? std::optional(constant) : std::nullopt;
  }

private:
  void add(const IndexSum &other, int64_t factor);
};

/// The dimension of the launch that a value is the thread index of.
std::optional<unsigned> getThreadDimension(mlir::Value value);

/// Whether a value is the same in all threads of a launch; a loop counter is,
/// in the same iteration, if `withCounters`.
bool isUniform(mlir::Value value, bool withCounters);

/// The value of an integer constant, through casts.
std::optional<int64_t> getConstantInteger(mlir::Value value);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_INDEXMATH_H
