//===- volume-test.cpp - Volumes made, read and written by C++ ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "VolumeScenes.h"

#include "warp/Error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

using namespace scenes;
using namespace warp;
using testing::HasSubstr;
using testing::ThrowsMessage;

namespace {

double lookUp(const Volume &volume, int i, int j, int k) {
  double value[4];
  volume.lookup({i, j, k}, value);
  return value[0];
}

double sampleAt(const Volume &volume, double x, double y, double z,
                Volume::Sampling how = Volume::Sampling::Linear) {
  double value[4];
  volume.sample({x, y, z}, how, value);
  return value[0];
}

void expectDense(const Volume &volume) {
  for (int i = -1; i < 12; ++i)
    for (int j = -1; j < 12; ++j)
      for (int k = -1; k < 26; ++k) {
        bool isInside = i >= 0 && j >= 0 && k >= 0 && i < 10 && j < 9 && k < 21;
        ASSERT_EQ(lookUp(volume, i, j, k), isInside ? valueAt(i, j, k) : -7.0)
            << i << ' ' << j << ' ' << k;
      }
}

} // namespace

TEST(Volume, DenseValuesAreFoundWhereTheyWere) {
  Volume volume(makeDenseOf<float>(VoxelType::Float), cpuDevice);
  expectDense(volume);
  expectDense(Volume(makeDenseOf<double>(VoxelType::Double), cpuDevice));
  expectDense(Volume(makeDenseOf<int32_t>(VoxelType::Int32), cpuDevice));
  expectDense(Volume(makeDenseOf<int64_t>(VoxelType::Int64), cpuDevice));
  const GridInfo &info = volume.info();
  EXPECT_EQ(nameOf(info.type), "float");
  EXPECT_EQ(info.counts.leaves, 2 * 2 * 3);
  EXPECT_EQ(info.voxelSize[0], 0.5);
  EXPECT_EQ(info.transform.shift[1], 2);
  EXPECT_EQ(describeHandle(volume.id(), GeometryKind::Volume, cpuDevice), "");
}

// A linear function is interpolated exactly; integers are those of the nearest
// voxel, half a voxel away from zero.
TEST(Volume, SamplesOnTheHost) {
  Volume volume(makeDenseOf<float>(VoxelType::Float), cpuDevice);
  EXPECT_DOUBLE_EQ(sampleAt(volume, 7.25, 3.5, 7.75),
                   valueAt(0, 0, 0) + 7.25 + 35 + 775);
  EXPECT_EQ(sampleAt(volume, 7.5, 3.2, 6.9, Volume::Sampling::Closest),
            valueAt(8, 3, 7));
  EXPECT_EQ(sampleAt(volume, 1e30, -1e30, 0), -7);
  EXPECT_TRUE(std::isnan(sampleAt(volume, 1, 1, NAN)));
  Volume integers(makeDenseOf<int32_t>(VoxelType::Int32), cpuDevice);
  EXPECT_EQ(sampleAt(integers, 2.5, 3.2, 6.9), valueAt(3, 3, 7));
  double value[4];
  auto recipe = recipeOf(VoxelType::Vec3d, std::array{1.0, 2.0, 3.0});
  Voxels none;
  Volume vectors(recipe.make(pointsOf(none)), cpuDevice);
  EXPECT_EQ(vectors.lookup({5, 5, 5}, value), 3);
  EXPECT_EQ(value[2], 3);
}

TEST(Volume, VoxelsOfPointsHaveNumbersInTheirOrder) {
  std::mt19937 random(1);
  std::uniform_int_distribution<int32_t> near(-20, 20), far(-9000, 9000);
  Voxels voxels;
  for (int i = 0; i < 500; ++i)
    voxels.push_back({near(random), near(random), near(random)});
  for (int i = 0; i < 30; ++i)
    voxels.push_back({far(random), far(random), far(random)});
  GridRecipe recipe;
  recipe.ofVoxels = true;
  Volume volume(recipe.make(pointsOf(voxels)), cpuDevice);
  std::sort(voxels.begin(), voxels.end());
  voxels.erase(std::unique(voxels.begin(), voxels.end()), voxels.end());
  auto count = int64_t(voxels.size());
  ASSERT_EQ(volume.info().counts.voxels, count);
  Voxels listed(voxels.size());
  EXPECT_EQ(volume.voxels(listed[0].data(), count), count);
  for (int64_t i = 0; i < count; ++i)
    EXPECT_EQ(lookUp(volume, listed[i][0], listed[i][1], listed[i][2]), i);
  std::sort(listed.begin(), listed.end());
  EXPECT_EQ(listed, voxels);
  EXPECT_EQ(lookUp(volume, 100, 100, 100), -1);
  EXPECT_EQ(int64_t(volume.size()), recipe.bytesFor(volume.info().counts));
}

