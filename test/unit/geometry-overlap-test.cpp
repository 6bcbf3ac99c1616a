//===- geometry-overlap-test.cpp - Iterators against brute force ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/geometry/Overlap.h"
#include "GeometryScenes.h"

#include <algorithm>
#include <gtest/gtest.h>

using namespace scenes;
using namespace warp::geometry;

namespace {

template <class Block, class Shape>
std::vector<int> collect(const Tree &tree, const Shape &shape) {
  Cursor cursor{0, -1, 0, 0, 0, 0};
  std::vector<int> found;
  for (i32 id; (id = nextOverlap<Block>(tree, shape, cursor)) >= 0;)
    found.push_back(id);
  // It stays at its end.
  EXPECT_EQ(nextOverlap<Block>(tree, shape, cursor), -1);
  std::sort(found.begin(), found.end());
  return found;
}

struct Boxes {
  std::vector<Vertex> lowers, uppers;

  warp::ArrayDescriptor describe(std::vector<Vertex> &corners) {
    warp::ArrayDescriptor array;
    array.data = corners.data();
    array.shape[0] = int32_t(corners.size());
    array.strides[0] = sizeof(Vertex);
    array.ndim = 1;
    return array;
  }
};

Boxes boundsOf(const Scene &scene) {
  Boxes boxes;
  for (size_t f = 0; f < scene.faces(); ++f) {
    Vertex low = scene.corner(f, 0), high = low;
    for (int i = 1; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], scene.corner(f, i)[axis]);
        high[axis] = std::max(high[axis], scene.corner(f, i)[axis]);
      }
    boxes.lowers.push_back(low);
    boxes.uppers.push_back(high);
  }
  return boxes;
}

} // namespace

TEST(GeometryOverlap, BoxesAndBallsFindEachPrimitiveOnce) {
  Scene scene = makeSoup(3000, 0.05f);
  Boxes boxes = boundsOf(scene);
  warp::Mesh mesh(scene.arrays(), -1);
  warp::Bvh bvh(boxes.describe(boxes.lowers), boxes.describe(boxes.uppers), -1);
  std::mt19937 random(9);
  std::uniform_real_distribution<float> where(-1, 1);
  for (int i = 0; i < 200; ++i) {
    Vertex c{where(random), where(random), where(random)};
    float r = 0.3f * std::abs(where(random)) + (i % 10 == 0 ? 4 : 0);
    // Shapes are in the coordinates of the tree, a power of two of ours.
    float k = treeOf(mesh.id()).scale;
    BoxShape box{{(c[0] - r) * k, (c[1] - r) * k, (c[2] - r) * k},
                 {(c[0] + r) * k, (c[1] + r) * k, (c[2] + r) * k}};
    SphereShape ball{{c[0] * k, c[1] * k, c[2] * k}, r * k * r * k};
    std::vector<int> inBox, inBall;
    for (size_t f = 0; f < scene.faces(); ++f) {
      bool overlaps = true;
      double off2 = 0;
      for (int axis = 0; axis < 3; ++axis) {
        float low = boxes.lowers[f][axis], high = boxes.uppers[f][axis];
        overlaps &= low <= c[axis] + r && high >= c[axis] - r;
        float off = std::max({low - c[axis], c[axis] - high, 0.0f});
        off2 += double(off) * off;
      }
      if (overlaps)
        inBox.push_back(int(f));
      if (off2 <= r * r)
        inBall.push_back(int(f));
    }
    EXPECT_EQ(collect<TriangleBlock>(treeOf(mesh.id()), box), inBox);
    EXPECT_EQ(collect<BoxBlock>(treeOf(bvh.id()), box), inBox);
    EXPECT_EQ(collect<BoxBlock>(treeOf(bvh.id()), ball), inBall);
  }
}

