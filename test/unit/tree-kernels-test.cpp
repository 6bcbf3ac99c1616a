//===- tree-kernels-test.cpp - Trees that a GPU builds, on the host -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernels of lib/DeviceLib/cuda run here thread by thread; what they built
// is gone through: every proper primitive once, bounds that are those of what
// is below, and a smaller surface than along the curve.
//
//===----------------------------------------------------------------------===//

#include "FakeGpu.h"

#include "DeviceLib/cuda/Tree.h"
namespace order {
#include "DeviceLib/cuda/TreeOrder.cpp"
} // namespace order
namespace halving {
#include "DeviceLib/cuda/TreeHalves.cpp"
} // namespace halving
namespace filling {
#include "DeviceLib/cuda/TreeFill.cpp"
} // namespace filling

#include "Geometry/Hierarchy.h"
#include "warp/TreeBuild.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <random>

using namespace warp;
using geometry::Bounds;

namespace {

struct Boxes {
  std::vector<float> low, high;
};

/// A build as lib/Runtime/cuda/TreeBuild.cpp launches it, but for the sort.
struct Built {
  Built(tree::Primitives all, bool alongCurve);

  void sort(std::vector<tree::Quad> &centers, std::vector<uint32_t> &head);
  void halve(std::vector<tree::Quad> &centers, std::vector<uint32_t> &head);
  /// Fills nodes and blocks, of an order or of what the blocks have.
  void fill(tree::Primitives all, const int *order);

  std::vector<int> ordered;
  std::vector<geometry::Node> nodes;
  std::vector<uint32_t> blocks;
  float scale = 0;
  int found[2];
};

Built::Built(tree::Primitives all, bool alongCurve) {
  using tree::Quad;
  int count = all.count;
  std::vector<Quad> centers(count);
  std::vector<uint32_t> head(8 + 1024);
  gpu::launch(3, 256,
              [&] { order::tree_see(all, centers.data(), head.data()); });
  int shown[2];
  gpu::launch(1, 32, [&] {
    order::tree_report(head.data(), count, &scale, found, shown);
  });
  EXPECT_EQ(shown[0], found[0]);
  EXPECT_EQ(shown[1], found[1]);
  alongCurve ? sort(centers, head) : halve(centers, head);
  fill(all, ordered.data());
}

void Built::sort(std::vector<tree::Quad> &centers,
                 std::vector<uint32_t> &head) {
  int count = int(centers.size());
  std::vector<uint32_t> keys(count);
  ordered.resize(count);
  gpu::launch(2, 256, [&] {
    order::tree_key(centers.data(), count, 8, keys.data(), ordered.data(),
                    head.data());
  });
  for (int pass = 0; pass < 3; ++pass)
    EXPECT_EQ(
        std::accumulate(&head[8 + 256 * pass], &head[264 + 256 * pass], 0),
        count);
  std::sort(ordered.begin(), ordered.end(), [&](int a, int b) {
    return std::pair(keys[a], a) < std::pair(keys[b], b);
  });
}

void Built::halve(std::vector<tree::Quad> &centers,
                  std::vector<uint32_t> &head) {
  int count = int(centers.size()), chunks = (count + 4095) / 4096, size = 4096;
  while (size < count)
    size *= 2;
  std::vector<tree::Quad> other(count);
  std::vector<uint32_t> bounds(head.begin(), head.begin() + 8);
  for (; size > 4096; size /= 2) {
    int segments = (count + size - 1) / size;
    std::vector<uint32_t> halves(16 * segments), counts(1024 * segments),
        states(1 + chunks);
    halving::Halving all{centers.data(), other.data(),  bounds.data(),
                         halves.data(),  counts.data(), states.data(),
                         count,          size};
    gpu::launch(chunks, 1024, [&] { halving::tree_count(all); });
    gpu::launch(chunks, 1024, [&] { halving::tree_part(all); });
    std::swap(centers, other);
    bounds = halves;
  }
  ordered.assign(count, -1);
  gpu::launch(chunks, 1024, [&] {
    halving::tree_halve(centers.data(), ordered.data(), count);
  });
}

void Built::fill(tree::Primitives all, const int *order) {
  TreeShape shape(all.count);
  filling::Levels levels{int(shape.levels.size()), {}, int(shape.blocks)};
  for (size_t i = 0; i < shape.levels.size(); ++i)
    levels.starts[i + 1] = levels.starts[i] + int(shape.levels[i]);
  nodes.resize(levels.starts[levels.count]);
  blocks.resize(shape.blocks * (all.ofTriangles ? 80 : 56));
  auto *words = reinterpret_cast<float *>(nodes.data());
  gpu::launch((all.count + 511) / 512, 512, [&] {
    filling::tree_fill(all, order, &scale, levels, words, blocks.data());
  });
  if (levels.count > 2)
    gpu::launch(1, 1024, [&] { filling::tree_top(levels, words); });
}

/// Goes through a tree of boxes, or of triangles.
template <class Block> class Walk {
public:
  explicit Walk(const Built &built)
      : built(built),
        blocks(reinterpret_cast<const Block *>(built.blocks.data())) {}

  Bounds node(int index, int parent, int depth = 1) {
    const geometry::Node &one = built.nodes[index];
    EXPECT_EQ(one.parent, parent);
    EXPECT_LE(depth, geometry::maxDepth);
    Bounds all;
    for (int child = 0; child < 8; ++child) {
      Bounds below;
      if (one.nodes >> child & 1)
        below = node(one.nodeAt(child), index, depth + 1);
      else if (one.blocks >> child & 1)
        below = block(one.blockAt(child));
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(one.low[axis][child], below.low[axis]);
        EXPECT_EQ(one.high[axis][child], below.high[axis]);
      }
      if (!below.isProper())
        continue;
      all.include(below);
      surface += area(below);
    }
    return all;
  }

