//===- Team.h - Threads that search together ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Eight neighbouring lanes of a warp go through a tree together, for one of
// them after the other: each has a child of the node and a triangle of the
// block. What they read lies side by side, and no lane waits for another one's
// long search but those of its team. Where not all eight are there, each
// searches alone; both find the same.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H

#include "Steps.h"

namespace warp::geometry::scalar {

/// A thread on its own.
struct Single {
  static constexpr int lanes = 1;

  int rank() const { return 0; }
  /// The value of a lane, the least of all lanes, whether any says so.
  u32 of(u32 value, int) const { return value; }
  u32 least(u32 value) const { return value; }
  bool any(bool says) const { return says; }
};

#ifdef __NVPTX__
/// Eight lanes.
class Octet {
public:
  static constexpr int lanes = 8;

  Octet() : lane(__nvvm_read_ptx_sreg_laneid()) {}
  /// Whether they are all here.
  bool isWhole() const {
    u32 here;
    asm volatile("activemask.b32 %0;" : "=r"(here));
    return (here & mask()) == mask();
  }
  int rank() const { return lane & 7; }
  u32 of(u32 value, int rank) const {
    return u32(
        __nvvm_shfl_sync_idx_i32(mask(), i32(value), (lane & ~7) | rank, 31));
  }
  u32 least(u32 value) const {
#pragma unroll
    for (int step = 1; step < lanes; step *= 2) {
      u32 other = u32(__nvvm_shfl_sync_bfly_i32(mask(), i32(value), step, 31));
      value = other < value ? other : value;
    }
    return value;
  }
  bool any(bool says) const { return __nvvm_vote_any_sync(mask(), says); }

private:
  u32 mask() const { return 0xffu << (lane & ~7); }

  int lane;
};
#endif

/// The same of other types.
template <class Team> f32 valueOf(const Team &team, f32 value, int rank) {
  return __builtin_bit_cast(f32, team.of(__builtin_bit_cast(u32, value), rank));
}
template <class Team> Bytes valueOf(const Team &team, Bytes value, int rank) {
  u64 bits = (u64)value;
  u64 high = team.of(u32(bits >> 32), rank);
  return (Bytes)(high << 32 | team.of(u32(bits), rank));
}

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_TEAM_H
