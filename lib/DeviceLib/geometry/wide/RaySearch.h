//===- RaySearch.h - 8-wide ray traversal -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For processors whose registers hold eight floats.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_WIDE_RAYSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_WIDE_RAYSEARCH_H

#include "../Ray.h"

namespace warp::geometry::wide {

/// Finds the first triangle along a ray, or any. Equal parameters go to the
/// lower face.
class RaySearch {
public:
  RaySearch(const Tree &tree, const Ray &ray, f32 limit, bool any)
      : tree(tree), ray(ray), any(any) {
    hit.t = limit;
  }

  RayHit run(i32 root) {
    i32 at = root;
    while (at != nowhere) {
      if (at >= 0) {
        at = enter(at);
        continue;
      }
      visit(~at);
      at = any && hit.face >= 0 ? nowhere : take();
    }
    return hit;
  }

  /// True if the triangle that was met faces away from the start.
  bool leavesThroughFront() const { return away; }

private:
  /// A child, or where it is as `follow` has it, and where it is entered.
  struct Rest {
    i32 to;
    f32 entry;
  };
  /// The word that leads to no child.
  static constexpr i32 nowhere = -0x7fffffff - 1;

  /// Takes up what was left last, if it may be nearer than the hit.
  i32 take() {
    while (count) {
      const Rest &rest = rests[--count];
      // Bounds are rounded, and those of ties are to be seen.
      if (rest.entry <= hit.t * 1.000001f)
        return rest.to;
    }
    return nowhere;
  }

  /// A node, or a block with all bits flipped.
  static i32 follow(const Node &node, int child) {
    return node.blocks >> child & 1 ? ~node.blockAt(child) : node.nodeAt(child);
  }

  /// Gives the nearest child that is met, and leaves the others for later.
  i32 enter(i32 index) {
    const Node &node = tree.nodes[index];
    Floats entry;
    u32 met = meetBoxes(node, ray, hit.t, entry);
    if (!met)
      return take();
    Rest nearest{lowestBit(met), entry[lowestBit(met)]};
    int bottom = count;
    while (met &= met - 1) {
      Rest other{lowestBit(met), entry[lowestBit(met)]};
      if (other.entry < nearest.entry) {
        Rest closer = other;
        other = nearest;
        nearest = closer;
      }
      leave(follow(node, other.to), other.entry, bottom);
    }
    return follow(node, nearest.to);
  }

  /// Leaves a child among those of its node, the nearest last.
  void leave(i32 to, f32 entry, int bottom) {
    int place = count++;
    for (; place > bottom && rests[place - 1].entry < entry; --place)
      rests[place] = rests[place - 1];
    rests[place] = {to, entry};
  }

  void visit(i32 index) {
    const TriangleBlock &block =
        static_cast<const TriangleBlock *>(tree.blocks)[index];
    Meeting meeting = meetTriangles(block, ray);
    Ints closer =
        meeting.isMet & ((meeting.t < hit.t) |
                         ((meeting.t == hit.t) & (block.id < Ints(hit.face))));
    if (!bitsOf(closer))
      return;
    hit.t = leastOf(choose(closer, meeting.t, Floats(infinity)));
    Ints first = closer & (meeting.t == Floats(hit.t));
    hit.face = leastOf(choose(first, block.id, Ints(largestInt)));
    int lane = lowestBit(bitsOf(first & (block.id == Ints(hit.face))));
    hit.u = meeting.u[lane];
    hit.v = meeting.v[lane];
    // Shearing keeps the winding: seen from the start, a face that shows its
    // front has a positive sum of weights.
    away = meeting.weights[lane] < 0;
  }

  const Tree &tree;
  const Ray &ray;
  bool any;
  RayHit hit{-1, 0, 0, 0};
  bool away = false;
  int count = 0;
  Rest rests[maxDepth * (width - 1) + 1];
};

} // namespace warp::geometry::wide

#endif // WARP_DEVICELIB_GEOMETRY_WIDE_RAYSEARCH_H