  std::vector<int> ids;
  double surface = 0;

private:
  Bounds block(int index) {
    Bounds all;
    for (int lane = 0; lane < 8; ++lane) {
      int id = blocks[index].id[lane];
      Bounds own;
      for (int axis = 0; axis < 3; ++axis) {
        own.low[axis] = blocks[index].low(axis)[lane];
        own.high[axis] = blocks[index].high(axis)[lane];
      }
      if (!own.isProper())
        continue;
      ids.push_back(id);
      all.include(own);
    }
    return all;
  }
  static double area(const Bounds &of) {
    double x = of.high[0] - of.low[0], y = of.high[1] - of.low[1],
           z = of.high[2] - of.low[2];
    return x * y + y * z + z * x;
  }

  const Built &built;
  const Block *blocks;
};

std::vector<float> randomPoints(int count, float extent, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> at(-extent, extent);
  std::vector<float> points(3 * count);
  std::generate(points.begin(), points.end(), [&] { return at(random); });
  return points;
}

struct TreeKernels : testing::TestWithParam<int> {};
} // namespace

TEST_P(TreeKernels, BoxesAreFoundOnceEach) {
  int count = GetParam();
  std::vector<float> low = randomPoints(count, 100, 1), high = low;
  for (float &x : high)
    x += 0.5f;
  std::vector<int> wanted(count);
  std::iota(wanted.begin(), wanted.end(), 0);
  if (count > 100) {
    low[3 * 31] = NAN;
    high[3 * 50 + 1] = -INFINITY;
    high[3 * 70 + 2] = low[3 * 70 + 2] - 1;
    std::erase_if(wanted, [](int i) { return i == 31 || i == 50 || i == 70; });
  }
  tree::Primitives all{low.data(), high.data(), count, count, 0};
  double surfaces[2];
  for (bool alongCurve : {false, true}) {
    Built built(all, alongCurve);
    EXPECT_EQ(built.found[0], count);
    EXPECT_EQ(built.found[1], count - int(wanted.size()));
    Bounds whole;
    for (int i : wanted) {
      Bounds own;
      std::memcpy(own.low, &low[3 * i], sizeof own.low);
      std::memcpy(own.high, &high[3 * i], sizeof own.high);
      whole.include(own);
    }
    EXPECT_EQ(built.scale, geometry::chooseScale(whole));
    Walk<geometry::BoxBlock> walk(built);
    walk.node(0, -1);
    std::sort(walk.ids.begin(), walk.ids.end());
    EXPECT_EQ(walk.ids, wanted);
    surfaces[alongCurve] = walk.surface;
  }
  if (count > 1000) {
    EXPECT_LT(surfaces[0], 0.8 * surfaces[1]);
  }
}