TEST(Volume, PointsOfTheWorldAreInTilesAroundThem) {
  std::vector<std::array<float, 3>> points = {
      {0, 0, 0}, {NAN, 0, 0}, {5, 5, 5}, {INFINITY, 1, 1}, {-3.76f, 2, 3}};
  std::vector<int32_t> mask = {1, 1, 0, 1, 1};
  GridPoints given;
  given.areVoxels = false;
  given.points.data = points.data();
  given.points.shape[0] = 5;
  given.points.strides[0] = 12;
  given.mask.data = mask.data();
  given.mask.shape[0] = 5;
  given.mask.strides[0] = 4;
  Volume volume(recipeOf(VoxelType::Float, 1.0f).make(given), cpuDevice);
  int32_t tiles[6];
  ASSERT_EQ(volume.tiles(tiles, 2), 2);
  // Voxels (2, -4, -6) and (-6, 0, 0), by root, then by node.
  EXPECT_THAT(tiles, testing::ElementsAre(-8, 0, 0, 0, -8, -8));
  points[0] = {1e30f, 0, 0};
  EXPECT_THAT([&] { recipeOf(VoxelType::Float, 1.0f).make(given); },
              ThrowsMessage<Error>(HasSubstr("beyond the 2^31 voxels")));
}

TEST(Volume, RebuildKeepsTheIdAndAsksForRoom) {
  Voxels few = {{0, 0, 0}, {1, 0, 0}}, many = {{0, 0, 0}, {9000, 0, 0}};
  auto recipe = recipeOf(VoxelType::Float, 2.0f);
  Volume volume(recipe.make(pointsOf(few)), cpuDevice);
  uint64_t id = volume.id();
  std::shared_ptr<void> before = volume.memory();
  EXPECT_EQ(volume.rebuild(recipe, pointsOf(many), GridCounts{1, 1, 1, 512}),
            LeafCapacityExceeded | LowerCapacityExceeded |
                UpperCapacityExceeded | VoxelCapacityExceeded);
  EXPECT_EQ(volume.memory(), before);
  EXPECT_EQ(volume.rebuild(recipe, pointsOf(many)), 0u);
  EXPECT_EQ(volume.id(), id);
  EXPECT_EQ(volume.info().counts.uppers, 2);
  EXPECT_EQ(lookUp(volume, 9001, 0, 0), 2);
}

TEST(Volume, FilesOfEveryCodecHoldSeveralGrids) {
  GridBytes first = makeDenseOf<float>(VoxelType::Float);
  GridBytes second = makeDenseOf<int32_t>(VoxelType::Int32);
  // The number of a grid, and of how many: bytes 24 to 31 of a header.
  const uint32_t numbers[2][2] = {{0, 2}, {1, 2}};
  std::memcpy(first.data() + 24, numbers[0], 8);
  std::memcpy(second.data() + 24, numbers[1], 8);
  GridBytes both(first.size() + second.size());
  std::copy_n(first.data(), first.size(), both.data());
  std::copy_n(second.data(), second.size(), both.data() + first.size());
  Volume made(both, cpuDevice);
  for (auto codec : {GridCodec::None, GridCodec::Zip, GridCodec::Blosc}) {
    TemporaryFile file("several.nvdb");
    try {
      made.save(file.path, codec);
    } catch (const Error &error) {
      // The library is the system's.
      ASSERT_EQ(codec, GridCodec::Blosc) << error.what();
      EXPECT_THAT(error.what(), HasSubstr("libblosc"));
      continue;
    }
    Volume volume(readGridsOf(file.path), cpuDevice);
    expectDense(volume);
    ASSERT_EQ(volume.next(), first.size());
    Volume following(static_cast<uint8_t *>(volume.data()) + volume.next(), 0,
                     cpuDevice);
    EXPECT_EQ(following.info().type, VoxelType::Int32);
    expectDense(following);
    EXPECT_EQ(following.next(), 0u);
    EXPECT_THROW(following.save(file.path), Error);
  }
}

TEST(Volume, WhatIsNoGridIsAnError) {
  auto raises = [](auto &&body, const char *what) {
    EXPECT_THAT(body, ThrowsMessage<Error>(HasSubstr(what)));
  };
  std::vector<uint8_t> zeros(4096);
  raises([&] { readGrids(zeros.data(), 8); }, "too short");
  raises([&] { readGrids(zeros.data(), 4096); }, "no .nvdb file");
  raises([&] { readGridsOf("/there/is/none"); }, "No such file");
  raises([&] { Volume(GridBytes(100), cpuDevice); }, "fewer than");
  raises([&] { Volume(GridBytes(4096), cpuDevice); }, "signature");
  raises([&] { Volume(nullptr, 0, cpuDevice); }, "invalid address");
  raises([&] { codecOf("lzma"); }, "Unsupported codec requested: 'lzma'");
  raises([&] { gridLayout(VoxelType(12)); }, "type 12 is not supported");
  raises([&] { tilesOfBox({0, 0, 0}, {int64_t(1) << 31, 1, 1}); }, "32 bits");
  auto recipe = recipeOf(VoxelType::Double, 1.0f);
  raises([&] { recipe.makeEmpty(); }, "4 bytes, but a value of the grid has 8");
}
