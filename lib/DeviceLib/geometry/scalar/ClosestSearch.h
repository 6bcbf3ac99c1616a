//===- ClosestSearch.h - Closest-point traversal on GPUs --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/ClosestSearch.h finds: triangles are compared with the same
// roundings. Triangles of a block that are certainly too far are skipped first.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H

#include "../Closest.h"
#include "Team.h"

namespace warp::geometry::scalar {

/// The squared distance of a segment from the origin, a little too large.
inline f32 squareToSegment(Point<f32> start, Point<f32> along, f32 length2) {
  f32 t = lower(upper(-dot(start, along) * roughInverse(length2), 0.0f), 1.0f);
  Point<f32> at = start.along(t, along);
  return dot(at, at);
}

/// True if `closestOnTriangle` may give this squared distance or less; in a
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

/// The query and its result.
struct ClosestQuery {
  f32 p[3];
  /// A squared distance; smaller ones are found.
  f32 best;
  /// A face, or -1; `lane` of `block` is its triangle.
  i32 face = -1, block = 0, lane = 0;
};

/// The searches of a team's lanes, one after the other. On each level of the
/// way down are the children that are left; the nearest is next. A block costs
/// more than the way to one, so a team waits at its block until another one is
/// at a block, too, or none can go on.
template <class Team> class ClosestByTeam {
public:
  ClosestByTeam(Team team, Bytes nodes, Bytes blocks, i32 root,
                ClosestQuery &mine)
      : team(team), nodes(nodes), blocks(blocks), root(root), mine(mine) {}

  /// All teams go through this loop together, each at a place of its own.
  void run() {
    Rest left[maxDepth][own];
    u32 searching = 0;
    for (;;) {
      if (team.where(isIdle() && rank < Team::lanes)) {
        begin();
        searching = team.where(rank < Team::lanes);
        if (!searching)
          return;
      }
      if (next >= 0)
        enter(next, left[++depth]);
      bool isWaiting = isAtBlock(), looks = depth >= 0 && !isWaiting;
      Rest(&level)[own] = left[depth < 0 ? 0 : depth];
      Rest nearest = looks ? leastOf(level) : Rest{i32(noKey), nowhere};
      u32 key = team.least(u32(nearest.key));
      int child = key & 7;
      i32 to = team.of(nearest.to, child % Team::lanes);
      bool isNear = key <= farthest, isLeft = false;
      next = isNear ? to : isWaiting ? next : nowhere;
      if (isNear) {
        bool isTaken = child % Team::lanes == team.rank();
        if (isTaken)
          level[child / Team::lanes].key = i32(noKey);
        // Values in registers need not be read again.
        if constexpr (own == 1)
          isLeft = !isTaken && u32(nearest.key) <= farthest;
        else
          isLeft = u32(leastOf(level).key) <= farthest;
      }
      // Nobody comes back to a level that has nothing left.
      if (!team.with(isLeft) && looks)
        --depth;
      u32 visitors = team.where(isAtBlock());
      if (countBits(visitors) < 2 * Team::lanes && visitors != searching)
        continue;
      visit(isAtBlock());
      if (isAtBlock())
        next = nowhere;
    }
  }

private:
  /// Children of a node, and triangles of a block, that a lane has.
  static constexpr int own = width / Team::lanes;

  bool isIdle() const { return depth < 0 && next == nowhere; }
  bool isAtBlock() const { return next < 0 && next != nowhere; }
  void setFarthest() { farthest = __builtin_bit_cast(u32, query.best) | 7; }
  Bytes nodeAt(i32 index) const {
    return nodes + i64(index) * i64(sizeof(Node));
  }
  static Rest leastOf(const Rest (&level)[own]) {
    Rest least = level[0];
#pragma unroll 1
    for (int i = 1; i < own; ++i)
      least = u32(level[i].key) < u32(least.key) ? level[i] : least;
    return least;
  }

  /// Teams without a search keep what they found and take the next one.
  void begin() {
    bool isNew = isIdle() && rank < Team::lanes;
    if (isNew && rank == team.rank())
      mine = query;
    rank += isNew;
    u32 start = team.of(u32(root), rank);
    ClosestQuery other;
    for (int axis = 0; axis < 3; ++axis)
      other.p[axis] = floatOf(team.of(integerOf(mine.p[axis]), rank));
    other.best = floatOf(team.of(integerOf(mine.best), rank));
    if (!isNew || rank == Team::lanes)
      return;
    query = other;
    next = i32(start);
    setFarthest();
  }

  /// Finds how far children are.
  void enter(i32 index, Rest (&level)[own]) {
    Bytes node = nodeAt(index);
    Links links(node);
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
                           0.0f);
        squared = axis == 2 ? offset * offset : fma(offset, offset, squared);
      }
      bool isThere = links.children() >> child & 1;
      u32 key = isThere ? keyOf(squared, u32(child)) : noKey;
      level[i] = {i32(key), links.follow(u32(child))};
    }
  }

  /// Compares the triangles of blocks, of those teams that are at one.
  void visit(bool isAtBlock) {
#pragma unroll 1
    for (int i = 0; i < own; ++i)
      compare(~next, i * Team::lanes + team.rank(), isAtBlock);
  }

  /// A triangle of each lane.
  void compare(i32 index, int lane, bool isNear) {
    Bytes at = blocks + i64(index) * i64(sizeof(TriangleBlock)) + 4 * lane;
    auto corner = [&](int i) -> Point<f32> {
      Bytes from = at + 3 * i * int(sizeof(Floats));
      return {load<f32>(from) - query.p[0],
              load<f32>(from + int(sizeof(Floats))) - query.p[1],
              load<f32>(from + 2 * int(sizeof(Floats))) - query.p[2]};
    };
    Point<f32> a{}, b{}, c{};
    if (isNear) {
      a = corner(0), b = corner(1), c = corner(2);
      // Not what is not there.
      isNear = a.x == a.x && mayBeWithin(a, b, c, query.best);
    }
    // Most blocks have no triangle that is.
    if (!team.where(isNear))
      return;
    u32 mine = noKey;
    if (isNear) {
      f32 squared = closestOnTriangle(a, b, c).squared;
      if (squared <= query.best)
        mine = __builtin_bit_cast(u32, squared);
    }
    u32 least = team.least(mine);
    bool isCloser = least != noKey;
    if (!team.where(isCloser))
      return;
    bool isLeast = isCloser && mine == least;
    u32 id = noKey;
    if (isLeast)
      id = u32(load<i32>(at + 9 * int(sizeof(Floats))));
    u32 first = team.least(id);
    u32 winner = team.with(isLeast && id == first);
    if (!isCloser || (least == __builtin_bit_cast(u32, query.best) &&
                      !(i32(first) < query.face)))
      return;
    query.best = __builtin_bit_cast(f32, least);
    query.face = i32(first);
    query.block = index;
    query.lane = lane - team.rank() + int(lowestBit(winner));
    setFarthest();
  }

  Team team;
  Bytes nodes, blocks;
  i32 root;
  /// This lane's query, and the query that its team searches for.
  ClosestQuery &mine, query;
  /// Whose search it is, on which level it is, and where it goes on.
  int rank = -1, depth = -1;
  i32 next = nowhere;
  /// Keys above this one are too far by now.
  u32 farthest = 0;
};

class ClosestSearch {
public:
  ClosestSearch(const Tree &tree, Point<f32> p, f32 bound2)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks),
        query{{p.x, p.y, p.z}, bound2} {}

  /// A face with a smaller squared distance than the bound, or -1; `lane` of
  /// `block` is its triangle.
  i32 run(i32 root) {
#ifdef WARP_TEAMS
    if (Octet::areAllHere() && Octet().areSame(nodes))
      runWith(Octet(), root);
    else
      runWith(Single(), root);
#else
    runWith(Single(), root);
#endif
    block = query.block;
    lane = query.lane;
    return query.face;
  }

  i32 block = 0, lane = 0;

private:
  template <class Team> void runWith(Team team, i32 root) {
    ClosestByTeam<Team>(team, nodes, blocks, root, query).run();
  }

  Bytes nodes, blocks;
  ClosestQuery query;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_CLOSESTSEARCH_H
