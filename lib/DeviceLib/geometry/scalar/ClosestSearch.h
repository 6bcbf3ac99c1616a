//===- ClosestSearch.h - The closest triangle, by threads of a GPU --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/ClosestSearch.h finds: triangles are compared with the same
// roundings. Those of a block that are too far for sure are left out first.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H

#include "../Closest.h"
#include "Team.h"

namespace warp::geometry::scalar {

/// The squared distance of a segment from the origin, a little too large.
inline f32 squareToSegment(Point<f32> start, Point<f32> along, f32 length2) {
  f32 t = lower(upper(-dot(start, along) * roughInverse(length2), 0), 1);
  Point<f32> at = start.along(t, along);
  return dot(at, at);
}

/// Whether `closestOnTriangle` may give this squared distance or less; in a
/// third of its time. Feet are found with rough quotients, so that points of
/// edges are off by 2^-20 of the triangle's size, and its plane's distance by
/// as much of that of its corners. The foot in the plane counts as inside when
/// roundings may have moved it out: it is never too far.
inline bool mayBeWithin(Point<f32> a, Point<f32> b, Point<f32> c, f32 best) {
  Point<f32> ab = b - a, ac = c - a, bc = c - b;
  f32 ab2 = dot(ab, ab), ac2 = dot(ac, ac);
  f32 squared = lower(squareToSegment(a, ab, ab2), squareToSegment(a, ac, ac2));
  squared = lower(squared, squareToSegment(b, bc, dot(bc, bc)));
  Point<f32> normal = cross(ab, ac);
  f32 area2 = dot(normal, normal), height = dot(normal, a);
  f32 abac = dot(ab, ac), aab = dot(a, ab), aac = dot(a, ac);
  f32 second = abac * aac - ac2 * aab, third = abac * aab - ab2 * aac;
  f32 sizes = __builtin_elementwise_abs(abac) + ac2 + ab2;
  f32 slack = sizes * 0x1p-18f *
              (__builtin_elementwise_abs(aac) + __builtin_elementwise_abs(aab));
  bool isInside =
      second >= -slack && third >= -slack && second + third <= area2 + slack;
  f32 plane = height * height * roughInverse(area2);
  squared = isInside ? lower(squared, plane) : squared;
  // Not `>`: what is no number is looked at.
  return !(squared * 0x1.fffcp-1f > fma(ab2 + ac2, 0x1p-26f, best));
}

/// What is searched, and what is found.
struct ClosestQuery {
  Bytes nodes, blocks;
  f32 p[3];
  /// A squared distance; smaller ones are found.
  f32 best;
  i32 root = 0;
  /// A face, or -1; `lane` of `block` is its triangle.
  i32 face = -1, block = 0, lane = 0;
};

/// The search of a team. On each level of the way down it keeps the keys of the
/// children that are left; the nearest is next.
template <class Team> class ClosestByTeam {
public:
  ClosestByTeam(Team team, ClosestQuery &query) : team(team), query(query) {
    setFarthest();
  }

  void run() {
    u32 keys[maxDepth][own];
    i32 path[maxDepth];
    i32 depth = 0;
    path[0] = query.root;
    Bytes node = enter(query.root, keys[0]);
    for (;;) {
      u32 key = noKey;
#pragma unroll 1
      for (int i = 0; i < own; ++i)
        key = keys[depth][i] < key ? keys[depth][i] : key;
      key = team.least(key);
      if (key > farthest) {
        if (depth == 0)
          return;
        --depth;
        node = nodeAt(path[depth]);
        continue;
      }
      int child = key & 7;
      if (child % Team::lanes == team.rank())
        keys[depth][child / Team::lanes] = noKey;
      i32 next = Links(node).follow(child);
      if (next < 0) {
        visit(~next);
        continue;
      }
      ++depth;
      path[depth] = next;
      node = enter(next, keys[depth]);
    }
  }

private:
  /// Children of a node, and triangles of a block, that a lane has.
  static constexpr int own = width / Team::lanes;

  void setFarthest() { farthest = __builtin_bit_cast(u32, query.best) | 7; }
  Bytes nodeAt(i32 index) const {
    return query.nodes + i64(index) * i64(sizeof(Node));
  }

  /// Finds how far children are.
  Bytes enter(i32 index, u32 (&keys)[own]) {
    Bytes node = nodeAt(index);
    u32 children = Links(node).children();
#pragma unroll 1
    for (int i = 0; i < own; ++i) {
      int child = i * Team::lanes + team.rank();
      f32 squared = 0;
#pragma unroll
      for (int axis = 2; axis >= 0; --axis) {
        Bytes low = node + axis * int(sizeof(Floats)) + 4 * child;
        Bytes high = low + 3 * int(sizeof(Floats));
        f32 offset = upper(upper(load<f32>(low) - query.p[axis],
                                 query.p[axis] - load<f32>(high)),
                           0);
        squared = axis == 2 ? offset * offset : fma(offset, offset, squared);
      }
      keys[i] = children >> child & 1 ? keyOf(squared, child) : noKey;
    }
    return node;
  }

  void visit(i32 index) {
    Bytes block = query.blocks + i64(index) * i64(sizeof(TriangleBlock));
#pragma unroll 1
    for (int i = 0; i < own; ++i)
      compare(block, index, i * Team::lanes + team.rank());
  }

  /// A triangle of each lane.
  void compare(Bytes block, i32 index, int lane) {
    Bytes at = block + 4 * lane;
    auto corner = [&](int i) -> Point<f32> {
      Bytes from = at + 3 * i * int(sizeof(Floats));
      return {load<f32>(from) - query.p[0],
              load<f32>(from + int(sizeof(Floats))) - query.p[1],
              load<f32>(from + 2 * int(sizeof(Floats))) - query.p[2]};
    };
    Point<f32> a = corner(0), b = corner(1), c = corner(2);
    // Not what is not there.
    bool isNear = a.x == a.x && mayBeWithin(a, b, c, query.best);
    // Most blocks have no triangle that is.
    if (!team.any(isNear))
      return;
    u32 mine = noKey;
    if (isNear) {
      f32 squared = closestOnTriangle(a, b, c).squared;
      if (squared <= query.best)
        mine = __builtin_bit_cast(u32, squared);
    }
    u32 least = team.least(mine);
    if (least == noKey)
      return;
    u32 id = noKey;
    if (mine == least)
      id = u32(load<i32>(at + 9 * int(sizeof(Floats))));
    u32 first = team.least(id);
    if (least == __builtin_bit_cast(u32, query.best) &&
        !(i32(first) < query.face))
      return;
    query.best = __builtin_bit_cast(f32, least);
    query.face = i32(first);
    query.block = index;
    query.lane = i32(team.least(id == first ? u32(lane) : noKey));
    setFarthest();
  }

  Team team;
  ClosestQuery &query;
  /// Keys above this one are too far by now.
  u32 farthest;
};

/// Searches for each thread of a team.
template <class Team> void findForEach(Team team, ClosestQuery &query) {
#pragma unroll 1
  for (int rank = 0; rank < Team::lanes; ++rank) {
    ClosestQuery one = query;
    one.nodes = valueOf(team, query.nodes, rank);
    one.blocks = valueOf(team, query.blocks, rank);
    for (int axis = 0; axis < 3; ++axis)
      one.p[axis] = valueOf(team, query.p[axis], rank);
    one.best = valueOf(team, query.best, rank);
    one.root = i32(team.of(u32(query.root), rank));
    ClosestByTeam<Team>(team, one).run();
    if (rank != team.rank())
      continue;
    query.face = one.face;
    query.block = one.block;
    query.lane = one.lane;
  }
}

class ClosestSearch {
public:
  ClosestSearch(const Tree &tree, Point<f32> p, f32 bound2)
      : query{(Bytes)tree.nodes, (Bytes)tree.blocks, {p.x, p.y, p.z}, bound2} {}

  /// A face with a smaller squared distance than the bound, or -1; `lane` of
  /// `block` is its triangle.
  i32 run(i32 root) {
    query.root = root;
#ifdef __NVPTX__
    if (Octet octet; octet.isWhole())
      findForEach(octet, query);
    else
      findForEach(Single(), query);
#else
    findForEach(Single(), query);
#endif
    block = query.block;
    lane = query.lane;
    return query.face;
  }

  i32 block = 0, lane = 0;

private:
  ClosestQuery query;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
