//===- TileRings.h - Pipelined products with TMA loads ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// TMA (PTX ISA, asynchronous bulk copies) loads boxes of arrays that have
// tensor maps (warp/TensorMaps.h) into the stages of a multi-buffer in shared
// memory. Each stage has two barriers of 8 bytes: `full` ends a phase when all
// bytes of a step have arrived, `empty`, behind those of all stages, when every
// team of threads has read them. The first thread issues the loads. Threads
// wait for data and for free stages, and within the loop never for each other.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_NVIDIA_TILERINGS_H
#define WARP_DEVICELIB_NVIDIA_TILERINGS_H

#include "TileSums.h"

namespace {

/// A condition that holds for all threads of a warp or for none, in a way that
/// the assembler sees, too, where kernels call.
WARP_INLINE bool holdsForAll(bool condition) {
  if (!isCalled)
    return condition;
  i32 holds;
  asm volatile("{\n"
               ".reg .pred p, q;\n"
               "setp.ne.s32 p, %1, 0;\n"
               "vote.sync.all.pred q, p, -1;\n"
               "selp.s32 %0, 1, 0, q;\n"
               "}"
               : "=r"(holds)
               : "r"(i32(condition)));
  return holds != 0;
}

/// Copies that have arrived are seen by matrix instructions of threads that
/// meet afterwards.
WARP_INLINE void publishCopies() {
  asm volatile("fence.proxy.async.shared::cta;" ::: "memory");
}

/// Until all products of warpgroups but the last ones are there.
template <int last> WARP_INLINE void awaitProducts() {
  asm volatile("wgmma.wait_group.sync.aligned %0;" ::"n"(last) : "memory");
}

/// A factor: its first stage, the array's tensor map, and the offsets of its
/// boxes, at first and from step to step.
struct TmaFactor {
  u64 place, map;
  i32 row, column, rowStep, columnStep;
  /// The extents of a TMA tile.
  i32 width;
  /// The layout of a step in memory.
  i32 rows, columns, size;

  WARP_INLINE i32 bytes() const { return rows * columns * size; }
  WARP_INLINE u64 at(i32 number) const { return place + number * bytes(); }
  WARP_INLINE void copy(i32 step, i32 number, u32 full) const {
    for (i32 first = 0; first < columns; first += width)
      asm volatile(
          "cp.async.bulk.tensor.2d.shared::cluster.global.tile"
          ".mbarrier::complete_tx::bytes [%0], [%1, {%2, %3}], [%4];" ::"r"(
              u32(at(number)) + first * rows * size),
          "l"(map), "r"(column + step * columnStep + first),
          "r"(row + step * rowStep), "r"(full)
          : "memory");
  }
};

struct Ring {
  u32 barriers;
  i32 places;

  WARP_INLINE u32 full(i32 place) const { return barriers + 8 * place; }
  WARP_INLINE u32 empty(i32 place) const { return full(places + place); }

