//===- RaySearch.h - Where a ray meets a mesh, by one thread of a GPU -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/RaySearch.h finds: triangles are tested with the same
// roundings. Nodes are only passed by, so that slabs are multiplied and added
// at once, a little wider. What stays of a node is kept as keys with the node's
// number; where it leads is read again if it is not behind the hit by then.
//
// Threads of a warp do the same at the same time, so what a thread does alone
// costs as much as what all do: of a block, all triangles are asked on which
// sides of their edges the ray passes, and those that are met, one of most
// blocks, are looked at once more. Where only few threads are at blocks, teams
// of eight test all triangles of one at once, four blocks at a time. So they do
// with four blocks of a ray that is the last one of its warp.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H

#include "RayTriangle.h"
#include "Team.h"

namespace warp::geometry::scalar {

template <class Team> class RaySearchBy {
public:
  RaySearchBy(const Tree &tree, const Ray &from, f32 limit, bool any)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks), any(any),
        ray(from) {
    hit.t = limit;
    setReach();
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      // Where a ray hardly moves, slabs around it last very long.
      bool isAtRest = __builtin_elementwise_abs(from.direction[i]) < 0x1p-90f;
      inverse[i] = isAtRest ? 0x1p90f : roughInverse(from.direction[i]);
      f32 at = lower(upper(-from.start[i] * inverse[i], -0x1p126f), 0x1p126f);
      // The product was rounded, and so will be the sum.
      f32 slack = __builtin_elementwise_abs(at) * 0x1p-22f;
      slack += isAtRest ? 0x1p66f : 0;
      first[i] = at - slack;
      last[i] = at + slack;
      nearer[i] = (inverse[i] < 0 ? 3 + i : i) * int(sizeof(Floats));
    }
  }

  RayHit run(i32 root) {
    Rest memory[maxRests];
    Rests rests(memory);
    Team team;
    bool isShared = team.areAllHere() && team.areSame(nodes);
    i32 at = root;
    for (;;) {
      // Threads of a warp wait here until each is at a block.
      while (at >= 0 || at == elsewhere)
        at = goOn(at, rests);
      bool isAtBlock = at != nowhere;
      u32 visitors = isShared ? team.where(isAtBlock) : isAtBlock;
      if (!visitors)
        break;
      if (isShared && countBits(visitors) <= mostTogether)
        visitTogether(team, rests, ~at, visitors);
      else if (isAtBlock)
        visit(~at);
      if (isAtBlock)
        at = any && place >= 0 ? nowhere : elsewhere;
    }
    if (place >= 0)
      hit.face = faceAt(triangleAt(blocks, place));
    hit.u /= weights;
    hit.v /= weights;
    return hit;
  }

  bool leavesThroughFront() const { return weights < 0; }

