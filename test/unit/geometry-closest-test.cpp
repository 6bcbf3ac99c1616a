//===- geometry-closest-test.cpp - Closest points against brute force -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GeometryScenes.h"

#include <algorithm>
#include <gtest/gtest.h>

using namespace scenes;
using namespace warp::geometry;
using warp::Mesh;

namespace {

ClosestPoint ask(const Mesh &mesh, Vertex p, float maxDist = 1e30f) {
  return findClosest(treeOf(mesh.id()), {p[0], p[1], p[2]}, maxDist, 0);
}

/// Distance from p to the point that an answer names, in double precision.
double distanceTo(const Scene &scene, const Vertex &p,
                  const ClosestPoint &found) {
  double w[3] = {found.u, found.v, 1.0 - double(found.u) - double(found.v)};
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double x = -double(p[axis]);
    for (int i = 0; i < 3; ++i)
      x += w[i] * scene.corner(found.face, i)[axis];
    sum += x * x;
  }
  return std::sqrt(sum);
}

/// The largest error of the distance over random points, over the size.
double worstError(Scene &scene, float size, Vertex center, int queries) {
  Mesh mesh(scene.arrays(), -1);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> where(-1.5f, 1.5f);
  double worst = 0;
  for (int i = 0; i < queries; ++i) {
    Vertex p;
    for (int axis = 0; axis < 3; ++axis)
      p[axis] = center[axis] + size * where(random);
    ClosestPoint found = ask(mesh, p);
    if (found.face < 0)
      return HUGE_VAL;
    double exact = std::sqrt(squaredDistance(scene, p));
    worst = std::max(worst, std::abs(distanceTo(scene, p, found) - exact));
  }
  return worst / size;
}

} // namespace

TEST(GeometryClosest, AgreesWithBruteForce) {
  Scene sphere = makeSphere(40, 20), soup = makeSoup(700, 0.2f);
  EXPECT_LT(worstError(sphere, 1, {}, 2000), 4e-7);
  EXPECT_LT(worstError(soup, 1, {}, 2000), 4e-7);
}

TEST(GeometryClosest, KeepsDigitsWhateverTheScale) {
  for (float size : {1e-20f, 1e19f}) {
    Scene sphere = makeSphere(20, 10);
    for (Vertex &point : sphere.points)
      for (float &x : point)
        x *= size;
    EXPECT_LT(worstError(sphere, size, {}, 500), 4e-7) << size;
  }
}

TEST(GeometryClosest, MovesToTheQueryPointFirst) {
  Scene sphere = makeSphere(20, 10);
  for (Vertex &point : sphere.points)
    for (float &x : point)
      x += 1e6f;
  // Both the mesh and the points are rounded to 1/16; distances are not.
  EXPECT_LT(worstError(sphere, 1, {1e6f, 1e6f, 1e6f}, 500), 4e-7);
}

TEST(GeometryClosest, OfTrianglesWithoutAreaIsThatOfTheirEdges) {
  Scene scene;
  scene.addTriangle({0, 0, 0}, {1, 0, 0}, {0.25f, 0, 0});
  scene.addTriangle({0, 2, 0}, {0, 2, 0}, {1, 2, 0});
  scene.addTriangle({0, 4, 0}, {0, 4, 0}, {0, 4, 0});
  EXPECT_LT(worstError(scene, 1, {0, 2, 0}, 500), 3e-7);
  Mesh mesh(scene.arrays(), -1);
  EXPECT_EQ(mesh.report().skipped, 0);
}

TEST(GeometryClosest, OfNeedlesAndCapsKeepsItsDigits) {
  for (float height : {1e-3f, 1e-6f}) {
    Scene scene;
    scene.addTriangle({0, 0, 0}, {1, 0, 0}, {0.5f, height, 0});
    scene.addTriangle({0, 1, 0}, {1, 1, 0}, {1, 1, height});
    EXPECT_LT(worstError(scene, 1, {0.5f, 0.5f, 0}, 2000), 3e-7) << height;
  }
}

TEST(GeometryClosest, OfNeedlesSideBySideIsThatOfTheRightOne) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> where(-1, 1);
  for (int rows : {20, 500}) {
    Scene strip = makeStrip(rows);
    Mesh mesh(strip.arrays(), -1);
    for (int i = 0; i < 500; ++i) {
      Vertex p{where(random), where(random), 0};
      EXPECT_LT(distanceTo(strip, p, ask(mesh, p)), 3e-6);
    }
  }
}

TEST(GeometryClosest, TiesGoToTheLowerFace) {
  Scene sphere = makeSphere(20, 10);
  Scene twice = sphere;
  twice.indices.insert(twice.indices.end(), sphere.indices.begin(),
                       sphere.indices.end());
  Mesh once(sphere.arrays(), -1), both(twice.arrays(), -1);
  Mesh median(twice.arrays(), -1, warp::BvhConstructor::Median);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> where(-1.5f, 1.5f);
  for (int i = 0; i < 2000; ++i) {
    Vertex p{where(random), where(random), where(random)};
    ClosestPoint a = ask(once, p), b = ask(both, p), c = ask(median, p);
    ASSERT_EQ(a.face, b.face);
    ASSERT_EQ(std::tie(b.face, b.u, b.v), std::tie(c.face, c.u, c.v));
  }
}

TEST(GeometryClosest, IsStrictlyNearerThanTheBound) {
  Scene scene;
  scene.addTriangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  Mesh mesh(scene.arrays(), -1);
  Vertex p{0.25f, 0.25f, 0.5f};
  EXPECT_EQ(ask(mesh, p, 0.5f).face, -1);
  EXPECT_EQ(ask(mesh, p, 0.50001f).face, 0);
  for (float bound : {0.0f, -1.0f, NAN})
    EXPECT_EQ(ask(mesh, p, bound).face, -1) << bound;
  EXPECT_EQ(ask(mesh, {NAN, 0, 0}).face, -1);
  EXPECT_EQ(ask(mesh, {INFINITY, 0, 0}).face, -1);
  // On the surface; and a weight is zero exactly on an edge.
  EXPECT_EQ(ask(mesh, {0.25f, 0.25f, 0}, 1e-30f).face, 0);
  EXPECT_EQ(ask(mesh, {0.25f, -1, 0}).u + ask(mesh, {0.25f, -1, 0}).v, 1);
}

TEST(GeometryClosest, LeavesOutWhatIsNotFinite) {
  Scene scene = makeSoup(100, 0.2f);
  for (int i = 0; i < 50; ++i)
    scene.points[6 * i][i % 3] = i % 2 ? NAN : INFINITY;
  Mesh mesh(scene.arrays(), -1);
  EXPECT_EQ(mesh.report().skipped, 50);
  Scene rest = scene;
  rest.indices.clear();
  for (size_t f = 1; f < 100; f += 2)
    for (int i = 0; i < 3; ++i)
      rest.indices.push_back(scene.indices[3 * f + i]);
  Mesh clean(rest.arrays(), -1);
  for (float x = -1; x < 1; x += 0.01f)
    ASSERT_EQ(ask(mesh, {x, -x, 0.3f}).face,
              2 * ask(clean, {x, -x, 0.3f}).face + 1);
}
