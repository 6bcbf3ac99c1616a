//===- Triangles.h - Triangle vertices of user arrays -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_TRIANGLES_H
#define WARP_LIB_GEOMETRY_TRIANGLES_H

#include "DeviceTree.h"

#include "warp/Mesh.h"

namespace warp::geometry {

class Triangles {
public:
  Triangles(const MeshArrays &arrays, int device)
      : points(arrays.points, device), indices(arrays.indices, device) {}

  int64_t size() const { return indices.size() / 3; }
  /// Throws an error that names the first face with an index out of range.
  void check() const;
  /// A primitive for each face; proper are those whose coordinates are finite.
  std::vector<BuildPrimitive>
  primitives(const HostElements<int32_t> &groups) const;
  /// The box of all finite points.
  Bounds bounds() const;
  /// Writes the corners of a block's faces; NaN for what is not finite. Gives
  /// how many faces are not.
  int fill(TriangleBlock &block, float scale) const;

private:
  using Four = f32 __attribute__((ext_vector_type(4)));

  Four corner(int64_t face, int i) const {
    const float *at = points[indices[3 * face + i]].at;
    return {at[0], at[1], at[2], 0};
  }

  HostElements<Float3> points;
  HostElements<int32_t> indices;
};

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_TRIANGLES_H
