//===- geometry-searches-test.cpp - Searches with scalars and with vectors ===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What threads of GPUs find and what processors find has the same bits.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/geometry/scalar/ClosestSearch.h"
#include "DeviceLib/geometry/scalar/RaySearch.h"
#include "FakeGpu.h"
#include "GeometryScenes.h"

#include <cstring>
#include <gtest/gtest.h>
#include <limits>

using namespace scenes;
using namespace warp::geometry;
using warp::Mesh;

namespace {

/// Points and directions around a scene, many of them on its symmetries.
class Queries {
public:
  Queries(Vertex center, float size) : center(center), size(size) {}

  Vertex point() {
    Vertex p;
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = center[axis] + size * number();
    return p;
  }
  Vertex direction() {
    Vertex d{number(), number(), number()};
    // One in three moves along an axis or in a plane, one in nine almost so.
    for (float &x : d)
      if (int kind = int(random() % 9); kind < 3)
        x = kind == 2 ? x * 1e-30f : 0;
    return d;
  }

private:
  float number() {
    float x = std::uniform_real_distribution<float>(-1.5f, 1.5f)(random);
    return random() % 4 ? x : std::round(x * 4) / 4;
  }

  std::mt19937 random{5};
  Vertex center;
  float size;
};

template <class T> std::string bytesOf(const T &value) {
  std::string bytes(sizeof(T), '\0');
  std::memcpy(bytes.data(), &value, sizeof(T));
  return bytes;
}

/// A team of the threads of a block.
struct FakeOctet {
  static constexpr int lanes = 8;

  int rank() const { return gpu::thread(); }
  u32 of(u32 value, int rank) const {
    gpu::fake.threads[gpu::thread()].given = value;
    gpu::meet();
    value = gpu::fake.threads[rank].given;
    gpu::meet();
    return value;
  }
  u32 least(u32 value) const {
    u32 all = value;
    for (int i = 0; i < lanes; ++i)
      all = std::min(all, of(value, i));
    return all;
  }
  bool any(bool says) const { return ~least(says ? ~1u : ~0u); }
};

/// The same for a team and for threads on their own.
void compareTeam(const Tree &tree, Queries &queries) {
  scalar::ClosestQuery alone[8], together[8];
  for (scalar::ClosestQuery &one : alone) {
    Vertex p = queries.point();
    one = {(scalar::Bytes)tree.nodes,
           (scalar::Bytes)tree.blocks,
           {p[0] * tree.scale, p[1] * tree.scale, p[2] * tree.scale},
           4,
           0};
    together[&one - alone] = one;
    scalar::findForEach(scalar::Single(), one);
  }
  gpu::launch(
      1, 8, [&] { scalar::findForEach(FakeOctet(), together[gpu::thread()]); });
  for (int i = 0; i < 8; ++i) {
    ASSERT_EQ(alone[i].face, together[i].face) << i;
    ASSERT_EQ(alone[i].block, together[i].block) << i;
    ASSERT_EQ(alone[i].lane, together[i].lane) << i;
  }
}

void compare(Scene scene, Vertex center = {}, float size = 1) {
  Mesh mesh(scene.arrays(), -1);
  const Tree &tree = treeOf(mesh.id());
  Queries queries(center, size);
  int hits = 0, found = 0;
  for (int i = 0; i < 4000; ++i) {
    Vertex o = queries.point(), d = queries.direction();
    Point<f32> from{o[0], o[1], o[2]}, along{d[0], d[1], d[2]};
    for (float limit : {std::numeric_limits<float>::infinity(), size}) {
      RayHit wide = castRay<wide::RaySearch>(tree, from, along, limit, 0);
      RayHit narrow = castRay<scalar::RaySearch>(tree, from, along, limit, 0);
      ASSERT_EQ(bytesOf(wide), bytesOf(narrow)) << i;
      bool any =
          castRay<scalar::RaySearch>(tree, from, along, limit, 0, true).face >=
          0;
      ASSERT_EQ(wide.face >= 0, any);
      hits += wide.face >= 0;
      ClosestPoint near =
          findClosest<wide::ClosestSearch>(tree, from, limit, 0);
      ClosestPoint same =
          findClosest<scalar::ClosestSearch>(tree, from, limit, 0);
      ASSERT_EQ(bytesOf(near), bytesOf(same)) << i;
      found += near.face >= 0;
    }
  }
  for (int i = 0; i < 20; ++i)
    compareTeam(tree, queries);
  EXPECT_GT(hits, 500);
  EXPECT_GT(found, 4000);
}

/// Faces on a plane grid, each there twice.
Scene makeDuplicates(int n) {
  Scene scene;
  for (int i = 0; i <= n; ++i)
    for (int j = 0; j <= n; ++j)
      scene.points.push_back({2.0f * i / n - 1, 2.0f * j / n - 1, 0});
  for (int copy = 0; copy < 2; ++copy)
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        int a = i * (n + 1) + j, b = a + n + 1;
        for (int index : {a, b, b + 1, a, b + 1, a + 1})
          scene.indices.push_back(index);
      }
  return scene;
}

} // namespace

TEST(GeometrySearches, AgreeOnASphere) { compare(makeSphere(60, 30)); }

TEST(GeometrySearches, AgreeOnASoup) { compare(makeSoup(3000, 0.3f)); }

TEST(GeometrySearches, AgreeOnTies) { compare(makeDuplicates(12)); }

TEST(GeometrySearches, AgreeFarFromTheOrigin) {
  Scene sphere = makeSphere(30, 15);
  for (Vertex &point : sphere.points)
    for (float &x : point)
      x += 1e4f;
  compare(sphere, {1e4f, 1e4f, 1e4f});
}

TEST(GeometrySearches, AgreeOnThinTriangles) {
  Scene soup = makeSoup(2000, 0.5f);
  for (Vertex &point : soup.points)
    point[1] *= 1e-6f;
  compare(soup);
}
