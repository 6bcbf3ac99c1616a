//===- GeometryMemory.h - Alias analysis of handles -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H
#define WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H

#include "mlir/IR/Value.h"

namespace warp {

/// True if an array is the slot of a handle, or what a field leads to that
/// Functions.td has as `ReadOnly`, such as the cells of a hash grid: no store
/// of a kernel aliases it.
bool isGeometryMemory(mlir::Value array);
/// True if an array is memory behind a handle, which any thread may write.
bool isBehindHandle(mlir::Value array);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H
