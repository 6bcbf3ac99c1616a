//===- Predicates.cpp - Robust geometric predicates -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "geometry/Predicates.h"
#include "geometry/Exports.h"

using namespace warp::geometry;

WARP_GEOMETRY warp_orient2d(f64 px, f64 py, f64 qx, f64 qy, f64 rx, f64 ry,
                            i32 *result) {
  *result = orient2d({px, py}, {qx, qy}, {rx, ry});
}

WARP_GEOMETRY warp_orient3d(f64 ax, f64 ay, f64 az, f64 bx, f64 by, f64 bz,
                            f64 cx, f64 cy, f64 cz, f64 dx, f64 dy, f64 dz,
                            i32 *result) {
  *result = orient3d({ax, ay, az}, {bx, by, bz}, {cx, cy, cz}, {dx, dy, dz});
}
