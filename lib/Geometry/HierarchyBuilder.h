//===- HierarchyBuilder.h - BVH construction on the host --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A builder decides which primitives share a block and which blocks a node; it
// writes no bounds. `refit` does that for a new hierarchy as for one whose
// primitives moved.
//
// Ranges of primitives are split in two by the surface area heuristic over 16
// bins of centroids, and the largest of them again until a node has eight
// children; the cost of a range is what its blocks cost, so ranges tend to be
// full blocks. Where levels run out, ranges are halved, which always fits.
//
// Improper primitives, which a refit may make proper, have branches of their
// own. No search enters these while they are improper.
//
// The top is built by the caller and everything below it in parallel, each part
// in memory of its own; the parts are joined in their order, so the result does
// not depend on the number of threads.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_HIERARCHYBUILDER_H
#define WARP_LIB_GEOMETRY_HIERARCHYBUILDER_H

#include "DeviceLib/geometry/Tree.h"

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

namespace warp::geometry {

struct Bounds {
  float low[3] = {infinity, infinity, infinity};
  float high[3] = {-infinity, -infinity, -infinity};

  void include(const float *point) {
    for (int i = 0; i < 3; ++i) {
      low[i] = point[i] < low[i] ? point[i] : low[i];
      high[i] = point[i] > high[i] ? point[i] : high[i];
    }
  }
  void include(const Bounds &other) {
    include(other.low);
    include(other.high);
  }
  /// Neither empty nor inverted, no NaN. Sides may be infinite.
  bool isProper() const;
  /// The bounds that decide about the place in the hierarchy and about the
  /// scale: an infinite side is at the opposite one, or at 0.
  Bounds finite() const;
  /// Half the surface.
  float area() const {
    float x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
    return x * y + y * z + z * x;
  }
};

/// A primitive while its place is looked for.
struct BuildPrimitive {
  Bounds bounds;
  /// With all bits flipped, and so negative, if the primitive is not proper.
  int32_t id;
  int32_t group;

  /// One that is not proper; it counts as a point at the origin.
  static BuildPrimitive improper(int32_t id, int32_t group) {
    return {{{0, 0, 0}, {0, 0, 0}}, ~id, group};
  }
  bool isProper() const { return id >= 0; }
};

/// Nodes without bounds, and the ids of blocks (-1: no primitive).
struct Topology {
  /// A part of the nodes, and of no other part's; refitted on its own.
  struct Part {
    int32_t root;
    int32_t firstNode, endNode;
    int32_t firstBlock, endBlock;
  };
  std::vector<Node> nodes;
  std::vector<Ints> blocks;
  /// The nodes below the top, whose own come first.
  std::vector<Part> parts;
  int32_t topNodes = 0, topBlocks = 0;
  int depth = 0;
  /// Bounds of all proper primitives.
  Bounds bounds;
  /// Numbers of groups in ascending order, and the nodes that hold them.
  std::vector<int32_t> groups, groupRoots;
};

enum class Splitting { Area, Median };

/// Takes the primitives apart; their order changes. With groups, each has a
/// node of its own over all its primitives.
Topology buildTopology(std::vector<BuildPrimitive> &primitives,
                       Splitting splitting, bool hasGroups = false);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_HIERARCHYBUILDER_H
