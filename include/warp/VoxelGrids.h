//===- VoxelGrids.h - NanoVDB grids: construction and files -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Grids of NanoVDB, version 32, in host memory: read from files and written to
// them, made of points, voxels or dense values. `Volume` lets kernels read
// them. Whatever is wrong with a file is an `Error` of kind `Runtime`.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_VOXELGRIDS_H
#define WARP_VOXELGRIDS_H

#include "warp/Export.h"
#include "warp/Launch.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace warp {

/// Types of values, as files number them. Voxels of the index types have
/// numbers in place of values: all of them, or those that are active; masks
/// add bits to leaves.
enum class VoxelType : uint32_t {
  Float = 1,
  Double = 2,
  Int16 = 3,
  Int32 = 4,
  Int64 = 5,
  Vec3f = 6,
  Vec3d = 7,
  Half = 9,
  UInt32 = 10,
  Vec4f = 17,
  Vec4d = 18,
  Index = 19,
  OnIndex = 20,
  IndexMask = 21,
  OnIndexMask = 22,
  UInt8 = 26,
};

/// All types, and how each is called.
WARP_API const std::vector<std::pair<VoxelType, std::string>> &voxelTypes();
WARP_API std::string nameOf(VoxelType type);

enum class GridCodec : uint16_t { None = 0, Zip = 1, Blosc = 2 };

/// From index space to the world: a matrix, row by row, then a shift.
struct GridTransform {
  double matrix[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double shift[3] = {0, 0, 0};
};

/// The inverse of a matrix, row by row; of one without, numbers that are none.
WARP_API void invertMatrix(const double (&matrix)[9], double (&inverse)[9]);

/// Host memory for grids, one behind the other; copies share it.
class WARP_API GridBytes {
public:
  GridBytes() = default;
  /// Zeros.
  explicit GridBytes(size_t size);
  /// A copy.
  GridBytes(const void *bytes, size_t size);

  /// Memory of the caller's, without a copy.
  static GridBytes around(uint8_t *bytes, size_t size);

  uint8_t *data() const { return start.get(); }
  size_t size() const { return length; }
  const std::shared_ptr<uint8_t> &owner() const { return start; }
  /// Some of the bytes, in the same memory.
  GridBytes part(size_t from, size_t size) const;

private:
  std::shared_ptr<uint8_t> start;
  size_t length = 0;
};

/// The grids of a .nvdb file, checked. Grids whose voxels are numbers of a few
/// bits (Fp4, Fp8, Fp16, FpN) become grids of floats.
WARP_API GridBytes readGrids(const void *file, size_t bytes);
WARP_API GridBytes readGridsOf(const std::string &path);
/// The same for grids as they are in memory, which are copied.
WARP_API GridBytes copyGrids(const void *grids, size_t bytes);
/// Writes a .nvdb file; "zip" and "blosc" are packed, the latter with the
/// system's libblosc.
WARP_API void writeGrids(const std::string &path, const void *grids,
                         size_t bytes, GridCodec codec);
/// Raises for names that are none.
WARP_API GridCodec codecOf(const std::string &name);

/// Numbers of nodes by their levels, and of voxels that have a number.
struct GridCounts {
  int64_t leaves = 0, lowers = 0, uppers = 0, voxels = 0;
};

/// Why a grid has no room for others.
enum RebuildStatus : uint32_t {
  LeafCapacityExceeded = 1,
  LowerCapacityExceeded = 2,
  UpperCapacityExceeded = 4,
  VoxelCapacityExceeded = 8,
};

/// The source of a grid: an array of three int32 (voxels) or three floats
/// (points of the world). Points that are NaN, infinite, or have a zero in an
/// array of int32, which may be empty, are left out.
struct GridPoints {
  ArrayDescriptor points;
  bool areVoxels = true;
  ArrayDescriptor mask;
  int device = -1;
  /// The name in error messages.
  std::string name = "points";
};

/// How a grid follows from points.
struct GridRecipe {
  /// Voxels of points, which have numbers; else tiles of 8^3 voxels around
  /// them, of a type and with a value, in bytes.
  bool ofVoxels = false;
  VoxelType type = VoxelType::Float;
  std::vector<uint8_t> background;
  GridTransform transform;

  /// Bytes of a grid of so many nodes.
  WARP_API int64_t bytesFor(const GridCounts &counts) const;
  WARP_API GridBytes make(const GridPoints &points) const;
  /// The grid that has no voxels.
  WARP_API GridBytes makeEmpty() const;
};

/// Bits of `RebuildStatus` for what a grid has more of than there is room for.
WARP_API uint32_t missingRoom(const GridBytes &grid, const GridCounts &room);

/// The values of a packed array of three dimensions, z fastest.
struct DenseValues {
  const void *values;
  int64_t shape[3];
};
/// A grid of the recipe's type and transform, the first voxel at the origin.
WARP_API GridBytes makeDense(const GridRecipe &recipe,
                             const DenseValues &dense);

/// The lowest voxels of tiles that a box of voxels overlaps, three by three.
WARP_API std::vector<int32_t> tilesOfBox(const int64_t (&low)[3],
                                         const int64_t (&high)[3]);

/// The header of a grid.
struct GridInfo {
  std::string name;
  VoxelType type = VoxelType::Float;
  /// Voxels have numbers, and only those that are active.
  bool isIndex = false, ofActive = false;
  /// Its number among the grids of its memory, and how many there are.
  uint32_t index = 0, count = 1;
  uint64_t size = 0;
  GridTransform transform;
  double voxelSize[3] = {1, 1, 1};
  GridCounts counts;
  /// Arrays that are stored beside the grid.
  uint32_t features = 0;
  /// The start of leaves, their size, and where in it are values of which size.
  int64_t leavesAt = 0, leafSize = 0, leafTable = 0, valueSize = 0;
};

/// An array beside a grid, and where it is in the grid's bytes.
struct GridFeature {
  std::string name, type;
  int64_t at = 0, valueSize = 0, count = 0;
};

/// Offsets of nodes and their parts in bytes, for kernels that write grids.
struct GridLayout {
  int64_t rootAt, root, background, tile, tileValue;
  int64_t upper, upperTable, lower, lowerTable, entry, leaf, leafTable, value;
};
WARP_API GridLayout gridLayout(VoxelType type);

/// For kernels that write grids: numbers of words of four bytes, in a grid and
/// in what a handle leads to.
struct GridWords {
  int size, worldBox, tree;
  int slotLeaves, slotTiles, slotVoxels, slotLeavesEnd, slotNumbers;
  int slotLowest, slotExtent;
};
WARP_API GridWords gridWords();

/// Entries of the table by which kernels find leaves, for each leaf at most: a
/// word beside the 512 of its voxels.
inline constexpr int leafTableRoom = 16;

} // namespace warp

#endif // WARP_VOXELGRIDS_H
