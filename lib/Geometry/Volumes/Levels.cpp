//===- Levels.cpp - Consistency checks of a grid --------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Levels.h"

#include <algorithm>

using namespace warp;
using namespace warp::geometry;

Error warp::geometry::broken(const std::string &why) {
  return Error(Error::Kind::Runtime,
               "Invalid NanoVDB grid structure, the grid is damaged: " + why);
}

GridHeader warp::geometry::headerOf(const uint8_t *grid, size_t bytes) {
  if (bytes < size_t(headSize))
    throw broken("it has " + std::to_string(bytes) +
                 " bytes, fewer than a grid's header");
  auto header = load<GridHeader>(grid);
  if (header.magic != gridMagics[0] && header.magic != gridMagics[1])
    throw Error(Error::Kind::Runtime,
                "this is no NanoVDB grid: its signature is missing");
  if (header.version >> 21 != majorVersion)
    throw Error(Error::Kind::Runtime,
                "a NanoVDB grid of version " +
                    std::to_string(header.version >> 21) + ", but " +
                    std::to_string(majorVersion) + " is supported");
  if (!hasEnd(header.name))
    throw broken("its name has no end");
  return header;
}

static GridHeader sizedHeader(const uint8_t *grid, size_t bytes) {
  GridHeader header = headerOf(grid, bytes);
  if (header.size < uint64_t(headSize) || header.size > bytes)
    throw broken("it says it has " + std::to_string(header.size) +
                 " bytes, but there are " + std::to_string(bytes));
  return header;
}

Levels::Levels(uint8_t *grid, size_t bytes)
    : grid(grid), header(sizedHeader(grid, bytes)), tree(treeOf(grid)),
      layout(gridLayout(VoxelType(header.type))) {
  find(true);
}

Levels::Levels(uint8_t *grid, size_t bytes, VoxelType above)
    : grid(grid), header(sizedHeader(grid, bytes)), tree(treeOf(grid)),
      layout(gridLayout(above)) {
  find(false);
}

void Levels::checkWithin(int64_t at, int64_t bytes, const char *what) const {
  if (at < 0 || at % 8 || at > size || bytes > size - at)
    throw broken("its " + std::string(what) + " is not within its " +
                 std::to_string(size) + " bytes");
}

Level Levels::level(int64_t at, int64_t count, int64_t nodeSize) {
  // A level without nodes needs no offset.
  if (count == 0)
    at = size;
  checkWithin(at, count * nodeSize, "level of nodes");
  return {grid + at, at, count, nodeSize};
}

void Levels::find(bool hasLeaves) {
  size = int64_t(header.size);
  int64_t offsets[4];
  for (int i = 0; i < 4; ++i)
    if (__builtin_add_overflow(tree.offsets[i], int64_t(sizeof(GridHeader)),
                               &offsets[i]))
      offsets[i] = -1;
  auto [leafAt, lowerAt, upperAt, rootOffset] = offsets;
  rootAt = rootOffset;
  checkWithin(rootAt, layout.root, "root");
  tiles = level(rootAt + layout.root, load<uint32_t>(grid + rootAt + 24),
                layout.tile);
  uppers = level(upperAt, tree.counts[2], layout.upper);
  lowers = level(lowerAt, tree.counts[1], layout.lower);
  leaves = {nullptr, leafAt, 0, layout.leaf};
  if (hasLeaves)
    leaves = level(leafAt, tree.counts[0], layout.leaf);
  checkApart();
}

/// No byte belongs to two levels, nor to what is beside the grid.
void Levels::checkApart() const {
  struct Region {
    int64_t begin, end;
  };
  std::vector<Region> regions = {{rootAt, tiles.end()}};
  for (const Level *level : {&uppers, &lowers, &leaves})
    if (level->count)
      regions.push_back({level->at, level->end()});
  std::sort(regions.begin(), regions.end(),
            [](Region a, Region b) { return a.begin < b.begin; });
  for (size_t i = 1; i < regions.size(); ++i)
    if (regions[i].begin < regions[i - 1].end)
      throw broken("two of its levels of nodes overlap");
  // Grids without arrays may tell no place of them.
  if (header.blindOffset > 0 && header.blindOffset < regions.back().end)
    throw broken("its arrays overlap its nodes");
}

int64_t Levels::endAbove() const {
  int64_t end = tiles.end();
  for (const Level *level : {&uppers, &lowers})
    if (level->count)
      end = std::max(end, level->end());
  return end;
}

static void checkChild(int64_t child, const Level &below, const char *what) {
  if (child < below.at || child >= below.end() ||
      (child - below.at) % below.size)
    throw broken("a child of its " + std::string(what) +
                 " is not one of its nodes");
}

void Levels::check() const {
  for (int64_t i = 0; i < tiles.count; ++i)
    if (auto relative = load<int64_t>(tiles[i] + 8)) {
      int64_t child;
      if (__builtin_add_overflow(rootAt, relative, &child))
        child = -1;
      checkChild(child, uppers, "root");
    }
  forChildren(uppers, upperCells, layout.upperTable,
              [&](int64_t, int64_t, int64_t child) {
                checkChild(child, lowers, "inner node");
              });
  forChildren(lowers, lowerCells, layout.lowerTable,
              [&](int64_t, int64_t, int64_t child) {
                checkChild(child, leaves, "inner node");
              });
  if (!isOfActive(header.type))
    return;
  uint64_t numbered = 0;
  for (int64_t i = 0; i < leaves.count; ++i)
    for (uint64_t word : load<LeafHead>(leaves[i]).values)
      numbered += std::popcount(word);
  // Tiles that are active have numbers, too.
  if (numbered > tree.voxels || tree.voxels >= uint64_t(1) << 31)
    throw broken(std::to_string(numbered) +
                 " voxels of its leaves are active, which is not what it says");
}

Levels warp::geometry::checkedLevels(uint8_t *grid, size_t bytes) {
  Levels levels(grid, bytes);
  levels.check();
  return levels;
}

GridInfo warp::geometry::infoOf(const uint8_t *grid, size_t bytes) {
  GridHeader header = headerOf(grid, bytes);
  GridTree tree = treeOf(grid);
  GridLayout layout = gridLayout(VoxelType(header.type));
  GridInfo info;
  info.name =
      std::string(header.name, strnlen(header.name, sizeof header.name));
  info.type = VoxelType(header.type);
  info.isIndex = isIndex(header.type);
  info.ofActive = isOfActive(header.type);
  info.index = header.index;
  info.count = header.count;
  info.size = header.size;
  std::copy_n(header.matrix, 9, info.transform.matrix);
  std::copy_n(header.shift, 3, info.transform.shift);
  std::copy_n(header.voxelSize, 3, info.voxelSize);
  int64_t leafCount = tree.counts[0];
  info.counts = {leafCount, tree.counts[1], tree.counts[2],
                 info.ofActive ? int64_t(tree.voxels) : leafCount * leafCells};
  info.features = header.blindCount;
  info.leavesAt = int64_t(sizeof header) + tree.offsets[0];
  info.leafSize = layout.leaf;
  info.leafTable = layout.leafTable;
  info.valueSize = layout.value;
  return info;
}
