//===- Team.h - Cooperative traversal by several threads --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Eight neighbouring lanes of a warp go through a tree together, for one of
// them after the other: each has a child of the node and a triangle of the
// block. Their reads lie side by side, and no lane waits for another one's
// long search but those of its team. The four teams of a warp come to each
// exchange at once: which lanes take part is known when the kernel is compiled,
// else each exchange would have to find it out. Where a lane is not there, or
// has another tree than its team, all search alone; both find the same.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H

#include "Steps.h"

namespace warp::geometry::scalar {

/// A thread on its own.
struct Single {
  static constexpr int lanes = 1, teams = 1;

  static bool areAllHere() { return false; }
  bool areSame(Bytes) const { return true; }
  int rank() const { return 0; }
  int number() const { return 0; }
  int lane() const { return 0; }
  /// The value of a lane of this team, the least of its lanes and of all teams
  /// (of values that are the same in a team), which lanes say so; the value of
  /// a lane of any team, which lanes of all teams say so.
  u32 of(u32 value, int) const { return value; }
  u32 least(u32 value) const { return value; }
  u32 leastOfTeams(u32 value) const { return value; }
  u32 with(bool says) const { return says; }
  u32 from(u32 value, int) const { return value; }
  u32 where(bool says) const { return says; }
  /// A barrier of all lanes. The code that follows is shorter for it.
  void sync() const {}
};

#ifdef WARP_TEAMS
/// Eight lanes of a warp whose lanes are all here.
class Octet {
public:
  static constexpr int lanes = 8, teams = gpu::warpSize / lanes;

  static bool areAllHere() { return gpu::activeLanes() == gpu::allLanes; }
  /// True if all lanes of all teams have the same.
  bool areSame(Bytes place) const {
    u64 bits = (u64)place;
    u32 low = from(u32(bits), 0), high = from(u32(bits >> 32), 0);
    return !where(low != u32(bits) || high != u32(bits >> 32));
  }
  int rank() const { return lane() & 7; }
  int number() const { return lane() >> 3; }
  int lane() const { return gpu::lane(); }
  u32 of(u32 value, int rank) const {
    return gpu::shuffleWithin<lanes>(value, rank);
  }
  u32 least(u32 value) const { return leastWithin<1, lanes>(value); }
  u32 leastOfTeams(u32 value) const {
    return leastWithin<lanes, gpu::warpSize>(value);
  }
  u32 with(bool says) const { return where(says) >> (lane() & ~7) & 0xff; }
  u32 from(u32 value, int lane) const { return gpu::shuffle(value, lane); }
  u32 where(bool says) const { return gpu::ballot(says); }
  void sync() const { gpu::syncWarp(); }

private:
  template <int from, int to> u32 leastWithin(u32 value) const {
#pragma unroll
    for (int step = from; step < to; step *= 2) {
      u32 other = gpu::shuffleXor(value, step);
      value = other < value ? other : value;
    }
    return value;
  }
};
#endif

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H
