//===- RaySearch.h - Ray traversal by one GPU thread ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds what wide/RaySearch.h finds: triangles are tested with the same
// roundings. A ray that goes on alone waits for memory, so what stays of a node
// is kept with where it leads: nothing is read twice.
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

#include "RayBoxes.h"
#include "RayTriangle.h"
#include "Team.h"

namespace warp::geometry::scalar {

template <class Team> class RaySearchBy {
public:
  RaySearchBy(const Tree &tree, const Ray &from, f32 limit, bool any)
      : nodes((Bytes)tree.nodes), blocks((Bytes)tree.blocks), any(any),
        ray(from), boxes(from), t(limit) {
    setReach();
  }

  RayHit run(i32 root) {
    SlabMemory slabs;
    boxes.keepIn(slabs);
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
    if (place < 0)
      return {-1, 0, 0, t};
    // The weights once more, which would take registers all the way.
    Bytes triangle = triangleAt(blocks, place);
    RayOnTriangle on = testTriangle(ray, triangle);
    weights = on.sum();
    return {faceAt(triangle), on.u / weights, on.v / weights, t};
  }

  bool leavesThroughFront() const { return weights < 0; }

private:
  /// The position of a thread that takes up what it left.
  static constexpr i32 elsewhere = nowhere + 1;

  /// Bounds are rounded, and those of ties are to be seen.
  void setReach() { reach = lower(integerOf(t) + 40, 0x7f7fffff); }

  Bytes nodeAt(i32 index) const {
    return nodes + i64(index) * i64(sizeof(Node));
  }

  /// The next position after a node, or after what was left.
  i32 goOn(i32 at, Rests &rests) {
    i32 to = at < 0 ? nowhere : enter(nodeAt(at), rests);
    if (Rest rest; to == nowhere && rests.take(reach | 7, rest))
      to = rest.to;
    return to;
  }

  /// Leaves the children that are met for later, but the nearest, which it
  /// gives.
  i32 enter(Bytes node, Rests &rests) {
    Links links(node);
    i32 entry[width];
    u32 met = boxes.meet(node, reach, entry) & links.children();
    if (!met)
      return nowhere;
    u32 nearest = u32(lowestBit(met));
    // Most often there is one.
    if (met & (met - 1))
      nearest = leaveOthers(entry, met, links, rests);
    return links.follow(nearest);
  }

  /// Leaves the furthest child, again and again, until one is there.
  static u32 leaveOthers(const i32 (&entry)[width], u32 met, const Links &links,
                         Rests &rests) {
    for (;;) {
      i32 furthest = -1;
#pragma unroll
      for (int child = 0; child < width; ++child)
        furthest = upper(furthest,
                         met >> child & 1 ? (entry[child] & ~7) | child : -1);
      u32 child = furthest & 7;
      met &= ~(1u << child);
      if (!met)
        return child;
      rests.leave({furthest, links.follow(child)});
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
      keep(on.parameter(ray), number);
    }
  }

  /// Keeps what is met at a parameter if it is first.
  void keep(f32 at, i32 number) {
    if (!(at >= 0 && at <= t))
      return;
    // Faces are compared only then: a thread would wait for their numbers.
    if (at == t && !(place >= 0 && faceOf(number) < faceOf(place)))
      return;
    t = at;
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
    if (rest.to < 0)
      return ~rest.to;
    rests.leave(rest);
    return nowhere;
  }

  /// Tests triangles of the blocks at which some lanes of the warp are, each
  /// team those of one. A lane that is alone, as one whose ray goes through a
  /// corner of many slivers, has several blocks tested at once.
  void visitTogether(Team team, Rests &rests, i32 index, u32 visitors) {
    bool isAlone = !(visitors & (visitors - 1));
#pragma unroll 1
    while (visitors) {
      team.sync();
      // Lanes whose turn it is, and when this one's is.
      u32 theirs = visitors;
      for (int i = 1; i < Team::teams && !isAlone; ++i)
        theirs &= theirs - (i <= team.number());
      bool isMine = visitors >> team.lane() & 1;
      int turn = countBits(visitors & ((1u << team.lane()) - 1));
      for (int i = 0; i < Team::teams; ++i)
        visitors &= visitors - 1;

      int visitor = lowestBit(theirs) & 31;
      // Teams have the visitor's own block, or one of those that are next.
      i32 given = index, block = team.from(given, visitor);
#pragma unroll 1
      for (int i = 1; i < Team::teams; ++i) {
        if (isAlone)
          given = isMine && given != nowhere ? takeBlock(rests) : nowhere;
        i32 next = team.from(given, visitor);
        block = isAlone && i <= team.number() ? next : block;
      }
      ShearedRay other;
      for (int i = 0; i < 3; ++i) {
        other.start[i] = floatOf(team.from(integerOf(ray.start[i]), visitor));
        other.shear[i] = floatOf(team.from(integerOf(ray.shear[i]), visitor));
      }
      other.axes = team.from(ray.axes, visitor);
      f32 limit = floatOf(team.from(integerOf(t), visitor));
      i32 number = width * block + team.rank();
      Bytes triangle = triangleAt(blocks, number);
      f32 at = 0;
      bool isMet = false;
      u32 face = noKey;
      if (theirs && block != nowhere) {
        RayOnTriangle on = testTriangle(other, triangle);
        face = u32(faceAt(triangle));
        at = on.parameter(other);
        isMet = on.isMet() && at >= 0 && at <= limit;
      }
      auto least = [&](u32 value) {
        value = team.least(isMet ? value : noKey);
        u32 ofAll = team.leastOfTeams(value);
        return isAlone ? ofAll : value;
      };
      // Zeros of both signs are equal.
      u32 key = u32(integerOf(at)) & 0x7fffffff;
      isMet &= key == least(key);
      isMet &= face == least(face);

      u32 found = team.where(isMet);
      int finder = lowestBit(found) & 31;
      if (!isAlone) {
        found = found >> (8 * turn & 31) & 0xff;
        finder = (8 * turn + lowestBit(found)) & 31;
      }
      at = floatOf(team.from(integerOf(at), finder));
      number = team.from(number, finder);
      if (isMine && turn < Team::teams && found)
        keep(at, number);
    }
  }

  Bytes nodes, blocks;
  bool any;
  ShearedRay ray;
  RayBoxes boxes;
  /// The parameter of the triangle that is met, or the limit.
  f32 t;
  i32 place = -1;
  /// The sum of its weights, whose sign is the side.
  f32 weights = 1;
  /// Children beyond are behind it; bits of a number.
  i32 reach;
};

#ifdef WARP_TEAMS
using RaySearch = RaySearchBy<Octet>;
#else
using RaySearch = RaySearchBy<Single>;
#endif

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_RAYSEARCH_H
