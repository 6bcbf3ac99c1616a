//===- volume-nanovdb-test.cpp - Layouts and grids against NanoVDB --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// NanoVDB's headers are the format: its structs are as large as ours, and its
// accessors find what we have written. Index grids and masks are younger than
// the headers of the distribution.
//
//===----------------------------------------------------------------------===//

#if __has_include(<nanovdb/NanoVDB.h>)

#include "VolumeScenes.h"

#include "Geometry/Volumes/Layout.h"

#include <gtest/gtest.h>
#include <nanovdb/NanoVDB.h>

using namespace scenes;
using namespace warp;

static_assert(sizeof(nanovdb::GridData) == sizeof(geometry::GridHeader));
static_assert(sizeof(nanovdb::TreeData<>) == sizeof(geometry::GridTree));
static_assert(sizeof(nanovdb::GridBlindMetaData) ==
              sizeof(geometry::BlindArray));

namespace {

template <class T> void checkLayout(VoxelType type) {
  using Grid = nanovdb::NanoGrid<T>;
  using Root = typename Grid::RootType;
  GridLayout ours = gridLayout(type);
  EXPECT_EQ(sizeof(typename Root::DataType), size_t(ours.root));
  EXPECT_EQ(sizeof(typename Root::DataType::Tile), size_t(ours.tile));
  EXPECT_EQ(sizeof(nanovdb::NanoUpper<T>), size_t(ours.upper));
  EXPECT_EQ(sizeof(nanovdb::NanoLower<T>), size_t(ours.lower));
  EXPECT_EQ(sizeof(nanovdb::NanoLeaf<T>), size_t(ours.leaf));
  EXPECT_EQ(offsetof(typename nanovdb::NanoUpper<T>::DataType, mTable),
            size_t(ours.upperTable));
  EXPECT_EQ(offsetof(typename nanovdb::NanoLower<T>::DataType, mTable),
            size_t(ours.lowerTable));
  EXPECT_EQ(offsetof(typename nanovdb::NanoLeaf<T>::DataType, mValues),
            size_t(ours.leafTable));
}

template <class T> void checkValues(VoxelType type) {
  GridBytes grid = makeDenseOf<T>(type);
  auto *theirs = reinterpret_cast<nanovdb::NanoGrid<T> *>(grid.data());
  auto accessor = theirs->getAccessor();
  for (int i = -1; i < 12; ++i)
    for (int j = -1; j < 12; ++j)
      for (int k = -1; k < 26; ++k) {
        bool isInside = i >= 0 && j >= 0 && k >= 0 && i < 10 && j < 9 && k < 21;
        ASSERT_EQ(accessor.getValue(nanovdb::Coord(i, j, k)),
                  T(isInside ? valueAt(i, j, k) : -7));
      }
  EXPECT_EQ(theirs->tree().nodeCount(0), 12u);
  EXPECT_EQ(theirs->voxelSize()[2], 0.5);
  EXPECT_EQ(theirs->worldToIndex(nanovdb::Vec3d(1, 2, 5)),
            nanovdb::Vec3d(4, 0, 4));
}

} // namespace

TEST(VolumeNanoVdb, LayoutsAreThoseOfTheFormat) {
  checkLayout<float>(VoxelType::Float);
  checkLayout<double>(VoxelType::Double);
  checkLayout<int16_t>(VoxelType::Int16);
  checkLayout<int32_t>(VoxelType::Int32);
  checkLayout<int64_t>(VoxelType::Int64);
  checkLayout<uint32_t>(VoxelType::UInt32);
  checkLayout<nanovdb::Vec3f>(VoxelType::Vec3f);
  checkLayout<nanovdb::Vec3d>(VoxelType::Vec3d);
  checkLayout<nanovdb::Vec4f>(VoxelType::Vec4f);
  checkLayout<nanovdb::Vec4d>(VoxelType::Vec4d);
}

TEST(VolumeNanoVdb, ItsAccessorsFindWhatIsMade) {
  checkValues<float>(VoxelType::Float);
  checkValues<double>(VoxelType::Double);
  checkValues<int32_t>(VoxelType::Int32);
  checkValues<int64_t>(VoxelType::Int64);
}

#endif
