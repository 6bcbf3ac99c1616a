//===- Mesh.cpp - Triangle meshes for queries in kernels ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/Mesh.h"

#include "Recording.h"
#include "Triangles.h"

#include <cstddef>

using namespace warp;
using namespace warp::geometry;

namespace {

/// The words after the tree in the slot of a mesh.
struct MeshSlot {
  ArrayDescriptor points, velocities, indices;
  TreeExtras extras;
};
static_assert(sizeof(Tree) + offsetof(MeshSlot, extras) == extrasOffset);

} // namespace

struct Mesh::Impl {
  explicit Impl(int device)
      : slot(GeometryKind::Mesh, device), onDevice(device) {}

  void build(const MeshArrays &arrays, Splitting splitting);
  void checkGroups(const MeshArrays &arrays) const;
  void refit(const MeshArrays &arrays);
  void publish(const MeshArrays &arrays);
  void write(const Tree &searched, const MeshArrays &arrays,
             const TreeExtras &extras, std::vector<HandleMemory> memory);

  Slot slot;
  Hierarchy<TriangleBlock> tree;
  DeviceTree<TriangleBlock> onDevice;
  /// From the last build; owned by the caller.
  ArrayDescriptor groups;
  float scale = 1;
  int64_t faces = 0;
  bool hasWinding = false;
  std::vector<Moments> moments;
};

void Mesh::Impl::build(const MeshArrays &arrays, Splitting splitting) {
  Triangles triangles(arrays, slot.device());
  triangles.check();
  faces = triangles.size();
  checkGroups(arrays);
  this->groups = arrays.groups;
  HostElements<int32_t> groups(arrays.groups, slot.device());
  tree.build(
      triangles.primitives(groups), splitting, groups.size() > 0,
      [&](const Bounds &all) { scale = chooseScale(all); },
      [&](TriangleBlock &block) { return triangles.fill(block, scale); });
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
  scale = chooseScale(triangles.bounds());
  tree.refit(
      [&](TriangleBlock &block) { return triangles.fill(block, scale); });
  publish(arrays);
}

void Mesh::Impl::publish(const MeshArrays &arrays) {
  if (hasWinding)
    moments = findMoments(tree);
  Tree searched = onDevice.describe(tree, scale, faces);
  write(searched, arrays, onDevice.describeExtras(tree, moments),
        memoryOf(tree, searched));
}

void Mesh::Impl::write(const Tree &searched, const MeshArrays &arrays,
                       const TreeExtras &extras,
                       std::vector<HandleMemory> memory) {
  struct {
    Tree tree;
    MeshSlot mesh;
  } contents{searched,
             {arrays.points, arrays.velocities, arrays.indices, extras}};
  // The slot writes the first word.
  slot.write(&contents.tree.nodes, sizeof contents - sizeof contents.tree.tag,
             std::move(memory));
}

Mesh::Mesh(const MeshArrays &arrays, int device, BvhConstructor constructor,
           bool hasWinding)
    : impl(std::make_shared<Impl>(device)) {
  impl->hasWinding = hasWinding;
  if (constructor != BvhConstructor::None)
    impl->build(arrays, splittingOf(constructor));
}

Mesh::~Mesh() = default;

uint64_t Mesh::id() const { return impl->slot.id(); }

static graphs::UpdateGeometry noteOf(const Slot &slot, const MeshArrays &arrays,
                                     const ArrayDescriptor &groups) {
  return noteOf(slot,
                {arrays.points, arrays.velocities, arrays.indices, groups});
}

void Mesh::refit(const MeshArrays &arrays) {
  update(impl->slot, noteOf(impl->slot, arrays, impl->groups),
         [impl = impl, arrays] { impl->refit(arrays); });
}

void Mesh::rebuild(const MeshArrays &arrays, BvhConstructor constructor) {
  update(impl->slot,
         rebuildOf(noteOf(impl->slot, arrays, arrays.groups), constructor),
         [impl = impl, arrays, constructor] {
           impl->build(arrays, splittingOf(constructor));
         });
}

void Mesh::supportWinding(const MeshArrays &arrays) {
  impl->hasWinding = true;
  impl->publish(arrays);
}

void Mesh::adopt(const MeshArrays &arrays, const BuiltTree &built) {
  impl->write(treeOf(built, arrays.indices.shape[0] / 3), arrays,
              extrasOf(built), memoryOf(built));
}

HierarchyView Mesh::view() const {
  return viewOf(impl->tree, impl->onDevice, impl->scale);
}

BvhReport Mesh::report() const { return reportOf(impl->tree); }
