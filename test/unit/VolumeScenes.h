//===- VolumeScenes.h - Grids that tests of volumes share -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TEST_VOLUMESCENES_H
#define WARP_TEST_VOLUMESCENES_H

#include "warp/Device.h"
#include "warp/Volume.h"

#include <array>
#include <cstring>
#include <string>
#include <vector>

namespace scenes {

template <class T> std::vector<uint8_t> bytesOf(T value) {
  std::vector<uint8_t> bytes(sizeof value);
  std::memcpy(bytes.data(), &value, sizeof value);
  return bytes;
}

/// Values of a type, half a unit wide, with the first voxel at (-1, 2, 3).
template <class T>
warp::GridRecipe recipeOf(warp::VoxelType type, T background) {
  warp::GridRecipe recipe;
  recipe.type = type;
  recipe.background = bytesOf(background);
  recipe.transform = {{0.5, 0, 0, 0, 0.5, 0, 0, 0, 0.5}, {-1, 2, 3}};
  return recipe;
}

inline double valueAt(int i, int j, int k) { return i + 10 * j + 100 * k; }

constexpr int64_t denseShape[3] = {10, 9, 21};

/// valueAt(i, j, k) in `denseShape` voxels, and -7 elsewhere.
template <class T> warp::GridBytes makeDenseOf(warp::VoxelType type) {
  std::vector<T> values;
  for (int i = 0; i < denseShape[0]; ++i)
    for (int j = 0; j < denseShape[1]; ++j)
      for (int k = 0; k < denseShape[2]; ++k)
        values.push_back(T(valueAt(i, j, k)));
  return warp::makeDense(recipeOf(type, T(-7)), {values.data(), {10, 9, 21}});
}

using Voxels = std::vector<std::array<int32_t, 3>>;

inline warp::GridPoints pointsOf(Voxels &voxels) {
  warp::GridPoints points;
  points.points.data = voxels.data();
  points.points.ndim = 1;
  points.points.shape[0] = int32_t(voxels.size());
  points.points.strides[0] = sizeof voxels[0];
  points.device = warp::cpuDevice;
  return points;
}

/// A file in the folder for temporary files, removed in the end.
struct TemporaryFile {
  explicit TemporaryFile(const char *name)
      : path(std::string(P_tmpdir) + "/warp-" + name) {}
  ~TemporaryFile() { std::remove(path.c_str()); }
  std::string path;
};

} // namespace scenes

#endif // WARP_TEST_VOLUMESCENES_H
