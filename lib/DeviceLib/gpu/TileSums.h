//===- TileSums.h - Sums that threads hold ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Between the registers of threads, whatever the layout of the sums among them,
// and memory. A layout has as many `slots` per thread, in runs of `run` that
// are neighbours of a row, and says where a run begins: runRow, runColumn.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_TILESUMS_H
#define WARP_DEVICELIB_GPU_TILESUMS_H

#include "Tiles.h"

namespace {

template <class Layout> WARP_INLINE void set(u64 sums, float value) {
#pragma unroll
  for (int i = 0; i < Layout::slots; ++i)
    own<float>(sums)[i] = value;
}

/// From packed memory of the block to sums, or back.
template <class Layout, bool back>
WARP_INLINE void exchange(u64 sums, u64 memory, i32 m, i32 n) {
  constexpr int run = Layout::run;
  using Run = Vec<float, run>;
  Layout layout(m, n, threadNumber());
  float *kept = own<float>(sums);
#pragma unroll
  for (int slot = 0; slot < Layout::slots; slot += run) {
    auto *at = (Shared<Run> *)(shared<float>(memory) + layout.runRow(slot) * n +
                               layout.runColumn(slot));
    Run values;
    if (!back)
      values = *at;
#pragma unroll
    for (int i = 0; i < run; ++i)
      if constexpr (back)
        values[i] = kept[slot + i];
      else
        kept[slot + i] = values[i];
    if (back)
      *at = values;
  }
}

/// Elements of a tile that may lie outside of its array, one after the other:
/// from a copy, since registers have no numbers, and rolled up, since that is
/// rare.
template <class Layout, class Use>
WARP_INLINE void forThoseInside(u64 sums, const Window &window, Use use) {
  constexpr int run = Layout::run;
  Layout layout(window.rows, window.columns, threadNumber());
  float copies[Layout::slots];
#pragma unroll
  for (int slot = 0; slot < Layout::slots; ++slot)
    copies[slot] = own<float>(sums)[slot];
#pragma clang loop unroll(disable)
  for (int slot = 0; slot < Layout::slots; ++slot) {
    i32 row = layout.runRow(slot / run * run),
        column = layout.runColumn(slot / run * run) + slot % run;
    if (window.has(row, column))
      use(window.at(row, column), copies[slot]);
  }
}

template <class Layout> WARP_INLINE void store(u64 sums, const Window &window) {
  constexpr int run = Layout::run;
  using Run = Vec<float, run>;
  Layout layout(window.rows, window.columns, threadNumber());
  const float *kept = own<float>(sums);
  if (!window.isAligned(4, run * 4) || !window.isInside()) {
    forThoseInside<Layout>(sums, window, [](u64 address, float value) {
      *global<float>(address) = value;
    });
    return;
  }
#pragma unroll
  for (int slot = 0; slot < Layout::slots; slot += run) {
    Run values;
#pragma unroll
    for (int i = 0; i < run; ++i)
      values[i] = kept[slot + i];
    *(Global<Run> *)window.at(layout.runRow(slot), layout.runColumn(slot)) =
        values;
  }
}

WARP_INLINE void addAtomically(u64 address, float value) {
  asm volatile("red.relaxed.gpu.global.add.f32 [%0], %1;" ::"l"(address),
               "f"(value)
               : "memory");
}

/// Adds sums to an array, as others may at a time.
template <class Layout> WARP_INLINE void add(u64 sums, const Window &window) {
  constexpr int run = Layout::run;
  Layout layout(window.rows, window.columns, threadNumber());
  const float *kept = own<float>(sums);
  if (!window.isInside()) {
    forThoseInside<Layout>(sums, window, addAtomically);
    return;
  }
#pragma unroll
  for (int slot = 0; slot < Layout::slots; ++slot) {
    i32 first = slot / run * run;
    addAtomically(
        window.at(layout.runRow(first), layout.runColumn(first) + slot - first),
        kept[slot]);
  }
}

} // namespace

#define WARP_WINDOW(verb, name, ...)                                           \
  WARP_TILES warp_tile_##verb##_##name(                                        \
      u64 sums, u64 data, i32 first0, i32 first1, i32 extent0, i32 extent1,    \
      i32 step0, i32 step1, i32 rows, i32 columns, i32 checked, void *) {      \
    verb<__VA_ARGS__>(sums, {data,                                             \
                             {first0, first1},                                 \
                             {extent0, extent1},                               \
                             {step0, step1},                                   \
                             rows,                                             \
                             columns,                                          \
                             checked != 0});                                   \
  }

#define WARP_LAYOUT(name, ...)                                                 \
  WARP_TILES warp_tile_set_##name(u64 sums, float value, void *) {             \
    set<__VA_ARGS__>(sums, value);                                             \
  }                                                                            \
  WARP_TILES warp_tile_take_##name(u64 sums, u64 from, i32 m, i32 n, void *) { \
    exchange<__VA_ARGS__, false>(sums, from, m, n);                            \
  }                                                                            \
  WARP_TILES warp_tile_give_##name(u64 sums, u64 to, i32 m, i32 n, void *) {   \
    exchange<__VA_ARGS__, true>(sums, to, m, n);                               \
  }                                                                            \
  WARP_WINDOW(store, name, __VA_ARGS__)                                        \
  WARP_WINDOW(add, name, __VA_ARGS__)

#define WARP_PRODUCT(name, function, ...)                                      \
  WARP_TILES warp_tile_multiply_##name(u64 sums, u64 a, u64 b, i32 m, i32 n,   \
                                       i32 depth, i32 aPitch, i32 bPitch,      \
                                       void *) {                               \
    function<__VA_ARGS__>(sums, a, b, m, n, depth, aPitch, bPitch);            \
  }

/// For each order of the elements of both factors.
#define WARP_PRODUCTS(name, function, isBrain, R, C)                           \
  WARP_PRODUCT(name##_##R##x##C##_kk, function, isBrain, R, C, true, true)     \
  WARP_PRODUCT(name##_##R##x##C##_kn, function, isBrain, R, C, true, false)    \
  WARP_PRODUCT(name##_##R##x##C##_mk, function, isBrain, R, C, false, true)    \
  WARP_PRODUCT(name##_##R##x##C##_mn, function, isBrain, R, C, false, false)

#endif // WARP_DEVICELIB_GPU_TILESUMS_H
