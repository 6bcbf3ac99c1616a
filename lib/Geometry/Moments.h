//===- Moments.h - Moments of nodes for winding numbers ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_MOMENTS_H
#define WARP_LIB_GEOMETRY_MOMENTS_H

#include "Hierarchy.h"

#include "DeviceLib/geometry/Winding.h"

namespace warp::geometry {

/// One per node, of its children.
std::vector<Moments> findMoments(const Hierarchy<TriangleBlock> &tree);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_MOMENTS_H
