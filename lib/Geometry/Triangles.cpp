//===- Triangles.cpp - Triangle vertices of user arrays -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Triangles.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

using namespace warp;
using namespace warp::geometry;

/// The work of a thread at a time.
constexpr int64_t grain = 4096;

void Triangles::check() const {
  // A negative index is a large one without its sign.
  std::atomic<uint32_t> largest = 0;
  ThreadPool::parallelFor(
      0, indices.size(), 4 * grain, [&](int64_t from, int64_t to) {
        uint32_t mine = 0;
        for (int64_t i = from; i < to; ++i)
          mine = std::max(mine, uint32_t(indices[i]));
        uint32_t seen = largest;
        while (mine > seen && !largest.compare_exchange_weak(seen, mine))
          ;
      });
  if (indices.size() == 0 || int64_t(largest) < points.size())
    return;
  int64_t i = 0;
  while (uint32_t(indices[i]) < points.size())
    ++i;
  throw Error(Error::Kind::Runtime,
              "face " + std::to_string(i / 3) + " has the index " +
                  std::to_string(indices[i]) + ", but there are " +
                  std::to_string(points.size()) + " points");
}

std::vector<BuildPrimitive>
Triangles::primitives(const HostElements<int32_t> &groups) const {
  std::vector<BuildPrimitive> all(size());
  ThreadPool::parallelFor(0, size(), grain, [&](int64_t from, int64_t to) {
    for (int64_t face = from; face < to; ++face) {
      Four a = corner(face, 0), b = corner(face, 1), c = corner(face, 2);
      Four low = __builtin_elementwise_min(__builtin_elementwise_min(a, b), c);
      Four high = __builtin_elementwise_max(__builtin_elementwise_max(a, b), c);
      // NaN for what is not finite.
      Four none = (a - a) + (b - b) + (c - c);
      bool isFinite = none.x + none.y + none.z == 0;
      int32_t group = groups.size() ? groups[face] : 0;
      all[face] = {{{low.x, low.y, low.z}, {high.x, high.y, high.z}},
                   int32_t(face),
                   group};
      if (!isFinite)
        all[face] = BuildPrimitive::improper(int32_t(face), group);
    }
  });
  return all;
}

Bounds Triangles::bounds() const {
  // Eight points are three vectors, whose lanes alternate between the axes.
  static_assert(sizeof(Float3) == 3 * sizeof(float));
  const float *numbers = points.size() ? points[0].at : nullptr;
  Floats low[3], high[3], rest = 0;
  std::fill_n(low, 3, Floats(infinity));
  std::fill_n(high, 3, Floats(-infinity));
  int64_t vectors = points.size() / width;
  for (int64_t i = 0; i < 3 * vectors; i += 3)
    for (int k = 0; k < 3; ++k) {
      Floats x;
      std::memcpy(&x, numbers + width * (i + k), sizeof x);
      low[k] = least(low[k], x);
      high[k] = greatest(high[k], x);
      rest += x - x;
    }
  Bounds all;
  bool areAllFinite = bitsOf(rest == Floats(0)) == 0xff;
  for (int k = 0; areAllFinite && k < 3; ++k)
    for (int lane = 0; lane < width; ++lane) {
      int axis = (k * width + lane) % 3;
      all.low[axis] = least(all.low[axis], low[k][lane]);
      all.high[axis] = greatest(all.high[axis], high[k][lane]);
    }
  for (int64_t i = areAllFinite ? vectors * width : 0; i < points.size(); ++i) {
    const float *at = points[i].at;
    if (std::isfinite(at[0]) && std::isfinite(at[1]) && std::isfinite(at[2]))
      all.include(at);
  }
  return all;
}

int Triangles::fill(TriangleBlock &block, float scale) const {
  Ints isThere = block.id >= Ints(0);
  u32 filled = bitsOf(isThere);
  Ints faces = choose(isThere, block.id, Ints(block.id[0]));
  for (int i = 0; i < 3; ++i) {
    Four row[width];
    for (int lane = 0; lane < width; ++lane)
      row[lane] = corner(faces[lane], i) * scale;
    for (int half = 0; half < width; half += 4) {
      Four *of = row + half;
      Four xy0 = __builtin_shufflevector(of[0], of[1], 0, 4, 1, 5);
      Four xy1 = __builtin_shufflevector(of[2], of[3], 0, 4, 1, 5);
      Four z0 = __builtin_shufflevector(of[0], of[1], 2, 6, 3, 7);
      Four z1 = __builtin_shufflevector(of[2], of[3], 2, 6, 3, 7);
      Four axes[3] = {__builtin_shufflevector(xy0, xy1, 0, 1, 4, 5),
                      __builtin_shufflevector(xy0, xy1, 2, 3, 6, 7),
                      __builtin_shufflevector(z0, z1, 0, 1, 4, 5)};
      for (int axis = 0; axis < 3; ++axis)
        std::memcpy(reinterpret_cast<char *>(&block.vertex[i][axis]) +
                        half * sizeof(float),
                    &axes[axis], sizeof(Four));
    }
    for (const Floats &x : block.vertex[i])
      isThere &= x - x == Floats(0);
  }
  u32 proper = bitsOf(isThere);
  if (proper == 0xff)
    return 0;
  for (auto &vertex : block.vertex)
    for (Floats &x : vertex)
      x = choose(isThere, x, Floats(std::numeric_limits<float>::quiet_NaN()));
  return countBits(filled & ~proper);
}
