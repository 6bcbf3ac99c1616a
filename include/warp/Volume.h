//===- Volume.h - Sparse volumes (NanoVDB) for kernels ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A grid of NanoVDB, which kernels sample by its `id`. Every offset and count
// is checked before; an `Error` says what is wrong.
//
//   Volume smoke(readGridsOf("smoke.nvdb"), cpuDevice);
//   double value[4];
//   smoke.sample({1.5, 2, 3}, Volume::Sampling::Linear, value);
//
//===----------------------------------------------------------------------===//

#ifndef WARP_VOLUME_H
#define WARP_VOLUME_H

#include "warp/Handle.h"
#include "warp/VoxelGrids.h"

namespace warp {

class WARP_API Volume {
public:
  enum class Sampling { Closest = 0, Linear = 1 };

  /// The first grid of some bytes, which are kept, or copied to the device.
  Volume(const GridBytes &grids, int device);
  /// A grid in memory of a device, which stays the caller's. No size: that of
  /// the one grid.
  Volume(void *grid, size_t bytes, int device);
  /// The same, where it is known what is there: nothing is read.
  Volume(void *grid, size_t bytes, int device, const GridBytes &contents);
  Volume(Volume &&) noexcept;
  ~Volume();

  uint64_t id() const;
  int device() const;
  /// The grid and those behind it, on the device.
  void *data() const;
  size_t size() const;
  /// Keeps that memory; null if it is the caller's.
  std::shared_ptr<void> memory() const;

  /// Takes another grid; the id stays. On a GPU, waits for work that may read
  /// the one before.
  void assign(const GridBytes &grids);
  /// Makes the grid again of other points, if it has no more nodes than there
  /// is room for; else gives bits of `RebuildStatus`, and nothing changes.
  uint32_t rebuild(const GridRecipe &recipe, const GridPoints &points,
                   const std::optional<GridCounts> &room = {});
  /// Reads what the grid says again, after kernels have written another one.
  void refresh();

  const GridInfo &info() const;
  /// Writes the lowest voxel of each leaf, or the voxels that have numbers in
  /// their order, three numbers each, and gives how many; at most `room`.
  int64_t tiles(int32_t *rows, int64_t room) const;
  int64_t voxels(int32_t *rows, int64_t room) const;
  GridFeature feature(int64_t index) const;
  /// The start of the next grid in this memory; 0 if this is the last.
  size_t next() const;
  void save(const std::string &path, GridCodec codec = GridCodec::None) const;

  /// Writes the components of a voxel's value, or of one at a point of index
  /// space, as kernels find it, in host memory; gives how many. Integers are
  /// not interpolated; of index grids it is the number, or -1.
  int lookup(const int32_t (&voxel)[3], double (&value)[4]) const;
  int sample(const double (&point)[3], Sampling how, double (&value)[4]) const;

private:
  struct Impl;
  std::unique_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_VOLUME_H
