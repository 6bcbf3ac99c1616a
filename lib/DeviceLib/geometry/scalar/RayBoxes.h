//===- RayBoxes.h - Ray-box tests of a BVH node -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Nodes are only passed by, so slabs are multiplied and added at once, a little
// wider than they are.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_SCALAR_RAYBOXES_H
#define WARP_DEVICELIB_GEOMETRY_SCALAR_RAYBOXES_H

#include "../Ray.h"
#include "Steps.h"

namespace warp::geometry::scalar {

/// Numbers of a ray that are read from memory at each node.
using SlabMemory = Four[2];

class RayBoxes {
public:
  explicit RayBoxes(const Ray &ray) {
#pragma unroll
    for (int i = 0; i < 3; ++i) {
      // Slabs around a ray that hardly moves last very long.
      bool isAtRest = __builtin_elementwise_abs(ray.direction[i]) < 0x1p-90f;
      inverse[i] = isAtRest ? 0x1p90f : roughInverse(ray.direction[i]);
      f32 at = lower(upper(-ray.start[i] * inverse[i], -0x1p126f), 0x1p126f);
      // The product was rounded, and so will be the sum.
      f32 slack = __builtin_elementwise_abs(at) * 0x1p-22f;
      slack += isAtRest ? 0x1p66f : 0;
      first[i] = at - slack;
      last[i] = at + slack;
      nearer[i] = (inverse[i] < 0 ? 3 + i : i) * int(sizeof(Floats));
    }
  }

  /// Values kept in memory would otherwise take registers all the way, or be
  /// found anew at each node: 21 instructions, where two read it.
  void keepIn(SlabMemory &memory) {
    memory[0] = {first[0], first[1], first[2], last[0]};
    memory[1] = {last[1], last[2], 0, 0};
    kept = memory;
  }

  /// Slots of a node whose boxes are met, and where they are entered; some are
  /// empty. Floats that are not less than zero are ordered as integers are, of
  /// which an instruction compares four. `keepIn` has been called.
  /// reach: the bits of the parameter to which boxes are looked for.
  u32 meet(Bytes node, i32 reach, i32 (&entry)[width]) const {
    Four some = kept[0], others = kept[1];
    f32 firsts[3] = {some[0], some[1], some[2]};
    f32 lasts[3] = {some[3], others[0], others[1]};
    u32 met = 0;
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
          from[i] = integerOf(fma(enters[i][lane], inverse[i], firsts[i]));
          to[i] = integerOf(fma(leaves[i][lane], inverse[i], lasts[i]));
        }
        int child = 4 * half + lane;
        entry[child] = upper(upper(upper(from[0], from[1]), from[2]), 0);
        // A little later, as `reach` is.
        i32 leave = lower(lower(to[0], to[1]), to[2]) + 13;
        leave = upper(lower(leave, reach), 0);
        // The sign of the difference becomes the last bit.
        met = __builtin_elementwise_fshl(met, u32(entry[child] - leave), 1u);
      }
    }
    return met;
  }

private:
  /// Slabs are entered at `plane * inverse + first`, left at `plane * inverse +
  /// last`. The planes that are met first, in bytes.
  f32 inverse[3], first[3], last[3];
  i32 nearer[3];
  const volatile Four *kept;
};

} // namespace warp::geometry::scalar

#endif // WARP_DEVICELIB_GEOMETRY_SCALAR_RAYBOXES_H
