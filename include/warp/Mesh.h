//===- Mesh.h - Triangle meshes for queries in kernels ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The arrays stay the caller's and must live as long as the mesh: kernels read
// positions and velocities from them. A search reads a copy, taken
// when the mesh is made and refitted.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_MESH_H
#define WARP_MESH_H

#include "warp/Bvh.h"

namespace warp {

struct MeshArrays {
  /// Arrays of three floats each; velocities may be empty.
  ArrayDescriptor points, velocities;
  /// Three corners of each face, counter-clockwise seen from outside.
  ArrayDescriptor indices;
  /// A number for each face, or empty.
  ArrayDescriptor groups;
};

class WARP_API Mesh {
public:
  /// Throws `Error` of kind `Runtime` that names the first face with an index
  /// out of range. `hasWinding`: winding numbers are to be quick.
  Mesh(const MeshArrays &arrays, int device,
       BvhConstructor constructor = BvhConstructor::Sah,
       bool hasWinding = false);
  ~Mesh();

  uint64_t id() const;
  /// Takes over positions that moved, perhaps to another array.
  void refit(const MeshArrays &arrays);
  void rebuild(const MeshArrays &arrays,
               BvhConstructor constructor = BvhConstructor::Sah);
  /// As if made with `hasWinding`.
  void supportWinding(const MeshArrays &arrays);
  /// As that of a Bvh, with the arrays that kernels are to read. Indices are
  /// not checked.
  void adopt(const MeshArrays &arrays, const BuiltTree &built);
  BvhReport report() const;
  HierarchyView view() const;

private:
  struct Impl;
  /// Shared with graphs that update it.
  std::shared_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_MESH_H
