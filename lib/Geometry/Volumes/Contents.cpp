//===- Contents.cpp - Contents of a grid ----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Contents.h"

#include <algorithm>
#include <cmath>

using namespace warp;
using namespace warp::geometry;

LeafTable::LeafTable(const Levels &levels) {
  const Level &leaves = levels.leaves;
  if (!leaves.count)
    return;
  int64_t low[3], high[3];
  for (int axis = 0; axis < 3; ++axis)
    low[axis] = high[axis] = lowestOf(leaves[0], axis) >> 3;
  for (int64_t i = 1; i < leaves.count; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      int64_t place = lowestOf(leaves[i], axis) >> 3;
      low[axis] = std::min(low[axis], place);
      high[axis] = std::max(high[axis], place);
    }
  double entries = 1;
  for (int axis = 0; axis < 3; ++axis)
    entries *= double(high[axis] - low[axis] + 1);
  if (entries > leafTableRoom * double(leaves.count))
    return;
  for (int axis = 0; axis < 3; ++axis) {
    lowest[axis] = int32_t(low[axis]);
    extent[axis] = uint32_t(high[axis] - low[axis] + 1);
  }
  numbers.assign(size_t(entries), noLeaf);
  for (int64_t i = 0; i < leaves.count; ++i) {
    int64_t place = 0;
    for (int axis = 0; axis < 3; ++axis)
      place =
          place * extent[axis] + (lowestOf(leaves[i], axis) >> 3) - low[axis];
    numbers[place] = uint32_t(i);
  }
}

VolumeSlot warp::geometry::slotOf(const Levels &levels, const uint8_t *address,
                                  const LeafTable &table,
                                  const uint32_t *numbersAt) {
  const GridLayout &layout = levels.layout;
  VolumeSlot slot{};
  slot.grid = address;
  slot.root = address + levels.rootAt;
  slot.leaves = address + levels.leaves.at;
  slot.leavesEnd = address + levels.leaves.end();
  slot.type = levels.header.type;
  slot.tiles = u32(levels.tiles.count);
  slot.voxels = u64(levels.info().counts.voxels);
  slot.background = u32(layout.background);
  slot.rootSize = u32(layout.root);
  slot.tileSize = u32(layout.tile);
  slot.tileValue = u32(layout.tileValue);
  slot.upperTable = u32(layout.upperTable);
  slot.lowerTable = u32(layout.lowerTable);
  slot.tableStride = u32(layout.entry);
  slot.leafTable = u32(layout.leafTable);
  slot.valueSize = u32(layout.value);
  slot.leafSize = u32(layout.leaf);
  if (!table.numbers.empty()) {
    slot.numbers = numbersAt;
    std::copy_n(table.lowest, 3, slot.lowest);
    std::copy_n(table.extent, 3, slot.extent);
  }
  return slot;
}

GridWords warp::gridWords() {
  auto word = [](size_t at) { return int(at / 4); };
  return {word(offsetof(GridHeader, size)),
          word(offsetof(GridHeader, worldBox)),
          word(sizeof(GridHeader)),
          word(offsetof(VolumeSlot, leaves)),
          word(offsetof(VolumeSlot, tiles)),
          word(offsetof(VolumeSlot, voxels)),
          word(offsetof(VolumeSlot, leavesEnd)),
          word(offsetof(VolumeSlot, numbers)),
          word(offsetof(VolumeSlot, lowest)),
          word(offsetof(VolumeSlot, extent))};
}

int64_t warp::geometry::listTiles(const Levels &levels, int32_t *rows,
                                  int64_t room) {
  int64_t count = std::min(levels.leaves.count, room);
  for (int64_t i = 0; i < count; ++i)
    for (int axis = 0; axis < 3; ++axis)
      rows[3 * i + axis] = lowestOf(levels.leaves[i], axis);
  return count;
}

int64_t warp::geometry::listVoxels(const Levels &levels, int32_t *rows,
                                   int64_t room) {
  bool isAll = !isOfActive(levels.header.type);
  int64_t count = 0;
  for (int64_t i = 0; i < levels.leaves.count; ++i) {
    auto head = load<LeafHead>(levels.leaves[i]);
    for (int n = 0; n < leafCells; ++n) {
      if (!isAll && !(head.values[n >> 6] >> (n & 63) & 1))
        continue;
      if (count == room)
        return count;
      int32_t *row = rows + 3 * count++;
      row[0] = (head.origin[0] & ~7) + (n >> 6);
      row[1] = (head.origin[1] & ~7) + (n >> 3 & 7);
      row[2] = (head.origin[2] & ~7) + (n & 7);
    }
  }
  return count;
}

