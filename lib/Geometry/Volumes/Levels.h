//===- Levels.h - NanoVDB tree levels ---------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Grids come from files, so nothing in them is trusted: `Levels` finds the
// levels of nodes and throws if they are not within the bytes, `check` also
// follows every child, so that kernels need not look.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_VOLUMES_LEVELS_H
#define WARP_LIB_GEOMETRY_VOLUMES_LEVELS_H

#include "Layout.h"

#include "warp/Error.h"

#include <bit>
#include <vector>

namespace warp::geometry {

/// Nodes of one size.
struct Level {
  uint8_t *first = nullptr;
  int64_t at = 0, count = 0, size = 1;

  uint8_t *operator[](int64_t i) const { return first + i * size; }
  int64_t end() const { return at + count * size; }
};

Error broken(const std::string &why);

/// True if a text ends within its room.
template <size_t room> bool hasEnd(const char (&text)[room]) {
  return std::memchr(text, 0, room);
}

/// The header of the grid that some bytes begin with; throws if there is none,
/// or one of another version.
GridHeader headerOf(const uint8_t *grid, size_t bytes);
inline GridTree treeOf(const uint8_t *grid) {
  return load<GridTree>(grid + sizeof(GridHeader));
}

/// The header of the grid that some bytes begin with; only its header and its
/// tree have to be there.
GridInfo infoOf(const uint8_t *grid, size_t bytes);

class Levels {
public:
  /// For the grid that some bytes begin with.
  Levels(uint8_t *grid, size_t bytes);
  /// All but the leaves, which are as those of another type.
  Levels(uint8_t *grid, size_t bytes, VoxelType above);

  /// Follows every child.
  void check() const;
  /// Calls `visit(parent, place, offset of the child)` for children of a level.
  template <class Visit>
  void forChildren(const Level &parents, int64_t cells, int64_t table,
                   Visit &&visit) const;
  /// Behind the root and the inner nodes.
  int64_t endAbove() const;
  GridInfo info() const { return infoOf(grid, size_t(size)); }

  uint8_t *grid;
  int64_t size;
  GridHeader header;
  GridTree tree;
  GridLayout layout;
  int64_t rootAt;
  Level tiles, uppers, lowers, leaves;

private:
  void find(bool hasLeaves);
  void checkApart() const;
  Level level(int64_t at, int64_t count, int64_t nodeSize);
  void checkWithin(int64_t at, int64_t bytes, const char *what) const;
};

template <class Visit>
void Levels::forChildren(const Level &parents, int64_t cells, int64_t table,
                         Visit &&visit) const {
  for (int64_t parent = 0; parent < parents.count; ++parent) {
    const uint8_t *node = parents[parent];
    const uint8_t *children = node + sizeof(InnerHead) + cells / 8;
    int64_t at = parents.at + parent * parents.size;
    for (int64_t word = 0; word < cells / 64; ++word)
      for (auto bits = load<uint64_t>(children + 8 * word); bits;
           bits &= bits - 1) {
        int64_t place = 64 * word + std::countr_zero(bits);
        auto relative = load<int64_t>(node + table + place * layout.entry);
        int64_t child;
        if (__builtin_add_overflow(at, relative, &child))
          child = -1;
        visit(parent, place, child);
      }
  }
}

/// The grid that some bytes begin with, in which every child has been followed.
Levels checkedLevels(uint8_t *grid, size_t bytes);

/// Coordinates of the lowest voxel of a leaf, whose box may be that of its
/// active voxels alone.
inline int32_t lowestOf(const uint8_t *leaf, int axis) {
  return load<int32_t>(leaf + 4 * axis) & ~7;
}

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_VOLUMES_LEVELS_H
