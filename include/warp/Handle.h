//===- Handle.h - Geometry that kernels know by a number --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_HANDLE_H
#define WARP_HANDLE_H

#include "warp/Export.h"

#include <cstdint>
#include <string>

namespace warp {

enum class GeometryKind : uint8_t { HashGrid = 1, Bvh = 2, Mesh = 3 };

/// What is wrong with the handle of an object that should be alive on a
/// device, such as "the id of a freed Mesh"; empty if nothing is. A Mesh is
/// a Bvh, too.
WARP_API std::string describeHandle(uint64_t id, GeometryKind kind,
                                    int device);

} // namespace warp

#endif // WARP_HANDLE_H
