//===- Contents.h - Contents of a grid --------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_CONTENTS_H
#define WARP_LIB_GEOMETRY_VOLUMES_CONTENTS_H

#include "Levels.h"

#include "DeviceLib/geometry/Volume.h"

namespace warp::geometry {

/// The numbers of leaves in the box around all of them, x slowest; none where
/// the box has much more room than there are leaves.
struct LeafTable {
  explicit LeafTable(const Levels &levels);

  std::vector<uint32_t> numbers;
  int32_t lowest[3] = {};
  uint32_t extent[3] = {};
};

/// The parts of a grid that kernels find at an address of its device.
VolumeSlot slotOf(const Levels &levels, const uint8_t *address,
                  const LeafTable &table, const uint32_t *numbersAt);

/// See `Volume`.
int64_t listTiles(const Levels &levels, int32_t *rows, int64_t room);
int64_t listVoxels(const Levels &levels, int32_t *rows, int64_t room);
std::vector<GridFeature> featuresOf(const Levels &levels);

/// The components of a value at an address.
int readValue(const ValueFacts &facts, const uint8_t *at, double (&value)[4]);
/// The value of a voxel; the number of a voxel of an index grid, or -1.
int readVoxel(const VolumeSlot &volume, const int32_t (&voxel)[3],
              double (&value)[4]);
/// True if values between voxels are interpolated.
inline bool isInterpolated(VoxelType type) {
  return type == VoxelType::Float || type == VoxelType::Double ||
         type == VoxelType::Half || type == VoxelType::Vec3f ||
         type == VoxelType::Vec3d || type == VoxelType::Vec4f ||
         type == VoxelType::Vec4d;
}
/// The nearest number of 32 bits; 0 for what is none.
inline int32_t voxelAt(double x) {
  if (x != x)
    return 0;
  return x < -2147483648.0  ? INT32_MIN
         : x > 2147483647.0 ? INT32_MAX
                            : int32_t(x);
}
int sampleLinear(const VolumeSlot &volume, const double (&point)[3],
                 double (&value)[4]);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_CONTENTS_H