  /// Before a barrier: so many teams will say that they have read a place.
  WARP_INLINE void open(i32 teams) const {
    if (threadNumber() != 0)
      return;
#pragma clang loop unroll(disable)
    for (i32 i = 0; i < 2 * places; ++i)
      asm volatile("mbarrier.init.shared::cta.b64 [%0], %1;" ::"r"(full(i)),
                   "r"(i < places ? 1 : teams)
                   : "memory");
    asm volatile("fence.mbarrier_init.release.cluster;" ::: "memory");
  }
  /// When threads have met for the last time.
  WARP_INLINE void close() const {
    if (threadNumber() != 0)
      return;
#pragma clang loop unroll(disable)
    for (i32 i = 0; i < 2 * places; ++i)
      asm volatile("mbarrier.inval.shared::cta.b64 [%0];" ::"r"(full(i))
                   : "memory");
  }
  /// Asks for what a step needs.
  WARP_INLINE void fill(i32 place, i32 step, const TmaFactor &a,
                        const TmaFactor &b) const {
    asm volatile("mbarrier.arrive.expect_tx.shared::cta.b64 _, [%0], %1;" ::"r"(
                     full(place)),
                 "r"(a.bytes() + b.bytes())
                 : "memory");
    a.copy(step, place, full(place));
    b.copy(step, place, full(place));
  }
  /// Until a barrier has ended a phase, which count 0, 1, 0, ...
  WARP_INLINE void await(u32 barrier, i32 phase) const {
    asm volatile("{\n"
                 ".reg .pred done;\n"
                 "again:\n"
                 "mbarrier.try_wait.parity.shared::cta.b64 done, [%0], %1;\n"
                 "@!done bra again;\n"
                 "}" ::"r"(barrier),
                 "r"(phase)
                 : "memory");
  }
  /// A team of so many threads has read a place.
  template <int team> WARP_INLINE void leave(i32 place) const {
    if (team == warpSize)
      syncWarp();
    if (u32(threadNumber()) % team == 0)
      asm volatile(
          "mbarrier.arrive.shared::cta.b64 _, [%0];" ::"r"(empty(place))
          : "memory");
  }
};

/// Adds the products of all steps to sums. Each step waits for its factors and
/// multiplies; warpgroups begin to, and wait for the products of the step
/// before. When all teams have those, the first thread fills that step's place
/// again.
template <class Sum, int slots, bool byWarpgroups, class Multiply>
WARP_INLINE void runRing(u64 sums, Ring ring, i32 steps, const TmaFactor &a,
                         const TmaFactor &b, i32 threads, Multiply multiply) {
  constexpr int team = byWarpgroups ? 128 : warpSize;
  bool isFirst = threadNumber() == 0;
  Sum held[slots];
#pragma unroll
  for (int i = 0; i < slots; ++i)
    held[i] = own<Sum>(sums)[i];
  syncThreads();
  ring.open(threads / team);
  publishCopies();
  syncThreads();
  if (isFirst)
#pragma clang loop unroll(disable)
    for (i32 step = 0; step < steps && step < ring.places; ++step)
      ring.fill(step, step, a, b);
  // The parities of this step, and of the one before.
  i32 place = 0, phase = 0, lastPlace = 0, lastPhase = 0;
#pragma clang loop unroll(disable)
  for (i32 step = 0; holdsForAll(step < steps); ++step) {
    ring.await(ring.full(place), phase);
    multiply(u64(held), a.at(place), b.at(place));
    if (byWarpgroups)
      awaitProducts<1>();
    else
      ring.leave<team>(place);
    if (holdsForAll(step > 0)) {
      if (byWarpgroups)
        ring.leave<team>(lastPlace);
      i32 next = step + ring.places - 1;
      if (isFirst && next < steps) {
        ring.await(ring.empty(lastPlace), lastPhase);
        ring.fill(lastPlace, next, a, b);
      }
    }
    lastPlace = place;
    lastPhase = phase;
    if (++place == ring.places) {
      place = 0;
      phase ^= 1;
    }
  }
  if (byWarpgroups)
    awaitProducts<0>();
  syncThreads();
  ring.close();
#pragma unroll
  for (int i = 0; i < slots; ++i)
    own<Sum>(sums)[i] = held[i];
}

} // namespace

/// All steps of a loop; of a small tile, some threads of the block hold sums.
/// `multiply` is for factors along, or across, the depth.
#define WARP_RING(name, type, byWarpgroups, slots, aAlong, bAlong, ...)        \
  WARP_TILES warp_tile_stream_##name(                                          \
      u64 sums, u64 ring, i32 places, i32 steps, u64 a, u64 aMap, i32 aRow,    \
      i32 aColumn, i32 aRowStep, i32 aColumnStep, i32 aWidth, u64 b, u64 bMap, \
      i32 bRow, i32 bColumn, i32 bRowStep, i32 bColumnStep, i32 bWidth, i32 m, \
      i32 n, i32 depth, i32 aPitch, i32 bPitch, i32 holders, i32 threads,      \
      void *) {                                                                \
    constexpr i32 size = sizeof(type);                                         \
    TmaFactor left{a,                                                          \
                   aMap,                                                       \
                   aRow,                                                       \
                   aColumn,                                                    \
                   aRowStep,                                                   \
                   aColumnStep,                                                \
                   aWidth,                                                     \
                   aAlong ? m : depth,                                         \
                   aAlong ? depth : m,                                         \
                   size};                                                      \
    TmaFactor right{b,                                                         \
                    bMap,                                                      \
                    bRow,                                                      \
                    bColumn,                                                   \
                    bRowStep,                                                  \
                    bColumnStep,                                               \
                    bWidth,                                                    \
                    bAlong ? n : depth,                                        \
                    bAlong ? depth : n,                                        \
                    size};                                                     \
    runRing<float, slots, byWarpgroups>(                                       \
        sums, {u32(ring), places}, steps, left, right, threads,                \
        [&](u64 held, u64 x, u64 y) {                                          \
          if (holders == threads || threadNumber() < holders)                  \
            __VA_ARGS__(held, x, y, m, n, depth, aPitch, bPitch);              \
        });                                                                    \
  }

#endif // WARP_DEVICELIB_NVIDIA_TILERINGS_H