TEST(GeometryOverlap, BordersTouch) {
  Boxes boxes{{{0, 0, 0}}, {{1, 1, 1}}};
  warp::Bvh bvh(boxes.describe(boxes.lowers), boxes.describe(boxes.uppers), -1);
  const Tree &tree = treeOf(bvh.id());
  EXPECT_EQ(collect<BoxBlock>(tree, BoxShape{{1, 1, 1}, {2, 2, 2}}).size(), 1u);
  SphereShape ball{{2, 0.5f, 0.5f}, 1};
  EXPECT_EQ(collect<BoxBlock>(tree, ball).size(), 1u);
  f32 beyond = std::nextafter(1.0f, 2.0f);
  EXPECT_TRUE(
      collect<BoxBlock>(tree, BoxShape{{beyond, 1, 1}, {2, 2, 2}}).empty());
  // A ray along a border, which divides by zero.
  Ray ray(tree, {1, 1, -1}, {0, -0.0f, 1});
  EXPECT_EQ(collect<BoxBlock>(tree, RayShape{ray, 10}).size(), 1u);
  EXPECT_TRUE(collect<BoxBlock>(tree, RayShape{ray, 1}).empty());
}

TEST(GeometryOverlap, BadBoxesAreCountedAndNeverFound) {
  Boxes boxes{{{0, 0, 0}, {NAN, 0, 0}, {2, 0, 0}, {0, 0, 0}},
              {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}, {1, INFINITY, 1}}};
  warp::Bvh bvh(boxes.describe(boxes.lowers), boxes.describe(boxes.uppers), -1);
  EXPECT_EQ(bvh.report().skipped, 2);
  BoxShape all{{-9, -9, -9}, {9, 9, 9}}, far{{0, 1e30f, 0}, {1, 2e30f, 1}};
  EXPECT_EQ(collect<BoxBlock>(treeOf(bvh.id()), all), (std::vector<int>{0, 3}));
  EXPECT_EQ(collect<BoxBlock>(treeOf(bvh.id()), far), std::vector<int>{3});
  Boxes none;
  warp::Bvh empty(none.describe(none.lowers), none.describe(none.uppers), -1);
  EXPECT_TRUE(collect<BoxBlock>(treeOf(empty.id()), all).empty());
}

TEST(GeometryOverlap, CoincidentPrimitivesStayShallow) {
  Scene scene;
  for (int i = 0; i < 100000; ++i)
    scene.addTriangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  warp::Mesh mesh(scene.arrays(), -1);
  EXPECT_LE(mesh.report().depth, maxDepth);
  BoxShape all{{-9, -9, -9}, {9, 9, 9}};
  EXPECT_EQ(collect<TriangleBlock>(treeOf(mesh.id()), all).size(), 100000u);
}

TEST(GeometryOverlap, RefitFindsWhatMoved) {
  Scene scene = makeSoup(2000, 0.05f);
  warp::Mesh mesh(scene.arrays(), -1);
  for (Vertex &point : scene.points)
    point = {3 * point[1] + 1, point[2] - point[0], 0.5f * point[0]};
  mesh.refit(scene.arrays());
  warp::Mesh fresh(scene.arrays(), -1);
  for (float x = -2; x < 2; x += 0.01f) {
    ClosestPoint a = findClosest(treeOf(mesh.id()), {x, -x, 0.1f}, 9, 0);
    ClosestPoint b = findClosest(treeOf(fresh.id()), {x, -x, 0.1f}, 9, 0);
    ASSERT_EQ(std::tie(a.face, a.u, a.v), std::tie(b.face, b.u, b.v));
  }
}

TEST(GeometryHandle, SaysWhatIsWrong) {
  using warp::GeometryKind;
  uint64_t id;
  {
    Scene scene = makeSoup(10, 0.1f);
    warp::Mesh mesh(scene.arrays(), -1);
    id = mesh.id();
    EXPECT_EQ(warp::describeHandle(id, GeometryKind::Mesh, -1), "");
    EXPECT_EQ(warp::describeHandle(id, GeometryKind::Bvh, -1), "");
    EXPECT_EQ(warp::describeHandle(id, GeometryKind::Mesh, 0),
              "that of one on 'cpu'");
    EXPECT_EQ(warp::describeHandle(id, GeometryKind::HashGrid, -1),
              "that of a Mesh");
  }
  EXPECT_EQ(warp::describeHandle(id, GeometryKind::Mesh, -1),
            "that of a freed Mesh");
  EXPECT_EQ(warp::describeHandle(42, GeometryKind::Mesh, -1),
            "a number that is none");
  EXPECT_EQ(treeOf(id).tag, 0u);
}
