//===- volume-fuzz-test.cpp - Damaged files are refused or read -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Whatever is flipped in a file or cut off from it, a grid is refused with an
// `Error`, or all its voxels can be asked for.
//
//===----------------------------------------------------------------------===//

#include "VolumeScenes.h"

#include "Geometry/Volumes/Levels.h"

#include "warp/Error.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>

using namespace scenes;
using namespace warp;

namespace {

std::vector<uint8_t> fileOf(const GridBytes &grid, GridCodec codec) {
  TemporaryFile file("fuzz.nvdb");
  writeGrids(file.path, grid.data(), grid.size(), codec);
  std::ifstream stream(file.path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// A file of a grid of Fp4: the nodes of a grid of floats over leaves whose
/// voxel n has the number n % 16, with the quantum 0.5 and the least value -1.
std::vector<uint8_t> quantisedFile() {
  constexpr int64_t leafSize = 96 + 256;
  GridBytes floats = makeDenseOf<float>(VoxelType::Float);
  geometry::Levels levels(floats.data(), floats.size());
  int64_t leafAt = levels.leaves.at;
  std::vector<uint8_t> file = fileOf(floats, GridCodec::None);
  file.resize(file.size() - floats.size());
  GridBytes grid(size_t(leafAt + levels.leaves.count * leafSize));
  std::memcpy(grid.data(), floats.data(), leafAt);
  for (int64_t i = 0; i < levels.leaves.count; ++i) {
    uint8_t *leaf = grid.data() + leafAt + i * leafSize;
    std::memcpy(leaf, levels.leaves[i], 80);
    const float scale[2] = {-1, 0.5};
    std::memcpy(leaf + 80, scale, sizeof scale);
    for (int n = 0; n < 512; n += 2)
      leaf[96 + n / 2] = uint8_t(n % 16 | (n + 1) % 16 << 4);
  }
  levels.forChildren(
      levels.lowers, geometry::lowerCells, levels.layout.lowerTable,
      [&](int64_t parent, int64_t place, int64_t child) {
        int64_t node = levels.lowers.at + parent * levels.lowers.size;
        int64_t i = (child - leafAt) / levels.leaves.size;
        geometry::store(grid.data() + node + levels.layout.lowerTable +
                            place * levels.layout.entry,
                        leafAt + i * leafSize - node);
      });
  auto header = geometry::load<geometry::GridHeader>(grid.data());
  header.type = 13;
  header.size = grid.size();
  geometry::store(grid.data(), header);
  // The file's sizes.
  const uint64_t sizes[2] = {grid.size(), grid.size()};
  std::memcpy(file.data() + 16, sizes, sizeof sizes);
  file.insert(file.end(), grid.data(), grid.data() + grid.size());
  return file;
}

/// Asks for voxels in and around the grid.
void ask(const GridBytes &grids) {
  Volume volume(grids, cpuDevice);
  double value[4];
  for (int i = -9; i < 30; i += 4)
    for (int k = -1; k < 40; k += 5) {
      volume.lookup({i, k / 2, k}, value);
      volume.sample({i + 0.3, 7.5, k + 0.8}, Volume::Sampling::Linear, value);
    }
  int32_t rows[30];
  volume.tiles(rows, 10);
  volume.voxels(rows, 10);
  for (uint32_t i = 0; i < std::min(volume.info().features, 3u); ++i)
    volume.feature(i);
}

/// Returns how many of the damaged files were read.
int fuzz(const std::vector<uint8_t> &file, int turns, uint32_t seed) {
  std::mt19937 random(seed);
  auto below = [&](size_t n) { return size_t(random() % n); };
  std::vector<uint8_t> damaged = file;
  int read = 0;
  for (int turn = 0; turn < turns; ++turn) {
    // Headers, the root and heads of nodes hold what leads anywhere.
    size_t range = turn % 2 ? std::min<size_t>(file.size(), 1400) : file.size();
    size_t places[3];
    for (size_t &place : places) {
      place = below(range);
      damaged[place] ^= 1 << below(8);
    }
    size_t size = turn % 16 ? file.size() : below(file.size());
    try {
      ask(readGrids(damaged.data(), size));
      ++read;
    } catch (const Error &) {
    }
    for (size_t place : places)
      damaged[place] = file[place];
  }
  return read;
}

GridBytes fewVoxels() {
  Voxels voxels = {{0, 0, 0}, {1, 2, 3}, {8, 8, 30}, {-1, 0, 0}, {9, 9, 9}};
  GridRecipe recipe;
  recipe.ofVoxels = true;
  return recipe.make(pointsOf(voxels));
}

} // namespace

TEST(VolumeFuzz, QuantisedGridsAreWhatTheyWere) {
  std::vector<uint8_t> file = quantisedFile();
  Volume volume(readGrids(file.data(), file.size()), cpuDevice);
  double value[4];
  for (int n = 0; n < 512; ++n) {
    volume.lookup({n >> 6, n >> 3 & 7, 8 + (n & 7)}, value);
    ASSERT_EQ(value[0], n % 16 * 0.5 - 1);
  }
}

TEST(VolumeFuzz, HundredThousandMutations) {
  struct Case {
    std::vector<uint8_t> file;
    int turns;
  };
  GridBytes dense = makeDenseOf<float>(VoxelType::Float);
  const Case cases[] = {{fileOf(dense, GridCodec::None), 40000},
                        {fileOf(fewVoxels(), GridCodec::None), 30000},
                        {quantisedFile(), 20000},
                        {fileOf(dense, GridCodec::Zip), 10000}};
  uint32_t seed = 1;
  for (const Case &one : cases) {
    int read = fuzz(one.file, one.turns, seed++);
    EXPECT_GT(read, 0);
    EXPECT_LT(read, one.turns);
  }
}