// Infinite sides are in blocks and nodes as they are, and change neither the
// scale nor what others are next to.
TEST_P(TreeKernels, InfiniteBoxesAreFoundOnceEach) {
  int count = GetParam();
  std::vector<float> low = randomPoints(count, 100, 1), high = low;
  for (float &x : high)
    x += 0.5f;
  for (int i = 0; i < 3 * count; i += 7)
    low[i] = -INFINITY;
  for (int i = 0; i < 3 * count; i += 5)
    high[i] = INFINITY;
  std::vector<int> wanted(count);
  std::iota(wanted.begin(), wanted.end(), 0);
  tree::Primitives all{low.data(), high.data(), count, count, 0};
  Bounds whole;
  for (int i : wanted) {
    Bounds own;
    std::memcpy(own.low, &low[3 * i], sizeof own.low);
    std::memcpy(own.high, &high[3 * i], sizeof own.high);
    whole.include(own.finite());
  }
  EXPECT_LE(whole.high[0], 101);
  for (bool alongCurve : {false, true}) {
    Built built(all, alongCurve);
    EXPECT_EQ(built.found[1], 0);
    EXPECT_EQ(built.scale, geometry::chooseScale(whole));
    Walk<geometry::BoxBlock> walk(built);
    walk.node(0, -1);
    std::sort(walk.ids.begin(), walk.ids.end());
    EXPECT_EQ(walk.ids, wanted);
  }
}

TEST_P(TreeKernels, TrianglesAreFoundOnceEach) {
  int count = GetParam();
  std::vector<float> points = randomPoints(count + 2, 1, 2);
  std::vector<int> faces(3 * count), wanted(count);
  for (int i = 0; i < 3 * count; ++i)
    faces[i] = i / 3 + i % 3;
  std::iota(wanted.begin(), wanted.end(), 0);
  int wrong = count;
  if (count > 100) {
    faces[3 * 90 + 1] = count + 2;
    faces[3 * 77] = -1;
    wrong = 77;
    points[3 * 30] = INFINITY;
    std::erase_if(wanted, [](int i) {
      return i == 77 || i == 90 || (i >= 28 && i <= 30);
    });
  }
  tree::Primitives all{points.data(), faces.data(), count + 2, count, 1};
  Built built(all, false);
  EXPECT_EQ(built.found[0], wrong);
  EXPECT_EQ(built.found[1], count - int(wanted.size()));
  Walk<geometry::TriangleBlock> walk(built);
  walk.node(0, -1);
  std::sort(walk.ids.begin(), walk.ids.end());
  EXPECT_EQ(walk.ids, wanted);
  for (float &x : points)
    x = 2 - x;
  Built refitted = built;
  built.fill(all, built.ordered.data());
  refitted.fill(all, nullptr);
  EXPECT_EQ(refitted.blocks, built.blocks);
  EXPECT_EQ(std::memcmp(refitted.nodes.data(), built.nodes.data(),
                        built.nodes.size() * sizeof(geometry::Node)),
            0);
}

INSTANTIATE_TEST_SUITE_P(Counts, TreeKernels,
                         testing::Values(1, 8, 9, 65, 513, 700, 4096, 9001));

// Primitives at one place, all of them wrong, and as large as floats get.
TEST(TreeKernelsOf, NothingToHalve) {
  int count = 600;
  for (float x : {0.0f, 3e38f, NAN}) {
    std::vector<float> corners(3 * count, x);
    Built built({corners.data(), corners.data(), count, count, 0}, false);
    Walk<geometry::BoxBlock> walk(built);
    walk.node(0, -1);
    EXPECT_EQ(walk.ids.size(), x == x ? count : 0);
  }
  std::vector<float> low = randomPoints(count, 1.6e38f, 3), high = low;
  Built built({low.data(), high.data(), count, count, 0}, false);
  Walk<geometry::BoxBlock> walk(built);
  walk.node(0, -1);
  EXPECT_EQ(walk.ids.size(), size_t(count));
}
