//===- DeviceTree.h - Device copy of a BVH ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Hierarchies that the host builds. Trees for a GPU are copied there; arrays
// of a GPU are copied here first.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_DEVICETREE_H
#define WARP_LIB_GEOMETRY_DEVICETREE_H

#include "Moments.h"

#include "warp/Bvh.h"
#include "warp/Error.h"
#include "warp/Memory.h"

#include <cstring>

namespace warp::geometry {

/// Elements of a 1-D array of plain data in host memory, packed: copied if they
/// are not.
template <class T> class HostElements {
public:
  HostElements(const ArrayDescriptor &array, int device)
      : count(array.shape[0]), data(static_cast<const T *>(array.data)) {
    if (count == 0 || (isHost(device) && isContiguous(array, sizeof(T))))
      return;
    copy.resize(count);
    ArrayDescriptor packed = array;
    packed.data = copy.data();
    packed.strides[0] = sizeof(T);
    copyArray({&packed}, {&array, device}, sizeof(T));
    data = copy.data();
  }

  int64_t size() const { return count; }
  const T &operator[](int64_t i) const { return data[i]; }

private:
  int64_t count;
  const T *data;
  std::vector<T> copy;
};

struct Float3 {
  float at[3];
};

/// The nodes and blocks of a tree on a device.
template <class Block> class DeviceTree {
public:
  explicit DeviceTree(int device) : device(device) {}

  /// Gives a description of the hierarchy, copied to the device if need be.
  Tree describe(const Hierarchy<Block> &host, float scale, int64_t count) {
    Tree tree{0, nullptr, nullptr, scale, int32_t(count)};
    if (host.nodes().empty())
      return tree;
    tree.nodes = static_cast<const Node *>(
        reach(nodes, host.nodes().data(), host.nodes().size() * sizeof(Node)));
    tree.blocks = reach(blocks, host.leaves().data(),
                        host.leaves().size() * sizeof(Block));
    return tree;
  }

  /// The nodes that were described last.
  const void *nodesAt(const Hierarchy<Block> &host) const {
    return isHost(device) ? host.nodes().data() : nodes->data();
  }
  const void *blocksAt(const Hierarchy<Block> &host) const {
    return isHost(device) ? host.leaves().data() : blocks->data();
  }

  /// Parts that only some trees have, also copied to the device if need be.
  TreeExtras describeExtras(const Hierarchy<Block> &host,
                            const std::vector<Moments> &hostMoments) {
    TreeExtras extras{};
    extras.nodeCount = int32_t(host.nodes().size());
    hostGroups = host.groups();
    extras.groupCount = int32_t(hostGroups.size() / 2);
    extras.groups = static_cast<const i32 *>(
        reach(groups, hostGroups.data(), hostGroups.size() * sizeof(int32_t)));
    extras.moments = static_cast<const Moments *>(reach(
        moments, hostMoments.data(), hostMoments.size() * sizeof(Moments)));
    return extras;
  }

private:
  const void *reach(std::unique_ptr<Buffer> &buffer, const void *from,
                    size_t bytes) {
    if (bytes == 0)
      return nullptr;
    return isHost(device) ? from : upload(buffer, from, bytes);
  }
  const void *upload(std::unique_ptr<Buffer> &buffer, const void *from,
                     size_t bytes) {
    if (!buffer || buffer->size() < bytes)
      buffer = std::make_unique<Buffer>(device, bytes);
    warp::upload(buffer->data(), device, from, bytes);
    return buffer->data();
  }

  int device;
  std::unique_ptr<Buffer> nodes, blocks, groups, moments;
  std::vector<int32_t> hostGroups;
};

/// Nodes and blocks of a hierarchy where a slot says they are.
template <class Block>
std::vector<HandleMemory> memoryOf(const Hierarchy<Block> &host,
                                   const Tree &searched) {
  return {{searched.nodes, host.nodes().size() * sizeof(Node)},
          {searched.blocks, host.leaves().size() * sizeof(Block)}};
}
/// The same of one that kernels build.
inline std::vector<HandleMemory> memoryOf(const BuiltTree &built) {
  return {{reinterpret_cast<const void *>(built.nodes), built.nodeBytes},
          {reinterpret_cast<const void *>(built.blocks), built.blockBytes}};
}

/// The contents of its slot until kernels write the scale and the number of
/// groups.
inline Tree treeOf(const BuiltTree &built, int64_t count) {
  return {0, reinterpret_cast<const Node *>(built.nodes),
          reinterpret_cast<const void *>(built.blocks), 1, int32_t(count)};
}
inline TreeExtras extrasOf(const BuiltTree &built) {
  return {nullptr, reinterpret_cast<const i32 *>(built.groups), 0,
          int32_t(built.nodeBytes / sizeof(Node))};
}

template <class Block> BvhReport reportOf(const Hierarchy<Block> &tree) {
  BvhReport report;
  report.skipped = tree.skipped();
  report.nodes = int64_t(tree.nodes().size());
  report.blocks = int64_t(tree.leaves().size());
  report.bytes = int64_t(tree.bytes());
  report.depth = tree.depth();
  return report;
}

template <class Block>
HierarchyView viewOf(const Hierarchy<Block> &tree,
                     const DeviceTree<Block> &onDevice, float scale) {
  HierarchyView view;
  view.scale = scale;
  const std::vector<Node> &nodes = tree.nodes();
  if (nodes.empty())
    return view;
  view.nodes = reinterpret_cast<uint64_t>(onDevice.nodesAt(tree));
  view.blocks = reinterpret_cast<uint64_t>(onDevice.blocksAt(tree));
  view.blockCount = int64_t(tree.leaves().size());
  // Parents come before their children.
  std::vector<int32_t> depth(nodes.size());
  for (size_t i = 0; i < nodes.size(); ++i)
    depth[i] = nodes[i].parent < 0 ? 0 : depth[nodes[i].parent] + 1;
  view.order.reserve(nodes.size());
  for (int level = 0; view.order.size() < nodes.size(); ++level) {
    view.levels.push_back(int32_t(view.order.size()));
    for (size_t i = 0; i < nodes.size(); ++i)
      if (depth[i] == level)
        view.order.push_back(int32_t(i));
  }
  view.levels.push_back(int32_t(view.order.size()));
  return view;
}

inline Splitting splittingOf(BvhConstructor constructor) {
  return constructor == BvhConstructor::Sah ? Splitting::Area
                                            : Splitting::Median;
}

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_DEVICETREE_H
