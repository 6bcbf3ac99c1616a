//===- geometry-sign-test.cpp - Inside-outside tests of meshes ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/geometry/Sign.h"
#include "GeometryScenes.h"

#include <gtest/gtest.h>

using namespace scenes;
using namespace warp::geometry;

namespace {

/// A tetrahedron with a sharp corner at the origin, open along +x: a face's own
/// normal says the wrong side near the corner. Its faces share no vertex.
Scene makeSpike() {
  Scene scene;
  Vertex tip{0, 0, 0}, a{1, 0.1f, 0}, b{1, -0.1f, 0.2f}, c{1, -0.1f, -0.2f};
  scene.addTriangle(tip, b, a);
  scene.addTriangle(tip, a, c);
  scene.addTriangle(tip, c, b);
  scene.addTriangle(a, b, c);
  return scene;
}

f32 sideOf(const warp::Mesh &mesh, Vertex p) {
  const Tree &tree = treeOf(mesh.id());
  BlockLane at{};
  Point<f32> q{p[0], p[1], p[2]};
  ClosestPoint found = findClosest(tree, q, 1e9f, 0, &at);
  return sideByNormal(
      tree, q, found, static_cast<const TriangleBlock *>(tree.blocks)[at.block],
      at.lane, 1e-3f);
}

/// True if a point is on the inner side of all faces of a convex mesh.
bool isInside(const Scene &scene, Vertex p) {
  for (size_t f = 0; f < scene.faces(); ++f) {
    Double3 a = toDouble(scene.corner(f, 0));
    Double3 n = cross(minus(toDouble(scene.corner(f, 1)), a),
                      minus(toDouble(scene.corner(f, 2)), a));
    if (dot(n, minus(toDouble(p), a)) > 0)
      return false;
  }
  return true;
}

} // namespace

TEST(GeometrySign, NormalsAreRightAtCornersAndEdgesOfASoup) {
  Scene spike = makeSpike();
  // Faces look outward.
  ASSERT_TRUE(isInside(spike, {0.9f, -0.05f, 0}));
  warp::Mesh mesh(spike.arrays(), -1);
  std::mt19937 random(13);
  std::uniform_real_distribution<float> where(-1, 1);
  int inside = 0;
  for (int i = 0; i < 20000; ++i) {
    Vertex p{0.6f + 0.9f * where(random), 0.3f * where(random),
             0.4f * where(random)};
    bool expected = isInside(spike, p);
    inside += expected;
    ASSERT_EQ(sideOf(mesh, p), expected ? -1 : 1)
        << p[0] << " " << p[1] << " " << p[2];
  }
  EXPECT_GT(inside, 100);
}

TEST(GeometrySign, FurthestCornerIsFound) {
  Scene soup = makeSoup(500, 0.3f);
  warp::Mesh mesh(soup.arrays(), -1);
  std::mt19937 random(17);
  std::uniform_real_distribution<float> where(-2, 2);
  for (int i = 0; i < 300; ++i) {
    Vertex p{where(random), where(random), where(random)};
    double furthest = 0;
    for (const Vertex &corner : soup.points) {
      Double3 arm = minus(toDouble(corner), toDouble(p));
      furthest = std::max(furthest, dot(arm, arm));
    }
    ClosestPoint found =
        findFurthest(treeOf(mesh.id()), {p[0], p[1], p[2]}, 0);
    ASSERT_GE(found.face, 0);
    const Vertex &at = soup.corner(found.face, found.u == 1   ? 0
                                               : found.v == 1 ? 1
                                                              : 2);
    Double3 arm = minus(toDouble(at), toDouble(p));
    EXPECT_NEAR(std::sqrt(dot(arm, arm)), std::sqrt(furthest), 1e-6);
  }
  EXPECT_EQ(findFurthest(treeOf(mesh.id()), {0, 0, 0}, 1e6f).face, -1);
}
