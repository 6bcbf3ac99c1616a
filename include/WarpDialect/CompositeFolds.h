//===- CompositeFolds.h - Places of components ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DIALECT_COMPOSITEFOLDS_H
#define WARP_DIALECT_COMPOSITEFOLDS_H

#include "mlir/IR/ValueRange.h"

#include <cstdint>
#include <optional>

namespace warp {

/// Position of the component that constant indices select, in row-major
/// order; nothing if an index varies, is out of range or selects a row.
std::optional<int64_t> getComponentPosition(mlir::Type composite,
                                            mlir::ValueRange indices);

} // namespace warp

#endif // WARP_DIALECT_COMPOSITEFOLDS_H
