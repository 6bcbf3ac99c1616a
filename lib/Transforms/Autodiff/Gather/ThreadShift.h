//===- ThreadShift.h - Thread indices plus constants ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_THREADSHIFT_H
#define WARP_TRANSFORMS_AUTODIFF_THREADSHIFT_H

#include "mlir/IR/Operation.h"

#include <optional>

namespace warp::autodiff {

/// A thread index plus a small constant.
struct Shift {
  unsigned dimension;
  int64_t offset;
  bool operator==(const Shift &other) const {
    return dimension == other.dimension && offset == other.offset;
  }
};

/// A value of that form; casts to wider integers do not matter.
std::optional<Shift> getShift(mlir::Value value);

/// The least thread index for which a comparison with a constant holds, or does
/// not, as far as it says so by a lower bound or equality; indices are not
/// negative.
std::optional<int64_t> getLeast(mlir::Operation *comparison, bool holds,
                                unsigned dimension);

/// Whether such an index does not count from the end where `op` is: it is not
/// negative for the thread indices that the branches around let pass.
bool isNonNegative(Shift index, mlir::Operation *op);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_THREADSHIFT_H
