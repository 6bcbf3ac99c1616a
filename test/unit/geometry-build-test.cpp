//===- geometry-build-test.cpp - What the heuristic makes of a scene ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GeometryScenes.h"

#include <gtest/gtest.h>

using namespace scenes;
using namespace warp::geometry;
using warp::BvhConstructor;
using warp::Mesh;


namespace {

double areaOf(const Node &node, int child) {
  double size[3];
  for (int axis = 0; axis < 3; ++axis)
    size[axis] = double(node.high[axis][child]) - node.low[axis][child];
  return size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
}

/// The surfaces of all boxes below a node: how many of them random rays meet.
double surfacesBelow(const Tree &tree, int index) {
  const Node &node = tree.nodes[index];
  double sum = 0;
  for (int child = 0; child < width; ++child) {
    if (!(node.children() >> child & 1))
      continue;
    sum += areaOf(node, child);
    if (node.nodes >> child & 1)
      sum += surfacesBelow(tree, node.nodeAt(child));
  }
  return sum;
}

double surfacesOf(Scene &scene, BvhConstructor constructor) {
  Mesh mesh(scene.arrays(), -1, constructor);
  return surfacesBelow(treeOf(mesh.id()), 0);
}

} // namespace

// Small triangles, all in one corner of a large scene: most bins are empty.
TEST(GeometryBuild, EmptyBinsDoNotStopTheHeuristic) {
  Scene scene = makeSoup(2000, 0.01f);
  Scene around = makeSoup(60, 0.3f, 2);
  for (size_t face = 0; face < around.faces(); ++face) {
    Vertex corners[3];
    for (int i = 0; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis)
        corners[i][axis] = 40 * around.corner(face, i)[axis] + 30;
    scene.addTriangle(corners[0], corners[1], corners[2]);
  }
  double byArea = surfacesOf(scene, BvhConstructor::Sah);
  double byMedian = surfacesOf(scene, BvhConstructor::Median);
  EXPECT_LT(byArea, 0.8 * byMedian);
}

TEST(GeometryBuild, HeuristicIsNoWorseOnASphere) {
  Scene sphere = makeSphere(60, 30);
  EXPECT_LE(surfacesOf(sphere, BvhConstructor::Sah),
            1.05 * surfacesOf(sphere, BvhConstructor::Median));
}
