//===- TileCopies.cpp - From arrays to the memory of a block --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Copies that run while threads compute (PTX ISA, asynchronous copy): threads
// wait for those of a group before they meet at a barrier. A tile that crosses
// the edge of its array, or whose rows do not lie at multiples of 16 bytes, is
// copied element by element, and is there as soon.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

namespace {

WARP_INLINE void copyChunk(u64 to, u64 from) {
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(u32(to)),
               "l"(from)
               : "memory");
}

template <class T>
WARP_INLINE void fetch(u64 to, const Window &window, i32 pitch, i32 threads) {
  constexpr i32 run = 16 / sizeof(T);
  i32 thread = threadNumber();
  i32 runs = window.columns / run, chunks = window.rows * runs;
  if (window.columns % run == 0 && threads % runs == 0 &&
      window.isAligned(sizeof(T), 16) && window.isInside()) {
    // A thread's rows are so many apart.
    i32 rows = threads / runs, whole = chunks / threads;
    i32 row = u32(thread) / u32(runs), column = u32(thread) % u32(runs) * run;
    u64 from = window.data + i64(window.first[0] + row) * window.step[0] +
               i64(window.first[1] + column) * i64(sizeof(T));
    i64 step = i64(window.step[0]) * rows;
    to += (row * pitch + column) * sizeof(T);
    for (i32 turn = 0; turn < whole; ++turn)
      copyChunk(to + turn * rows * pitch * sizeof(T), from + turn * step);
    if (whole * threads < chunks && whole * threads + thread < chunks)
      copyChunk(to + whole * rows * pitch * sizeof(T), from + whole * step);
    return;
  }
#pragma clang loop unroll(disable)
  for (i32 i = thread; i < window.rows * window.columns; i += threads) {
    i32 row = u32(i) / u32(window.columns);
    i32 column = u32(i) % u32(window.columns);
    T value = 0;
    if (window.has(row, column))
      value = *global<T>(window.at(row, column));
    *shared<T>(to + (row * pitch + column) * sizeof(T)) = value;
  }
}

} // namespace

#define WARP_FETCH(bits)                                                       \
  WARP_TILES warp_tile_fetch_b##bits(                                          \
      u64 to, u64 data, i32 first0, i32 first1, i32 extent0, i32 extent1,      \
      i32 step0, i32 step1, i32 rows, i32 columns, i32 checked, i32 pitch,     \
      i32 threads, void *) {                                                   \
    fetch<u##bits>(to,                                                         \
                   {data,                                                      \
                    {first0, first1},                                          \
                    {extent0, extent1},                                        \
                    {step0, step1},                                            \
                    rows,                                                      \
                    columns,                                                   \
                    checked != 0},                                             \
                   pitch, threads);                                            \
  }
WARP_FETCH(16)
WARP_FETCH(32)

/// What was fetched since the last call is a group.
WARP_TILES warp_tile_close_group(void *) {
  asm volatile("cp.async.commit_group;" ::: "memory");
}

/// Waits until all but the last groups are there.
WARP_TILES warp_tile_await_groups(i32 last, void *) {
  if (last == 0)
    asm volatile("cp.async.wait_group 0;" ::: "memory");
  else if (last == 1)
    asm volatile("cp.async.wait_group 1;" ::: "memory");
  else
    asm volatile("cp.async.wait_group 2;" ::: "memory");
}
