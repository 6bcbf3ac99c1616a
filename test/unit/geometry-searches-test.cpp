//===- geometry-searches-test.cpp - Searches with scalars and with vectors ===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Results of threads of GPUs and of processors have the same bits.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/geometry/scalar/ClosestSearch.h"
#include "DeviceLib/geometry/scalar/RaySearch.h"
#include "FakeGpu.h"
#include "GeometryScenes.h"

#include <algorithm>
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

/// Teams of a warp whose lanes are the threads of a block.
struct FakeOctet {
  static constexpr int lanes = 8, teams = 4;

  static bool areAllHere() { return true; }
  bool areSame(scalar::Bytes) const { return true; }
  int rank() const { return lane() & 7; }
  int number() const { return lane() >> 3; }
  int lane() const { return gpu::thread(); }
  u32 from(u32 value, int lane) const {
    return exchange(value, [&] { return givenBy(lane); });
  }
  u32 of(u32 value, int rank) const {
    return from(value, (lane() & ~7) | (rank & 7));
  }
  u32 least(u32 value) const {
    return exchange(value, [&] {
      u32 all = value;
      for (int i = 0; i < lanes; ++i)
        all = std::min(all, givenBy((lane() & ~7) | i));
      return all;
    });
  }
  u32 leastOfTeams(u32 value) const {
    return exchange(value, [&] {
      u32 all = value;
      for (int i = 0; i < teams; ++i)
        all = std::min(all, givenBy(lanes * i));
      return all;
    });
  }
  u32 where(bool says) const {
    return exchange(says, [&] {
      u32 all = 0;
      for (int i = 0; i < lanes * teams; ++i)
        all |= givenBy(i) << i;
      return all;
    });
  }
  u32 with(bool says) const { return where(says) >> (lane() & ~7) & 0xff; }
  void sync() const {}

private:
  static u32 givenBy(int lane) { return gpu::fake.threads[lane].given; }
  template <class Take> static u32 exchange(u32 value, Take take) {
    gpu::fake.threads[gpu::thread()].given = value;
    gpu::syncThreads();
    value = take();
    gpu::syncThreads();
    return value;
  }
};

/// The same for the lanes of a warp together and for threads on their own.
void compareTeams(const Tree &tree, Queries &queries, bool isBeam) {
  using TogetherClosest = scalar::ClosestByTeam<FakeOctet>;
  using TogetherRay = scalar::RaySearchBy<FakeOctet>;
  constexpr int threads = 32;
  scalar::ClosestQuery alone[threads], together[threads];
  Point<f32> from[threads], along[threads];
  RayHit hits[threads], both[threads];
  auto nodes = (scalar::Bytes)tree.nodes, blocks = (scalar::Bytes)tree.blocks;
  for (int i = 0; i < threads; ++i) {
    Vertex p = queries.point(), d = queries.direction();
    while (d[0] == 0 && d[1] == 0 && d[2] == 0)
      d = queries.direction();
    // Rays that begin at one point meet the same blocks.
    from[i] = isBeam && i % 16 ? from[i - 1] : Point<f32>{p[0], p[1], p[2]};
    along[i] = {d[0], d[1], d[2]};
    f32 limit = i % 3 ? std::numeric_limits<f32>::infinity() : 0.7f;
    hits[i] = castRay<wide::RaySearch>(tree, from[i], along[i], limit, 0);
    f32 k = tree.scale;
    alone[i] = together[i] = {{p[0] * k, p[1] * k, p[2] * k}, 4};
    scalar::ClosestByTeam<scalar::Single>({}, nodes, blocks, 0, alone[i]).run();
  }
  gpu::launch(1, threads, [&] {
    int i = gpu::thread();
    TogetherClosest({}, nodes, blocks, 0, together[i]).run();
    f32 limit = i % 3 ? std::numeric_limits<f32>::infinity() : 0.7f;
    both[i] = castRay<TogetherRay>(tree, from[i], along[i], limit, 0);
    bool any =
        castRay<TogetherRay>(tree, from[i], along[i], limit, 0, true).face >= 0;
    EXPECT_EQ(any, hits[i].face >= 0) << i;
  });
  for (int i = 0; i < threads; ++i) {
    ASSERT_EQ(alone[i].face, together[i].face) << i;
    ASSERT_EQ(alone[i].block, together[i].block) << i;
    ASSERT_EQ(alone[i].lane, together[i].lane) << i;
    ASSERT_EQ(bytesOf(hits[i]), bytesOf(both[i])) << i;
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
  for (int i = 0; i < 6; ++i)
    compareTeams(tree, queries, i % 2);
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

TEST(GeometrySearches, AgreeOnNeedlesSideBySide) { compare(makeStrip(400)); }

/// One ray of a warp goes on alone, and has several blocks tested at once.
static void compareLoner(const Tree &tree, Point<f32> start, Point<f32> along,
                         int loner) {
  constexpr int threads = 32;
  RayHit together[threads];
  gpu::launch(1, threads, [&] {
    int i = gpu::thread();
    // Others begin far away.
    Point<f32> from = i == loner ? start : Point<f32>{9e3f + i, 9e3f, 9e3f};
    together[i] =
        castRay<scalar::RaySearchBy<FakeOctet>>(tree, from, along, 99, 0);
  });
  RayHit hit = castRay<wide::RaySearch>(tree, start, along, 99, 0);
  ASSERT_EQ(bytesOf(hit), bytesOf(together[loner]));
  for (int i = 0; i < threads; ++i)
    if (i != loner)
      EXPECT_EQ(together[i].face, -1);
}

TEST(GeometrySearches, AgreeOnARayAloneInASoup) {
  Scene soup = makeSoup(3000, 0.3f);
  Mesh mesh(soup.arrays(), -1);
  Queries queries({}, 1);
  for (int i = 0; i < 300; ++i) {
    Vertex p = queries.point(), d{1, 1, 1};
    d[i % 3] = 0.5f * i;
    compareLoner(treeOf(mesh.id()), {p[0], p[1], p[2]}, {d[0], d[1], d[2]},
                 i % 32);
  }
}

TEST(GeometrySearches, AgreeOnARayAloneInAFan) {
  Scene fan = makeSphere(500, 4);
  // The first corner is a pole. The last face is the lowest one.
  std::reverse(fan.indices.begin(), fan.indices.end());
  Mesh mesh(fan.arrays(), -1);
  Vertex pole = fan.points.front();
  compareLoner(treeOf(mesh.id()), {pole[0], pole[1], 3}, {0, 0, -1}, 13);
}
