//===- Layout.h - NanoVDB memory layout -------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A grid is a header, a tree, a root with a table of tiles, then upper nodes of
// 32^3 children, lower nodes of 16^3 and leaves of 8^3 voxels, each aligned to
// 32 bytes. Offsets of values follow from their size and alignment as C++ lays
// out the structs of the format.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_LAYOUT_H
#define WARP_LIB_GEOMETRY_VOLUMES_LAYOUT_H

#include "warp/VoxelGrids.h"

#include <cstring>

namespace warp::geometry {

inline constexpr uint64_t gridMagics[] = {0x304244566F6E614E,
                                          0x314244566F6E614E};
inline constexpr uint32_t majorVersion = 32;
/// A flag of headers: nodes of a level follow each other.
inline constexpr uint32_t isBreadthFirst = 1 << 5;
inline constexpr int64_t gridAlignment = 32;
inline constexpr uint32_t writtenVersion = majorVersion << 21 | 3 << 10 | 3;

struct GridHeader {
  uint64_t magic, checksum;
  uint32_t version, flags, index, count;
  uint64_t size;
  char name[256];
  float single[9], singleInverse[9], singleShift[3], singleTaper;
  double matrix[9], inverse[9], shift[3], taper;
  double worldBox[6], voxelSize[3];
  uint32_t gridClass, type;
  int64_t blindOffset;
  uint32_t blindCount, data;
  uint64_t data1, data2;
};
static_assert(sizeof(GridHeader) == 672);

/// Offsets of leaves, lower nodes, upper nodes and the root from the tree on.
struct GridTree {
  int64_t offsets[4];
  uint32_t counts[3], tileCounts[3];
  uint64_t voxels;
};
static_assert(sizeof(GridTree) == 64);

/// An array beside a grid; its offset counts from here.
struct BlindArray {
  int64_t offset;
  uint64_t count;
  uint32_t size, semantic, dataClass, type;
  char name[256];
};
static_assert(sizeof(BlindArray) == 288);

/// The header of inner nodes and leaves.
struct InnerHead {
  int32_t box[6];
  uint64_t flags;
};
static_assert(sizeof(InnerHead) == 32);
struct LeafHead {
  int32_t origin[3];
  uint8_t extent[3], flags;
  uint64_t values[8];
};
static_assert(sizeof(LeafHead) == 80);
/// For index grids: the first number, and seven numbers of nine bits, voxels
/// before the words of the mask but the first.
struct LeafNumbers {
  uint64_t first, sums;
};

inline constexpr int64_t headSize = sizeof(GridHeader) + sizeof(GridTree);
inline constexpr int64_t upperCells = 32 * 32 * 32, lowerCells = 16 * 16 * 16;
inline constexpr int64_t leafCells = 512;

/// Values of a type.
struct ValueFacts {
  enum class Scalar { Float, Double, Int16, Int32, Int64, Half, UInt32, UInt8 };
  VoxelType type;
  const char *name;
  int size, align, mean;
  Scalar scalar;
  int components;
};

/// Null for types that are not supported.
const ValueFacts *factsOf(uint32_t type);
inline bool isIndex(uint32_t type) { return type >= 19 && type <= 22; }
inline bool isOfActive(uint32_t type) { return type == 20 || type == 22; }

/// Reads a value at an address that may not be aligned for it.
template <class T> T load(const void *at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

template <class T> void store(void *at, const T &value) {
  std::memcpy(at, &value, sizeof value);
}

inline int64_t roundUp(int64_t n, int64_t to) { return (n + to - 1) / to * to; }

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_LAYOUT_H
