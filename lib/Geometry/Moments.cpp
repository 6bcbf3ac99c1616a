//===- Moments.cpp - Moments of nodes for winding numbers -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sums over triangles are about the origin and in double precision, from the
// last node to the first: children come behind their parents. A child's own
// center is subtracted when its parent writes it down.
//
//===----------------------------------------------------------------------===//

#include "Moments.h"

#include <cmath>

using namespace warp;
using namespace warp::geometry;

namespace {

/// For a set of triangles: area, area times center, area times normal, and that
/// times the center.
struct Sums {
  double area = 0, center[3] = {}, normal[3] = {}, tensor[3][3] = {};

  void add(const Sums &other) {
    area += other.area;
    for (int i = 0; i < 3; ++i) {
      center[i] += other.center[i];
      normal[i] += other.normal[i];
      for (int j = 0; j < 3; ++j)
        tensor[i][j] += other.tensor[i][j];
    }
  }
};

} // namespace

static Sums sumTriangle(const TriangleBlock &block, int lane) {
  Sums sums;
  Point<f64> corner[3];
  for (int i = 0; i < 3; ++i)
    corner[i] = {block.vertex[i][0][lane], block.vertex[i][1][lane],
                 block.vertex[i][2][lane]};
  Point<f64> twice = cross(corner[1] - corner[0], corner[2] - corner[0]);
  double normal[3] = {twice.x / 2, twice.y / 2, twice.z / 2};
  sums.area = std::sqrt(normal[0] * normal[0] + normal[1] * normal[1] +
                        normal[2] * normal[2]);
  // Absent triangles are NaN.
  if (!(sums.area > 0))
    return {};
  for (int i = 0; i < 3; ++i) {
    double center = 0;
    for (int c = 0; c < 3; ++c)
      center += double(block.vertex[c][i][lane]) / 3;
    sums.center[i] = sums.area * center;
    sums.normal[i] = normal[i];
    for (int j = 0; j < 3; ++j)
      sums.tensor[i][j] = center * normal[j];
  }
  return sums;
}

static Sums sumBlock(const TriangleBlock &block) {
  Sums sums;
  for (int lane = 0; lane < width; ++lane)
    sums.add(sumTriangle(block, lane));
  return sums;
}

/// Writes down a child about its center, with the radius that its bounds have.
static void write(Moments &moments, int child, const Sums &sums,
                  const Node &node) {
  double center[3], squared = 0;
  for (int i = 0; i < 3; ++i) {
    double low = node.low[i][child], high = node.high[i][child];
    center[i] = sums.area > 0 ? sums.center[i] / sums.area : low;
    double reach = std::max(center[i] - low, high - center[i]);
    squared += reach * reach;
    moments.center[i][child] = float(center[i]);
    moments.normal[i][child] = float(sums.normal[i]);
  }
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      moments.tensor[i][j][child] =
          float(sums.tensor[i][j] - center[i] * sums.normal[j]);
  moments.squared[child] = float(squared) * 1.00001f;
}

std::vector<Moments>
warp::geometry::findMoments(const Hierarchy<TriangleBlock> &tree) {
  const std::vector<Node> &nodes = tree.nodes();
  std::vector<Moments> moments(nodes.size());
  std::vector<Sums> sums(nodes.size());
  for (size_t index = nodes.size(); index-- > 0;) {
    const Node &node = nodes[index];
    for (u32 rest = node.children(); rest; rest &= rest - 1) {
      int child = lowestBit(rest);
      Sums part = node.nodes >> child & 1
                      ? sums[node.nodeAt(child)]
                      : sumBlock(tree.leaves()[node.blockAt(child)]);
      write(moments[index], child, part, node);
      sums[index].add(part);
    }
  }
  return moments;
}
