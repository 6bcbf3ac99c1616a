//===- Topology.cpp - NanoVDB topology: tiles sorted by node --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Topology.h"

#include <algorithm>
#include <numeric>

using namespace warp;
using namespace warp::geometry;

namespace {

/// The place of a tile in the order of the file: its root, then its place in
/// the upper node and in the lower one.
struct Key {
  uint64_t root;
  uint32_t inner, voxel;
};

} // namespace

static Key keyOf(const Int3 &v, uint32_t number) {
  uint64_t root = 0;
  for (int32_t x : v.at)
    root = root << 20 | uint64_t((x >> 12) + (1 << 19));
  return {root, cellOf(v, 7, 5) << 12 | cellOf(v, 3, 4), number};
}

static Int3 downTo(const Int3 &v, int bits) {
  Int3 low;
  for (int axis = 0; axis < 3; ++axis)
    low.at[axis] = int32_t(uint32_t(v.at[axis] >> bits) << bits);
  return low;
}

/// Keys in order. Voxels that follow each other are often in one tile: runs
/// of those are sorted as one.
static std::vector<Key> sortedRuns(const std::vector<Int3> &voxels) {
  std::vector<Key> keys;
  bool isSorted = true;
  for (size_t i = 0; i < voxels.size(); ++i) {
    Key key = keyOf(voxels[i], uint32_t(i));
    if (!keys.empty()) {
      const Key &last = keys.back();
      if (last.root == key.root && last.inner == key.inner)
        continue;
      isSorted &= last.root < key.root ||
                  (last.root == key.root && last.inner < key.inner);
    }
    keys.push_back(key);
  }
  if (!isSorted)
    std::sort(keys.begin(), keys.end(), [](const Key &a, const Key &b) {
      return a.root != b.root ? a.root < b.root : a.inner < b.inner;
    });
  return keys;
}

VoxelTopology::VoxelTopology(const std::vector<Int3> &voxels) {
  constexpr uint32_t none = ~0u;
  leafOf.assign(voxels.size(), none);
  const Key *last = nullptr;
  std::vector<Key> keys = sortedRuns(voxels);
  for (const Key &key : keys) {
    const Int3 &v = voxels[key.voxel];
    bool isNewRoot = !last || last->root != key.root;
    bool isNewLower = isNewRoot || last->inner >> 12 != key.inner >> 12;
    if (isNewRoot)
      uppers.push_back(downTo(v, 12));
    if (isNewLower) {
      upperOf.push_back(uint32_t(uppers.size() - 1));
      lowers.push_back(downTo(v, 7));
    }
    if (isNewLower || last->inner != key.inner) {
      lowerOf.push_back(uint32_t(lowers.size() - 1));
      leaves.push_back(downTo(v, 3));
    }
    leafOf[key.voxel] = uint32_t(leaves.size() - 1);
    last = &key;
  }
  // The others of a run.
  for (size_t i = 1; i < leafOf.size(); ++i)
    if (leafOf[i] == none)
      leafOf[i] = leafOf[i - 1];
}