private:
  /// Where a thread is that takes up what it left.
  static constexpr i32 elsewhere = nowhere + 1;

  /// Bounds are rounded, and those of ties are to be seen.
  void setReach() { reach = lower(integerOf(hit.t) + 40, 0x7f7fffff); }

  Bytes nodeAt(i32 index) const {
    return nodes + i64(index) * i64(sizeof(Node));
  }

  /// Where to go from a node, or from what was left.
  i32 goOn(i32 at, Rests &rests) {
    Bytes node = nodeAt(at);
    u32 child;
    if (at < 0 || !enter(node, at, rests, child)) {
      Rest rest;
      if (!rests.take(reach | 7, rest))
        return nowhere;
      node = nodeAt(rest.node);
      child = rest.key & 7;
    }
    return Links(node).follow(child);
  }

  /// Leaves the children that are met for later, but the nearest.
  bool enter(Bytes node, i32 index, Rests &rests, u32 &nearest) {
    u32 met = 0;
    i32 entry[width];
#pragma unroll
    for (int half = 1; half >= 0; --half) {
      Four enters[3], leaves[3];
#pragma unroll
      for (int i = 0; i < 3; ++i) {
        enters[i] = load<Four>(node + nearer[i] + 16 * half);
        int further = (2 * i + 3) * int(sizeof(Floats)) - nearer[i];
        leaves[i] = load<Four>(node + further + 16 * half);
      }
#pragma unroll
      for (int lane = 3; lane >= 0; --lane) {
        i32 from[3], to[3];
#pragma unroll
        for (int i = 0; i < 3; ++i) {
          from[i] = integerOf(fma(enters[i][lane], inverse[i], first[i]));
          to[i] = integerOf(fma(leaves[i][lane], inverse[i], last[i]));
        }
        int child = 4 * half + lane;
        // Floats that are not less than zero are ordered as integers are, of
        // which an instruction compares four. Those after them are a little
        // later, as `reach` is.
        entry[child] = upper(upper(upper(from[0], from[1]), from[2]), 0);
        i32 leave = lower(lower(to[0], to[1]), to[2]) + 13;
        leave = upper(lower(leave, reach), 0);
        met = met << 1 | u32(entry[child] - leave) >> 31;
      }
    }
    met &= Links(node).children();
    nearest = u32(lowestBit(met));
    // Most often there is one.
    if (met & (met - 1))
      nearest = leaveOthers(entry, met, index, rests);
    return met != 0;
  }

  /// Leaves the furthest child, again and again, until one is there.
  static u32 leaveOthers(const i32 (&entry)[width], u32 met, i32 index,
                         Rests &rests) {
    for (;;) {
      i32 furthest = -1;
#pragma unroll
      for (int child = 0; child < width; ++child)
        furthest = upper(furthest,
                         met >> child & 1 ? (entry[child] & ~7) | child : -1);
      i32 child = furthest & 7;
      met &= ~(1u << child);
      if (!met)
        return u32(child);
      rests.leave({furthest, index});
    }
  }

  /// Asks which triangles of a block are met, and looks at those.
  void visit(i32 index) {
    Bytes block = blocks + i64(index) * i64(sizeof(TriangleBlock));
    u32 met = 0;
#pragma unroll 1
    for (int half = 0; half < 2; ++half) {
      Four rows[3][3];
#pragma unroll
      for (int i = 0; i < 3; ++i)
#pragma unroll
        for (int axis = 0; axis < 3; ++axis)
          rows[i][axis] = load<Four>(block + ray.place(i, axis) + 16 * half);
#pragma unroll
      for (int lane = 3; lane >= 0; --lane) {
        f32 corner[3][3];
#pragma unroll
        for (int i = 0; i < 3; ++i)
#pragma unroll
          for (int axis = 0; axis < 3; ++axis)
            corner[i][axis] = rows[i][axis][lane];
        met = met << 1 | RayOnTriangle(ray, corner).isMet();
      }
    }
#pragma unroll 1
    for (; met; met &= met - 1) {
      // The halves were asked in their order.
      i32 number = width * index + (lowestBit(met) ^ 4);
      RayOnTriangle on = testTriangle(ray, triangleAt(blocks, number));
      keep({on.u, on.v, on.sum(), on.parameter(ray)}, number);
    }
  }

  /// What a ray meets: weights of two corners, their sum with that of the
  /// third, where.
  struct Meeting {
    f32 u, v, sum, t;
  };

  /// Keeps what is met if it is first.
  void keep(Meeting met, i32 number) {
    if (!(met.t >= 0 && met.t <= hit.t))
      return;
    // Faces are compared only then: a thread would wait for their numbers.
    if (met.t == hit.t && !(place >= 0 && faceOf(number) < faceOf(place)))
      return;
    hit = {-1, met.u, met.v, met.t};
    weights = met.sum;
    place = number;
    setReach();
  }
  i32 faceOf(i32 number) const { return faceAt(triangleAt(blocks, number)); }

  /// So many blocks are not more work for teams than one for each thread.
  static constexpr int mostTogether = 8;

  /// The block that is next of what was left, or none.
  i32 takeBlock(Rests &rests) {
    Rest rest;
    if (!rests.take(reach | 7, rest))
      return nowhere;
    i32 at = Links(nodeAt(rest.node)).follow(rest.key & 7);
    if (at < 0)
      return ~at;
    rests.leave(rest);
    return nowhere;
  }

  /// Which block a team has of a lane that is alone: the first one its own,
  /// others the next ones.
  i32 share(Team team, Rests &rests, i32 index, int loner) {
    i32 next = index, shared = nowhere;
#pragma unroll 1
    for (int i = 0; i < Team::teams; ++i) {
      if (i > 0)
        next = team.lane() == loner ? takeBlock(rests) : nowhere;
      i32 given = team.from(next, loner);
      if (given == nowhere)
        break;
      shared = i == team.number() ? given : shared;
    }
    return shared;
  }

  /// Tests triangles of the blocks at which some lanes of the warp are, each
  /// team those of one. A lane that is alone, as one whose ray goes through a
  /// corner of many slivers, has several blocks tested at once.
  void visitTogether(Team team, Rests &rests, i32 index, u32 visitors) {
    bool isAlone = !(visitors & (visitors - 1));
#pragma unroll 1
    while (visitors) {
      team.meet();
      // Lanes whose turn it is, and when this one's is.
      u32 theirs = visitors;
      for (int i = 1; i < Team::teams && !isAlone; ++i)
        theirs &= theirs - (i <= team.number());
      bool isMine = visitors >> team.lane() & 1;
      int turn = countBits(visitors & ((1u << team.lane()) - 1));
      for (int i = 0; i < Team::teams; ++i)
        visitors &= visitors - 1;

      int visitor = lowestBit(theirs) & 31;
      i32 block = isAlone ? share(team, rests, index, visitor)
                          : i32(team.from(index, visitor));
      ShearedRay other;
      for (int i = 0; i < 3; ++i) {
        other.start[i] = floatOf(team.from(integerOf(ray.start[i]), visitor));
        other.shear[i] = floatOf(team.from(integerOf(ray.shear[i]), visitor));
      }
      other.axes = team.from(ray.axes, visitor);
      f32 limit = floatOf(team.from(integerOf(hit.t), visitor));
      i32 number = width * block + team.rank();
      Bytes triangle = triangleAt(blocks, number);
      Meeting met{0, 0, 0, 0};
      bool isMet = false;
      u32 face = noKey;
      if (theirs && block != nowhere) {
        RayOnTriangle on = testTriangle(other, triangle);
        face = u32(faceAt(triangle));
        met = {on.u, on.v, on.sum(), on.parameter(other)};
        isMet = on.isMet() && met.t >= 0 && met.t <= limit;
      }
      auto least = [&](u32 value) {
        value = team.least(isMet ? value : noKey);
        return isAlone ? team.leastOfTeams(value) : value;
      };
      // Zeros of both signs are equal.
      u32 key = u32(integerOf(met.t)) & 0x7fffffff;
      isMet &= key == least(key);
      isMet &= face == least(face);

      u32 found = team.where(isMet);
      int finder = lowestBit(found) & 31;
      if (!isAlone) {
        found = found >> (8 * turn & 31) & 0xff;
        finder = (8 * turn + lowestBit(found)) & 31;
      }
      met = {floatOf(team.from(integerOf(met.u), finder)),
             floatOf(team.from(integerOf(met.v), finder)),
             floatOf(team.from(integerOf(met.sum), finder)),
             floatOf(team.from(integerOf(met.t), finder))};
      number = team.from(number, finder);
      if (isMine && turn < Team::teams && found)
        keep(met, number);
    }
  }

  Bytes nodes, blocks;
  bool any;
  ShearedRay ray;
  /// The slabs of nodes: entered at `plane * inverse + first`, left at `plane *
  /// inverse + last`. The planes that are met first, in bytes.
  f32 inverse[3], first[3], last[3];
  i32 nearer[3];
  /// Its weights are to be divided by their sum, whose sign is the side.
  RayHit hit{-1, 0, 0, 0};
  i32 place = -1;
  f32 weights = 1;
  /// Children beyond are behind it; bits of a number.
  i32 reach;
};

#ifdef __NVPTX__
using RaySearch = RaySearchBy<Octet>;
#else
using RaySearch = RaySearchBy<Single>;
#endif

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H
