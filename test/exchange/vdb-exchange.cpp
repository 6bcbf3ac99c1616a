//===- vdb-exchange.cpp - .nvdb files as grids of OpenVDB -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//   vdb-exchange write TYPE FILE
//       voxels "x y z value", a line each, are set in a grid of OpenVDB with
//       the background -7, whose voxels (-64, 0, 8) to (-49, 15, 23) are 2.5
//       by whole tiles, and which is turned, scaled and moved in the world;
//       prints where (x + .25, y + .5, z + .75) is in the world
//   vdb-exchange read FILE
//       for each line "x y z" of input, integers: the voxel's value, whether
//       it is active, the value between voxels at (x + .25, y + .5, z + .75),
//       and where that is in the world
//
//===----------------------------------------------------------------------===//

#include <nanovdb/util/IO.h>
#include <nanovdb/util/NanoToOpenVDB.h>
#include <nanovdb/util/OpenToNanoVDB.h>
#include <openvdb/tools/Interpolation.h>

#include <cstdio>
#include <cstring>
#include <iostream>
#include <stdexcept>

using openvdb::Coord;

static openvdb::Mat4d matrix() {
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  m.preRotate(openvdb::math::X_AXIS, 0.5);
  m.preRotate(openvdb::math::Z_AXIS, -1.25);
  m.preScale(openvdb::Vec3d(0.25, 0.5, 2));
  m.postTranslate(openvdb::Vec3d(3, -40, 0.125));
  return m;
}

static void print(const openvdb::Vec3d &world) {
  std::printf("%.17g %.17g %.17g", world[0], world[1], world[2]);
}

template <class Grid> static void write(const char *path) {
  using Value = typename Grid::ValueType;
  typename Grid::Ptr grid = Grid::create(Value(-7));
  grid->setName("field");
  grid->setTransform(openvdb::math::Transform::createLinearTransform(matrix()));
  grid->fill(openvdb::CoordBBox({-64, 0, 8}, {-49, 15, 23}), Value(2.5));
  auto accessor = grid->getAccessor();
  int x, y, z;
  double value;
  while (std::cin >> x >> y >> z >> value) {
    accessor.setValue(Coord(x, y, z), Value(value));
    print(grid->indexToWorld(openvdb::Vec3d(x + 0.25, y + 0.5, z + 0.75)));
    std::printf("\n");
  }
  nanovdb::io::writeGrid(path, nanovdb::openToNanoVDB(*grid));
}

static double numberOf(double value) { return value; }
static double numberOf(const openvdb::Vec3f &value) { return value[2]; }

template <class Grid> static bool read(const openvdb::GridBase::Ptr &base) {
  auto grid = openvdb::gridPtrCast<Grid>(base);
  if (!grid)
    return false;
  auto accessor = grid->getConstAccessor();
  int x, y, z;
  while (std::cin >> x >> y >> z) {
    openvdb::Vec3d at(x + 0.25, y + 0.5, z + 0.75);
    typename Grid::ValueType between;
    openvdb::tools::BoxSampler::sample(accessor, at, between);
    Coord voxel(x, y, z);
    std::printf("%.17g %d %.17g ", numberOf(accessor.getValue(voxel)),
                accessor.isValueOn(voxel), numberOf(between));
    print(grid->indexToWorld(at));
    std::printf("\n");
  }
  return true;
}

/// Sets where a grid is: the conversion of version 10 drops the transposed
/// matrix that it makes, and takes the inverse of a rotation for it.
static void placeAsIn(const nanovdb::GridMetaData &file,
                      openvdb::GridBase &grid) {
  const nanovdb::Map &map = file.map();
  openvdb::Mat4d m = openvdb::Mat4d::identity();
  m.setMat3(openvdb::Mat3d(map.mMatD).transpose());
  m.setTranslation(openvdb::Vec3d(map.mVecD));
  grid.setTransform(openvdb::math::Transform::createLinearTransform(m));
}

int main(int argc, char **argv) {
  try {
    openvdb::initialize();
    auto is = [&](int i, const char *word) {
      return argc > i && std::strcmp(argv[i], word) == 0;
    };
    if (argc == 4 && is(1, "write")) {
      if (is(2, "float"))
        write<openvdb::FloatGrid>(argv[3]);
      else if (is(2, "double"))
        write<openvdb::DoubleGrid>(argv[3]);
      else if (is(2, "int32"))
        write<openvdb::Int32Grid>(argv[3]);
      else if (is(2, "Vec3f"))
        write<openvdb::Vec3SGrid>(argv[3]);
      else
        throw std::runtime_error("no such type");
      return 0;
    }
    if (argc != 3 || !is(1, "read"))
      throw std::runtime_error("expects 'write TYPE FILE' or 'read FILE'");
    nanovdb::GridHandle<> file = nanovdb::io::readGrid(argv[2]);
    openvdb::GridBase::Ptr grid = nanovdb::nanoToOpenVDB(file);
    placeAsIn(*file.gridMetaData(), *grid);
    if (read<openvdb::FloatGrid>(grid) || read<openvdb::DoubleGrid>(grid) ||
        read<openvdb::Int32Grid>(grid) || read<openvdb::Int64Grid>(grid) ||
        read<openvdb::Vec3SGrid>(grid))
      return 0;
    throw std::runtime_error("a grid of another type");
  } catch (const std::exception &problem) {
    std::fprintf(stderr, "%s\n", problem.what());
    return 1;
  }
}
