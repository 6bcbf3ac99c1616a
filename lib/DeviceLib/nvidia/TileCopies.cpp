//===- TileCopies.cpp - Asynchronous copies to shared memory --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Copies that run while threads compute (PTX ISA, asynchronous copy): threads
// wait for those of a group before they meet at a barrier. A tile that crosses
// the edge of its array, or whose rows do not lie at multiples of 16 bytes, is
// copied element by element, those of 4 and 8 bytes asynchronously as well.
//
//===----------------------------------------------------------------------===//

#include "../gpu/Tiles.h"

namespace {

WARP_INLINE void copyChunk(u64 to, u64 from) {
  asm volatile("cp.async.cg.shared.global [%0], [%1], 16;" ::"r"(u32(to)),
               "l"(from)
               : "memory");
}

/// Copies an element, or zero in its place, whose address is then not read.
template <i32 size> WARP_INLINE void copyElement(u64 to, u64 from) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], %2;" ::"r"(u32(to)),
               "l"(from), "n"(size)
               : "memory");
}
template <i32 size>
WARP_INLINE void copyElement(u64 to, u64 from, bool exists) {
  asm volatile("cp.async.ca.shared.global [%0], [%1], %2, %3;" ::"r"(u32(to)),
               "l"(from), "n"(size), "r"(exists ? size : 0)
               : "memory");
}

/// Rows so many elements apart.
struct Pitched {
  i32 pitch;

  WARP_INLINE i32 at(i32 row, i32 column) const { return row * pitch + column; }
  /// True if rows that are a multiple of `rows` apart differ by as much.
  WARP_INLINE bool isEven(i32) const { return true; }
};

/// Columns in groups of 64, or all if there are fewer; the chunks of 16 bytes
/// of 8, 4 or 2 elements' rows change places, so that those below each other
/// are in different banks (PTX ISA, shared memory matrix layout: swizzling
/// modes).
struct Swizzled {
  i32 rows, width;

  WARP_INLINE Swizzled(i32 rows, i32 columns)
      : rows(rows), width(columns < 64 ? columns : 64) {}
  WARP_INLINE i32 at(i32 row, i32 column) const {
    i32 chunks = width / 8;
    i32 chunk = (u32(column) % u32(width) / 8) ^
                (u32(row) / (8 / u32(chunks)) % u32(chunks));
    return (u32(column) / u32(width) * rows + row) * width + chunk * 8 +
           u32(column) % 8;
  }
  WARP_INLINE bool isEven(i32 rows) const { return rows % 8 == 0; }
};

template <class T, class Layout>
WARP_INLINE void fetch(u64 to, const Window &window, const Layout &layout,
                       i32 threads) {
  constexpr i32 run = 16 / sizeof(T), size = sizeof(T);
  i32 thread = threadNumber();
  i32 runs = window.columns / run, chunks = window.rows * runs;
  bool inChunks = window.columns % run == 0 && window.isAligned(size, 16) &&
                  window.isInside();
  if (inChunks && threads % runs != 0) {
    for (i32 i = thread; i < chunks; i += threads) {
      i32 row = u32(i) / u32(runs), column = u32(i) % u32(runs) * run;
      copyChunk(to + layout.at(row, column) * size, window.at(row, column));
    }
    return;
  }
  if (inChunks) {
    // A thread's rows are so many apart.
    i32 rows = threads / runs, whole = chunks / threads;
    i32 row = u32(thread) / u32(runs), column = u32(thread) % u32(runs) * run;
    u64 from = window.data + i64(window.first[0] + row) * window.step[0] +
               i64(window.first[1] + column) * i64(size);
    i64 step = i64(window.step[0]) * rows;
    u64 first = to + layout.at(row, column) * size;
    auto place = [&](i32 turn) -> u64 {
      if (layout.isEven(rows))
        return first + turn * layout.at(rows, 0) * size;
      return to + layout.at(row + turn * rows, column) * size;
    };
    for (i32 turn = 0; turn < whole; ++turn)
      copyChunk(place(turn), from + turn * step);
    if (whole * threads < chunks && whole * threads + thread < chunks)
      copyChunk(place(whole), from + whole * step);
    return;
  }
  i32 columns = window.columns, elements = window.rows * columns;
  if constexpr (size >= 4)
    if (window.isInside()) {
#pragma clang loop unroll(disable)
      for (i32 i = thread; i < elements; i += threads) {
        i32 row = u32(i) / u32(columns), column = u32(i) % u32(columns);
        copyElement<size>(to + layout.at(row, column) * size,
                          window.at(row, column));
      }
      return;
    }
#pragma clang loop unroll(disable)
  for (i32 i = thread; i < elements; i += threads) {
    i32 row = u32(i) / u32(columns), column = u32(i) % u32(columns);
    u64 place = to + layout.at(row, column) * size;
    bool exists = window.has(row, column);
    if constexpr (size >= 4) {
      copyElement<size>(place, exists ? window.at(row, column) : window.data,
                        exists);
    } else {
      T value = 0;
      if (exists)
        value = *global<T>(window.at(row, column));
      *shared<T>(place) = value;
    }
  }
}

} // namespace

#define WARP_FETCH(name, type, ...)                                            \
  WARP_TILES warp_tile_fetch_##name(                                           \
      u64 to, u64 data, i32 first0, i32 first1, i32 extent0, i32 extent1,      \
      i32 step0, i32 step1, i32 rows, i32 columns, i32 checked,                \
      [[maybe_unused]] i32 pitch, i32 threads, void *) {                       \
    fetch<type>(to,                                                            \
                {data,                                                         \
                 {first0, first1},                                             \
                 {extent0, extent1},                                           \
                 {step0, step1},                                               \
                 rows,                                                         \
                 columns,                                                      \
                 checked != 0},                                                \
                __VA_ARGS__, threads);                                         \
  }
WARP_FETCH(b16, u16, Pitched{pitch})
WARP_FETCH(b32, u32, Pitched{pitch})
WARP_FETCH(b64, u64, Pitched{pitch})
WARP_FETCH(swizzled_b16, u16, Swizzled(rows, columns))

/// The fetches since the last call form a group.
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