/// Types of arrays, some of which are no types of grids.
static std::string arrayTypeName(uint32_t type) {
  switch (type) {
  case 11:
    return "bool";
  case 24:
    return "Vec3u8";
  case 25:
    return "Vec3u16";
  default:
    return nameOf(VoxelType(type));
  }
}

static GridFeature featureOf(const Levels &levels, int64_t index) {
  int64_t at, data, length, size = levels.size;
  int64_t about = int64_t(sizeof(BlindArray));
  if (__builtin_add_overflow(levels.header.blindOffset, index * about, &at) ||
      at < 0 || at > size - about)
    throw broken("feature arrays are not within it");
  auto array = load<BlindArray>(levels.grid + at);
  if (__builtin_add_overflow(at, array.offset, &data) ||
      __builtin_mul_overflow(array.count, array.size, &length) || data < 0 ||
      data > size || length < 0 || length > size - data)
    throw broken("a feature array is not within it");
  if (!hasEnd(array.name))
    throw broken("the name of a feature array has no end");
  return {std::string(array.name), arrayTypeName(array.type), data,
          int64_t(array.size), int64_t(array.count)};
}

std::vector<GridFeature> warp::geometry::featuresOf(const Levels &levels) {
  std::vector<GridFeature> all;
  for (int64_t i = 0; i < int64_t(levels.header.blindCount); ++i)
    all.push_back(featureOf(levels, i));
  return all;
}

template <class T>
static void readScalars(const uint8_t *at, int count, double (&value)[4]) {
  for (int i = 0; i < count; ++i)
    value[i] = double(load<T>(at + i * sizeof(T)));
}

int warp::geometry::readValue(const ValueFacts &facts, const uint8_t *at,
                              double (&value)[4]) {
  using Scalar = ValueFacts::Scalar;
  int count = facts.components;
  switch (facts.scalar) {
  case Scalar::Float:
    readScalars<float>(at, count, value);
    break;
  case Scalar::Double:
    readScalars<double>(at, count, value);
    break;
  case Scalar::Int16:
    readScalars<int16_t>(at, count, value);
    break;
  case Scalar::Int32:
    readScalars<int32_t>(at, count, value);
    break;
  case Scalar::Int64:
    readScalars<int64_t>(at, count, value);
    break;
  case Scalar::Half:
    readScalars<_Float16>(at, count, value);
    break;
  case Scalar::UInt32:
    readScalars<uint32_t>(at, count, value);
    break;
  case Scalar::UInt8:
    readScalars<uint8_t>(at, count, value);
    break;
  }
  return count;
}

static int readPlace(const VolumeSlot &volume, VoxelPlace place, Voxel voxel,
                     double (&value)[4]) {
  if (isIndex(volume.type)) {
    value[0] = indexAt(volume, place, voxel);
    return 1;
  }
  return readValue(*factsOf(volume.type), valueAt(volume, place, voxel), value);
}

int warp::geometry::readVoxel(const VolumeSlot &volume,
                              const int32_t (&voxel)[3], double (&value)[4]) {
  Voxel at{voxel[0], voxel[1], voxel[2]};
  return readPlace(volume, findVoxel(volume, at), at, value);
}

int warp::geometry::sampleLinear(const VolumeSlot &volume,
                                 const double (&point)[3], double (&value)[4]) {
  double cell[3], weights[3][2];
  for (int axis = 0; axis < 3; ++axis) {
    cell[axis] = std::floor(point[axis]);
    weights[axis][1] = point[axis] - cell[axis];
    weights[axis][0] = 1 - weights[axis][1];
  }
  std::fill_n(value, 4, 0.0);
  int count = 0;
  forCorners(volume, {voxelAt(cell[0]), voxelAt(cell[1]), voxelAt(cell[2])},
             [&](u32 corner, VoxelPlace place, Voxel voxel) {
               double found[4];
               count = readPlace(volume, place, voxel, found);
               double weight = weights[0][corner >> 2 & 1] *
                               weights[1][corner >> 1 & 1] *
                               weights[2][corner & 1];
               for (int i = 0; i < count; ++i)
                 value[i] += weight * found[i];
             });
  return count;
}
