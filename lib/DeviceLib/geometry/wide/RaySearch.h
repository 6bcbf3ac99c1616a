//===- RaySearch.h - Where a ray meets a mesh, eight children at once -----===//
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
    push(root, 0);
    while (count) {
      --count;
      // Bounds are rounded, and those of ties are to be seen.
      if (!(entries[count] <= hit.t * 1.000001f))
        continue;
      if (refs[count] < 0)
        visit(~refs[count]);
      else
        enter(refs[count]);
      if (any && hit.face >= 0)
        break;
    }
    return hit;
  }

  /// Whether the triangle that was met faces away from the start.
  bool leavesThroughFront() const { return away; }

private:
  void push(i32 ref, f32 entry) {
    refs[count] = ref;
    entries[count++] = entry;
  }

  /// Pushes the children that are met, the nearest last.
  void enter(i32 index) {
    const Node &node = tree.nodes[index];
    Floats entry;
    u32 met = meetBoxes(node, ray, hit.t, entry);
    int bottom = count;
    for (; met; met &= met - 1) {
      int child = lowestBit(met);
      i32 ref =
          node.blocks >> child & 1 ? ~node.blockAt(child) : node.nodeAt(child);
      f32 at = entry[child];
      int place = count++;
      for (; place > bottom && entries[place - 1] < at; --place) {
        refs[place] = refs[place - 1];
        entries[place] = entries[place - 1];
      }
      refs[place] = ref;
      entries[place] = at;
    }
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
  i32 refs[maxDepth * (width - 1) + 1];
  f32 entries[maxDepth * (width - 1) + 1];
};

} // namespace warp::geometry::wide

#endif // WARP_DEVICELIB_GEOMETRY_WIDE_RAYSEARCH_H
