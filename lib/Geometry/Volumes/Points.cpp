//===- Points.cpp - Grids made of points and of dense values --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Build.h"

#include "DeviceTree.h"

#include "warp/ThreadPool.h"

#include <cmath>

using namespace warp;
using namespace warp::geometry;

/// The voxel around a point of the world; false for what is no number.
static bool placeOf(const Float3 &point, const GridTransform &transform,
                    const double (&inverse)[9], const GridPoints &points,
                    Int3 &voxel) {
  double from[3];
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(point.at[axis]))
      return false;
    from[axis] = double(point.at[axis]) - transform.shift[axis];
  }
  for (int axis = 0; axis < 3; ++axis) {
    const double *row = inverse + 3 * axis;
    double x = row[0] * from[0] + row[1] * from[1] + row[2] * from[2];
    x = std::floor(x + 0.5);
    if (!(std::fabs(x) < 2147483648.0))
      throw Error(Error::Kind::Runtime,
                  points.name + " are beyond the 2^31 voxels of index space");
    voxel.at[axis] = int32_t(x);
  }
  return true;
}

std::vector<Int3> warp::geometry::voxelsOf(const GridPoints &points,
                                           const GridTransform &transform) {
  int64_t count = points.points.shape[0];
  std::vector<Int3> voxels;
  voxels.reserve(count);
  bool hasMask = points.mask.data != nullptr;
  HostElements<int32_t> mask(hasMask ? points.mask : ArrayDescriptor(),
                             points.device);
  auto isKept = [&](int64_t i) { return !hasMask || mask[i]; };
  if (points.areVoxels) {
    HostElements<Int3> elements(points.points, points.device);
    for (int64_t i = 0; i < count; ++i)
      if (isKept(i))
        voxels.push_back(elements[i]);
    return voxels;
  }
  double inverse[9];
  invertMatrix(transform.matrix, inverse);
  HostElements<Float3> elements(points.points, points.device);
  Int3 voxel;
  for (int64_t i = 0; i < count; ++i)
    if (isKept(i) && placeOf(elements[i], transform, inverse, points, voxel))
      voxels.push_back(voxel);
  return voxels;
}

static GridBytes gridOf(const GridRecipe &recipe,
                        const std::vector<Int3> &voxels) {
  VoxelTopology topology(voxels);
  if (!recipe.ofVoxels)
    return fillGrid(topology, recipe);
  std::vector<LeafHead> masks(topology.leaves.size());
  for (size_t i = 0; i < voxels.size(); ++i) {
    uint32_t cell = cellOf(voxels[i], 0, 3);
    masks[topology.leafOf[i]].values[cell >> 6] |= uint64_t(1) << (cell & 63);
  }
  return fillGrid(topology, recipe, &masks);
}

GridBytes GridRecipe::make(const GridPoints &points) const {
  return gridOf(*this, voxelsOf(points, transform));
}

GridBytes GridRecipe::makeEmpty() const { return gridOf(*this, {}); }

int64_t GridRecipe::bytesFor(const GridCounts &counts) const {
  GridLayout at = gridLayout(ofVoxels ? VoxelType::OnIndex : type);
  return at.rootAt + at.root + counts.uppers * (at.tile + at.upper) +
         counts.lowers * at.lower + counts.leaves * at.leaf;
}

/// Writes the 8^3 values of a tile; those outside of the array stay.
static void copyTile(const DenseValues &dense, const Int3 &low, int64_t size,
                     uint8_t *leaf) {
  auto *values = static_cast<const uint8_t *>(dense.values);
  int64_t length = std::min<int64_t>(8, dense.shape[2] - low.at[2]);
  for (int x = 0; x < 8 && low.at[0] + x < dense.shape[0]; ++x)
    for (int y = 0; y < 8 && low.at[1] + y < dense.shape[1]; ++y) {
      int64_t row = (low.at[0] + x) * dense.shape[1] + low.at[1] + y;
      std::memcpy(leaf + (x << 6 | y << 3) * size,
                  values + (row * dense.shape[2] + low.at[2]) * size,
                  length * size);
    }
}

GridBytes warp::makeDense(const GridRecipe &recipe, const DenseValues &dense) {
  int64_t low[3] = {}, high[3];
  for (int axis = 0; axis < 3; ++axis)
    high[axis] = dense.shape[axis] - 1;
  std::vector<int32_t> corners = tilesOfBox(low, high);
  std::vector<Int3> tiles(corners.size() / 3);
  std::memcpy(tiles.data(), corners.data(), corners.size() * sizeof(int32_t));
  VoxelTopology topology(tiles);
  GridBytes grid = fillGrid(topology, recipe);
  GridLayout layout = gridLayout(recipe.type);
  auto count = int64_t(topology.leaves.size());
  uint8_t *leaves = grid.data() + grid.size() - count * layout.leaf;
  ThreadPool::parallelFor(0, count, 64, [&](int64_t from, int64_t to) {
    for (int64_t i = from; i < to; ++i)
      copyTile(dense, topology.leaves[i], layout.value,
               leaves + i * layout.leaf + layout.leafTable);
  });
  return grid;
}

std::vector<int32_t> warp::tilesOfBox(const int64_t (&low)[3],
                                      const int64_t (&high)[3]) {
  int64_t first[3], extent[3];
  double count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (low[axis] < INT32_MIN || high[axis] > INT32_MAX)
      throw Error(Error::Kind::Runtime, "a voxel's coordinates have 32 bits");
    first[axis] = low[axis] >> 3;
    extent[axis] = std::max<int64_t>((high[axis] >> 3) - first[axis] + 1, 0);
    count *= double(extent[axis]);
  }
  if (count >= 2147483648.0)
    throw Error(Error::Kind::Memory,
                "a box of " + std::to_string(int64_t(count)) +
                    " tiles, but a volume has fewer than 2^31");
  std::vector<int32_t> tiles;
  tiles.reserve(size_t(count) * 3);
  for (int64_t x = 0; x < extent[0]; ++x)
    for (int64_t y = 0; y < extent[1]; ++y)
      for (int64_t z = 0; z < extent[2]; ++z)
        for (int64_t tile : {first[0] + x, first[1] + y, first[2] + z})
          tiles.push_back(int32_t(tile * 8));
  return tiles;
}
