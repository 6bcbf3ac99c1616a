//===- grid-test.cpp - GPU grids of launches ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// No driver is asked: a grid follows from the schedule and the extents.
//
//===----------------------------------------------------------------------===//

#include "Runtime/Grid.h"
#include "Runtime/KernelImpl.h"

#include <gtest/gtest.h>
#include <string>

using namespace warp;

namespace {

LaunchDim dims(std::initializer_list<int64_t> extents) {
  LaunchDim dim;
  dim.rank = int(extents.size());
  std::copy(extents.begin(), extents.end(), dim.extent);
  return dim;
}

std::string textOf(const Extent &extent) {
  return "(" + std::to_string(extent.x) + ", " + std::to_string(extent.y) +
         ", " + std::to_string(extent.z) + ")";
}

std::string textOf(const Grid &grid) {
  return textOf(grid.blocks) + " x " + textOf(grid.block);
}

std::string gridOf(const Schedule &schedule,
                   std::initializer_list<int64_t> extents, bool flat = false,
                   int blockDim = 256) {
  return textOf(gridFor(schedule, dims(extents), blockDim, flat));
}

constexpr int64_t large = int64_t(1) << 31;

TEST(Grid, OneThreadTakesOneIndex) {
  EXPECT_EQ(gridOf({}, {0}), "(0, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {1}), "(1, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {255}), "(1, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {256}), "(1, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {257}), "(2, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {large}), "(8388608, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {large}, false, 1), "(2147483648, 1, 1) x (1, 1, 1)");
}

TEST(Grid, BlocksAreWideWhereTheLaunchIs) {
  EXPECT_EQ(gridOf({}, {64, 1024}), "(32, 8, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf({}, {64, 40}), "(1, 16, 1) x (40, 4, 1)");
  EXPECT_EQ(gridOf({}, {2, 100000}), "(782, 1, 1) x (128, 2, 1)");
  EXPECT_EQ(gridOf({}, {5, 1, 1}), "(1, 1, 1) x (32, 1, 8)");
  EXPECT_EQ(gridOf({}, {0, 0}), "(0, 0, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {10, 10, 10, 10}, true), "(40, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf({}, {10, 10, 10}, true, 64), "(16, 1, 1) x (64, 1, 1)");
}

/// Blocks by powers of two would have 17 of 32, or 3 of 4, threads at work.
TEST(Grid, BlocksTakeWholeRowsWhereThreadsWouldBeIdle) {
  EXPECT_EQ(gridOf({}, {8192, 17}), "(1, 547, 1) x (17, 15, 1)");
  EXPECT_EQ(gridOf({}, {100000, 3}), "(1, 1563, 1) x (3, 64, 1)");
  EXPECT_EQ(gridOf({}, {64, 33}), "(1, 11, 1) x (33, 6, 1)");
  EXPECT_EQ(gridOf({}, {8192, 17, 3}), "(1, 1, 1639) x (3, 17, 5)");
  EXPECT_EQ(gridOf({}, {9, 1000, 5}), "(1, 20, 9) x (5, 51, 1)");
  // A power of two, a row that is almost one, and few indices.
  EXPECT_EQ(gridOf({}, {8192, 16}), "(1, 512, 1) x (16, 16, 1)");
  EXPECT_EQ(gridOf({}, {8192, 31}), "(1, 1024, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf({}, {3, 17}), "(1, 1, 1) x (64, 4, 1)");
  // Threads that wait for each other, or have several indices.
  Schedule fixed, several;
  fixed.fixedBlock = true;
  several.coarsening = 4;
  EXPECT_EQ(gridOf(fixed, {8192, 17}), "(1, 1024, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(several, {8192, 17}), "(1, 256, 1) x (32, 8, 1)");
}

/// No block has more threads than the launch asks for, all indices have one,
/// and the grid keeps within what a driver takes.
TEST(Grid, BlocksCoverLaunchesOfAnyExtents) {
  for (int64_t x = 1; x < 300; x += 7)
    for (int64_t y : {1, 2, 13, 1000})
      for (int64_t z : {1, 3, 77})
        for (int threads : {1, 32, 64, 96, 256, 1024}) {
          Grid grid = gridFor({}, dims({z, y, x}), threads, /*flat=*/false);
          EXPECT_LE(grid.block.count(), threads);
          EXPECT_LE(grid.block.z, 64);
          EXPECT_GE(grid.blocks.x * grid.block.x, x);
          EXPECT_GE(grid.blocks.y * grid.block.y, y);
          EXPECT_GE(grid.blocks.z * grid.block.z, z);
        }
}

TEST(Grid, ThreadsTakeSeveralIndices) {
  Schedule stream;
  stream.coarsening = 4;
  EXPECT_EQ(gridOf(stream, {0}), "(0, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf(stream, {1}), "(1, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf(stream, {1023}), "(1, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf(stream, {1025}), "(2, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(coarsenedThreads(stream, dims({1025})), 257);
  EXPECT_EQ(coarsenedThreads(stream, dims({large - 1})), large / 4);
  Schedule patches;
  patches.coarsening = 8;
  patches.rowCoarsening = 2;
  EXPECT_EQ(gridOf(patches, {64, 10, 40}), "(1, 2, 16) x (64, 4, 1)");
  EXPECT_EQ(gridOf(patches, {64, 1, 40}), "(1, 1, 4) x (64, 1, 4)");
  EXPECT_EQ(coarsenedThreads(patches, dims({65, 9, 40})), 17 * 5 * 40);
}

TEST(Grid, ThreadsShareAnIndex) {
  Schedule split;
  split.splitReduction = 8;
  EXPECT_EQ(gridOf(split, {1}), "(1, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(split, {1000}), "(32, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(split, {1024}), "(32, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(split, {1025}), "(33, 1, 1) x (32, 8, 1)");
}

TEST(Grid, BlocksStageTiles) {
  Schedule tiles;
  tiles.transposeTile = 32;
  EXPECT_EQ(gridOf(tiles, {1, 1}), "(1, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(tiles, {100, 70}), "(12, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(tiles, {5, 32, 33}), "(10, 1, 1) x (32, 8, 1)");
  EXPECT_EQ(gridOf(tiles, {5, 0, 33}), "(0, 1, 1) x (32, 8, 1)");
}

TEST(Grid, BlocksWorkTogetherAndMerge) {
  Schedule merged;
  merged.cooperative = merged.fixedBlock = true;
  merged.blockCoarsening = 4;
  EXPECT_EQ(gridOf(merged, {5, 8, 256}), "(10, 1, 1) x (256, 1, 1)");
  EXPECT_EQ(gridOf(merged, {8, 256}), "(2, 1, 1) x (256, 1, 1)");
  merged.blockCoarsening = 1;
  EXPECT_EQ(gridOf(merged, {8, 256}), "(8, 1, 1) x (256, 1, 1)");
}

TEST(Grid, OneBlockTakesAll) {
  Schedule single;
  single.singleBlock = 64;
  EXPECT_EQ(gridOf(single, {1}), "(1, 1, 1) x (64, 1, 1)");
  EXPECT_EQ(gridOf(single, {large - 1, 7}), "(1, 1, 1) x (64, 1, 1)");
}

TEST(Grid, AxesHaveLimits) {
  auto fits = [](std::initializer_list<int64_t> extents, int blockDim = 256) {
    return fitsGrid(dims(extents), blockDim);
  };
  EXPECT_TRUE(fits({INT32_MAX}));
  EXPECT_TRUE(fits({500000, 1000}));
  EXPECT_FALSE(fits({INT32_MAX, 1000}));
  EXPECT_TRUE(fits({65535, 8, 32}));
  EXPECT_FALSE(fits({65536, 8, 32}));
  EXPECT_FALSE(fits({1, 1, 1, 1}));
  // Blocks of half as many threads need twice as many rows of blocks.
  EXPECT_TRUE(fits({16000000, 1}));
  EXPECT_FALSE(fits({16000000, 1}, 128));
  DeviceLimits narrow;
  narrow.gridX = 1000;
  narrow.blockZ = 2;
  EXPECT_TRUE(gridFor({}, dims({256000}), 256, false).fits(narrow));
  EXPECT_FALSE(gridFor({}, dims({256001}), 256, false).fits(narrow));
  EXPECT_EQ(textOf(gridFor({}, dims({8, 1, 1}), 256, false, narrow)),
            "(1, 1, 4) x (128, 1, 2)");
}

} // namespace
