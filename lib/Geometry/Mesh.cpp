//===- Mesh.cpp - Triangle meshes that kernels search ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Mesh.h"

#include "DeviceTree.h"
#include "Slots.h"

#include <cmath>
#include <cstddef>
#include <limits>

using namespace warp;
using namespace warp::geometry;

namespace {

/// What follows the tree in the slot of a mesh.
struct MeshSlot {
  ArrayDescriptor points, velocities, indices;
  TreeExtras extras;
};
static_assert(sizeof(Tree) + offsetof(MeshSlot, extras) == extrasOffset);

/// Corners of faces, read from the user's arrays.
struct Triangles {
  Triangles(const MeshArrays &arrays, int device)
      : points(arrays.points, device), indices(arrays.indices, device) {}

  int64_t size() const { return indices.size() / 3; }
  const Float3 &corner(int64_t face, int i) const {
    return points[indices[3 * face + i]];
  }
  void check() const {
    for (int64_t i = 0; i < indices.size(); ++i)
      if (indices[i] < 0 || indices[i] >= points.size())
        throw Error(Error::Kind::Runtime,
                    "face " + std::to_string(i / 3) + " has the index " +
                        std::to_string(indices[i]) + ", but there are " +
                        std::to_string(points.size()) + " points");
  }
  /// False if a coordinate is NaN or infinite.
  bool boundsOf(int64_t face, Bounds &bounds) const {
    for (int i = 0; i < 3; ++i) {
      const Float3 &point = corner(face, i);
      for (float x : point.at)
        if (!std::isfinite(x))
          return false;
      bounds.include(point.at);
    }
    return true;
  }

  HostElements<Float3> points;
  HostElements<int32_t> indices;
};

} // namespace

struct Mesh::Impl {
  explicit Impl(int device)
      : slot(GeometryKind::Mesh, device), onDevice(device) {}

  void build(const MeshArrays &arrays, Splitting splitting);
  void checkGroups(const MeshArrays &arrays) const;
  void refit(const MeshArrays &arrays);
  void fill(const Triangles &triangles, TriangleBlock &block) const;
  void publish(const MeshArrays &arrays);

  Slot slot;
  Hierarchy<TriangleBlock> tree;
  DeviceTree<TriangleBlock> onDevice;
  float scale = 1;
  int64_t faces = 0, skipped = 0;
  bool hasWinding = false;
  std::vector<Moments> moments;
};

void Mesh::Impl::fill(const Triangles &triangles, TriangleBlock &block) const {
  constexpr float none = std::numeric_limits<float>::quiet_NaN();
  for (int lane = 0; lane < width; ++lane) {
    int32_t face = block.id[lane];
    Bounds unused;
    bool isThere = face >= 0 && triangles.boundsOf(face, unused);
    for (int i = 0; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis)
        block.vertex[i][axis][lane] =
            isThere ? triangles.corner(face, i).at[axis] * scale : none;
  }
}

void Mesh::Impl::build(const MeshArrays &arrays, Splitting splitting) {
  Triangles triangles(arrays, slot.device());
  triangles.check();
  faces = triangles.size();
  checkGroups(arrays);
  HostElements<int32_t> groups(arrays.groups, slot.device());
  bool hasGroups = groups.size() > 0;
  std::vector<BuildPrimitive> primitives;
  primitives.reserve(faces);
  Bounds all;
  for (int64_t face = 0; face < faces; ++face) {
    BuildPrimitive primitive{
        {}, int32_t(face), hasGroups ? groups[face] : 0};
    if (!triangles.boundsOf(face, primitive.bounds))
      continue;
    all.include(primitive.bounds);
    primitives.push_back(primitive);
  }
  skipped = faces - int64_t(primitives.size());
  scale = chooseScale(all);
  tree.build(std::move(primitives), splitting, hasGroups,
             [&](TriangleBlock &block) { fill(triangles, block); });
  publish(arrays);
}

void Mesh::Impl::checkGroups(const MeshArrays &arrays) const {
  int64_t groups = arrays.groups.shape[0];
  if (groups != 0 && groups != faces)
    throw Error(Error::Kind::Runtime, "a mesh with groups has one for each of "
                                      "its " +
                                          std::to_string(faces) +
                                          " faces, but got " +
                                          std::to_string(groups));
}

void Mesh::Impl::refit(const MeshArrays &arrays) {
  Triangles triangles(arrays, slot.device());
  if (triangles.size() != faces)
    throw Error(Error::Kind::Runtime,
                "a refitted mesh keeps its " + std::to_string(faces) +
                    " faces, but got " + std::to_string(triangles.size()));
  triangles.check();
  Bounds all;
  for (int64_t i = 0; i < triangles.points.size(); ++i) {
    const Float3 &point = triangles.points[i];
    if (std::isfinite(point.at[0]) && std::isfinite(point.at[1]) &&
        std::isfinite(point.at[2]))
      all.include(point.at);
  }
  scale = chooseScale(all);
  tree.refit([&](TriangleBlock &block) { fill(triangles, block); });
  publish(arrays);
}

void Mesh::Impl::publish(const MeshArrays &arrays) {
  struct {
    Tree tree;
    MeshSlot mesh;
  } contents{onDevice.describe(tree, scale, faces),
             {arrays.points, arrays.velocities, arrays.indices, {}}};
  if (hasWinding)
    moments = findMoments(tree);
  contents.mesh.extras = onDevice.describeExtras(tree, moments);
  // The slot writes the first word.
  slot.write(&contents.tree.nodes, sizeof contents - sizeof contents.tree.tag);
}

Mesh::Mesh(const MeshArrays &arrays, int device, BvhConstructor constructor,
           bool hasWinding)
    : impl(std::make_unique<Impl>(device)) {
  impl->hasWinding = hasWinding;
  impl->build(arrays, splittingOf(constructor));
}

Mesh::~Mesh() = default;

uint64_t Mesh::id() const { return impl->slot.id(); }

void Mesh::refit(const MeshArrays &arrays) { impl->refit(arrays); }

void Mesh::rebuild(const MeshArrays &arrays, BvhConstructor constructor) {
  impl->build(arrays, splittingOf(constructor));
}

HierarchyView Mesh::view() const {
  return viewOf(impl->tree, impl->onDevice, impl->scale);
}

BvhReport Mesh::report() const { return reportOf(impl->tree, impl->skipped); }
