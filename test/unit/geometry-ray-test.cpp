//===- geometry-ray-test.cpp - Rays against brute force -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/geometry/Sign.h"
#include "GeometryScenes.h"

#include <gtest/gtest.h>

using namespace scenes;
using namespace warp::geometry;
using warp::Mesh;

namespace {

RayHit cast(const Mesh &mesh, Vertex o, Vertex d, float maxT = 1e30f) {
  return castRay(treeOf(mesh.id()), {o[0], o[1], o[2]}, {d[0], d[1], d[2]},
                 maxT, 0);
}

/// The smallest parameter at which a ray meets a triangle in double precision,
/// by Cramer's rule; infinite if it meets none.
double exactParameter(const Scene &scene, Vertex o, Vertex d) {
  double best = HUGE_VAL;
  Double3 direction = toDouble(d);
  for (size_t f = 0; f < scene.faces(); ++f) {
    Double3 a = toDouble(scene.corner(f, 0));
    Double3 e = minus(toDouble(scene.corner(f, 1)), a);
    Double3 g = minus(toDouble(scene.corner(f, 2)), a);
    Double3 p = cross(direction, g), from = minus(toDouble(o), a);
    double det = dot(e, p);
    Double3 q = cross(from, e);
    double u = dot(from, p) / det, v = dot(direction, q) / det;
    double t = dot(g, q) / det;
    if (u >= 0 && v >= 0 && u + v <= 1 && t >= 0)
      best = std::fmin(best, t);
  }
  return best;
}

} // namespace

TEST(GeometryRay, AgreesWithBruteForce) {
  Scene sphere = makeSphere(40, 20), soup = makeSoup(700, 0.2f);
  for (Scene *scene : {&sphere, &soup}) {
    Mesh mesh(scene->arrays(), -1);
    std::mt19937 random(5);
    std::uniform_real_distribution<float> where(-1.5f, 1.5f);
    int hits = 0, differences = 0;
    for (int i = 0; i < 3000; ++i) {
      Vertex o{where(random), where(random), where(random)};
      Vertex d{where(random), where(random), where(random)};
      // A third along the axes, with zero components of both signs.
      if (i % 3 == 0)
        d[i % 2] = i % 4 ? 0.0f : -0.0f, d[2] = 0;
      double exact = exactParameter(*scene, o, d);
      RayHit hit = cast(mesh, o, d);
      hits += hit.face >= 0;
      if ((hit.face >= 0) != std::isfinite(exact))
        ++differences;
      else if (hit.face >= 0)
        ASSERT_NEAR(hit.t, exact, 2e-5 * std::max(1.0, exact)) << i;
    }
    EXPECT_GT(hits, 500);
    // Both are right where a ray grazes an edge.
    EXPECT_LE(differences, 2);
  }
}

// No ray from inside of a closed mesh gets out, aimed at vertices and edges.
TEST(GeometryRay, ClosedMeshesAreWatertight) {
  Scene sphere = makeSphere(64, 32);
  Mesh mesh(sphere.arrays(), -1);
  std::mt19937 random(11);
  std::uniform_real_distribution<float> weight(0, 1), tilt(-0.2f, 0.2f);
  int misses = 0;
  for (int i = 0; i < 200000; ++i) {
    const Vertex &a = sphere.corner(random() % sphere.faces(), 0);
    size_t face = random() % sphere.faces();
    const Vertex &b = sphere.corner(face, 1), &c = sphere.corner(face, 2);
    float t = i % 2 ? weight(random) : 0;
    Vertex target, o{tilt(random), tilt(random), tilt(random)}, d;
    for (int k = 0; k < 3; ++k) {
      target[k] = i % 4 ? b[k] + t * (c[k] - b[k]) : a[k];
      d[k] = target[k] - o[k];
    }
    misses += cast(mesh, o, d).face < 0;
  }
  EXPECT_EQ(misses, 0);
}

TEST(GeometryRay, BordersAreAsTheTableSays) {
  Scene scene;
  scene.addTriangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  Mesh mesh(scene.arrays(), -1);
  Vertex over{0.25f, 0.25f, 1}, down{0, 0, -1}, up{0, 0, 1};
  EXPECT_EQ(cast(mesh, over, down).face, 0);
  EXPECT_EQ(cast(mesh, over, down).t, 1);
  // t < max_t, and t = 0 counts; so do back faces.
  EXPECT_EQ(cast(mesh, over, down, 1).face, -1);
  EXPECT_EQ(cast(mesh, {0.25f, 0.25f, 0}, up).t, 0);
  EXPECT_EQ(cast(mesh, {0.25f, 0.25f, 0}, up).face, 0);
  EXPECT_EQ(cast(mesh, {0.25f, 0.25f, -1}, up).face, 0);
  EXPECT_EQ(cast(mesh, over, up).face, -1);
  // In the plane of the triangle.
  EXPECT_EQ(cast(mesh, {-1, 0.25f, 0}, {1, 0, 0}).face, -1);
  // On an edge and on a corner.
  EXPECT_EQ(cast(mesh, {0, 0.5f, 1}, down).face, 0);
  EXPECT_EQ(cast(mesh, {0, 0, 1}, down).face, 0);
  Vertex unlimited{0, 0, INFINITY};
  for (Vertex bad : {Vertex{0, 0, 0}, Vertex{NAN, 0, 1}, unlimited})
    EXPECT_EQ(cast(mesh, over, bad).face, -1);
  EXPECT_EQ(cast(mesh, {NAN, 0, 0}, down).face, -1);
}

TEST(GeometryRay, ParametersAreInUnitsOfTheDirection) {
  Scene sphere = makeSphere(20, 10);
  for (float size : {1e-20f, 1.0f, 1e18f})
    for (float length : {1e-30f, 1.0f, 3e30f}) {
      Scene scaled = sphere;
      for (Vertex &point : scaled.points)
        for (float &x : point)
          x *= size;
      Mesh mesh(scaled.arrays(), -1);
      RayHit hit = cast(mesh, {0, 0, 0}, {0, 0.6f * length, 0.8f * length},
                        INFINITY);
      ASSERT_GE(hit.face, 0) << size << " " << length;
      double expected = exactParameter(sphere, {0, 0, 0}, {0, 0.6f, 0.8f});
      double got = double(hit.t) / size * length;
      if (std::isfinite(hit.t) && hit.t > 1e-38f)
        EXPECT_NEAR(got, expected, 1e-5) << size << " " << length;
    }
}

TEST(GeometryRay, MostAxesSayWhichSide) {
  Scene sphere = makeSphere(40, 20);
  Mesh mesh(sphere.arrays(), -1);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> where(-1.5f, 1.5f);
  for (int i = 0; i < 3000; ++i) {
    Vertex p{where(random), where(random), where(random)};
    double r = std::sqrt(dot(toDouble(p), toDouble(p)));
    double surface = 1 + 0.1 * std::sin(7 * p[0] / r) * std::cos(5 * p[1] / r);
    if (std::abs(r - surface) < 0.02)
      continue;
    EXPECT_EQ(sideByRays(treeOf(mesh.id()), {p[0], p[1], p[2]}),
              r < surface ? -1 : 1)
        << p[0] << " " << p[1] << " " << p[2];
  }
}
