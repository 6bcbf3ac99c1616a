//===- GeometryMemory.h - Geometry memory of the runtime --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H
#define WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H

#include "mlir/IR/Value.h"

namespace warp {

/// True if an array is the slot of a handle, the cells or the order of a hash
/// grid, or the header of a volume's grid: the runtime made them for itself,
/// and no kernel of a user writes there.
bool isGeometryMemory(mlir::Value array);
/// True if an array is what a handle leads to, whoever writes there.
bool isBehindHandle(mlir::Value array);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_GEOMETRYMEMORY_H
