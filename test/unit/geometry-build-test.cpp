//===- geometry-build-test.cpp - Trees of the SAH builder -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GeometryScenes.h"

#include <gtest/gtest.h>

#include <algorithm>

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

/// The surfaces of all blocks below a node: how many of them random rays meet.
double surfacesBelow(const Tree &tree, int index) {
  const Node &node = tree.nodes[index];
  double sum = 0;
  for (int child = 0; child < width; ++child) {
    if (node.blocks >> child & 1)
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

// Triangles of a regular mesh leave many bins empty.
TEST(GeometryBuild, EmptyBinsDoNotStopTheHeuristic) {
  Scene sphere = makeSphere(200, 100);
  EXPECT_LT(surfacesOf(sphere, BvhConstructor::Sah),
            0.9 * surfacesOf(sphere, BvhConstructor::Median));
}

namespace {

void countFaces(const Tree &tree, int index, std::vector<int> &counts) {
  const Node &node = tree.nodes[index];
  auto *blocks = static_cast<const TriangleBlock *>(tree.blocks);
  for (int child = 0; child < width; ++child) {
    if (node.nodes >> child & 1)
      countFaces(tree, node.nodeAt(child), counts);
    if (!(node.blocks >> child & 1))
      continue;
    const TriangleBlock &block = blocks[node.blockAt(child)];
    for (int lane = 0; lane < width; ++lane)
      if (block.id[lane] >= 0)
        ++counts[block.id[lane]];
  }
}

} // namespace

// Ranges of so many faces are cut in chunks.
TEST(GeometryBuild, EveryFaceIsInOneBlock) {
  Scene sphere = makeSphere(240, 120);
  ASSERT_GT(sphere.faces(), 50000u);
  sphere.points[5][0] = NAN;
  Mesh mesh(sphere.arrays(), -1);
  std::vector<int> counts(sphere.faces()), expected(sphere.faces(), 1);
  countFaces(treeOf(mesh.id()), 0, counts);
  // A NaN primitive has a leaf, too: it may be found after a refit.
  EXPECT_EQ(counts, expected);
  EXPECT_EQ(mesh.report().skipped,
            std::count(sphere.indices.begin(), sphere.indices.end(), 5));
}
