//===- TileSums.h - Register accumulators -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Between the registers of threads, whatever the layout of the sums among them,
// and memory. A layout has as many `slots` per thread, in runs of `run` that
// are neighbours of a row, and says where a run begins: runRow, runColumn.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_NVIDIA_TILESUMS_H
#define WARP_DEVICELIB_NVIDIA_TILESUMS_H

#include "../gpu/Tiles.h"

// If kernels call these functions, sums lie in the thread's memory, and code
// is to be short.
#ifdef WARP_CALLED
constexpr bool isCalled = true;
#define WARP_FOR_SUMS _Pragma("clang loop unroll(disable)")
#else
constexpr bool isCalled = false;
#define WARP_FOR_SUMS _Pragma("unroll")
#endif

namespace {

/// A warp has rows x columns, in the fragments of mma.m16n8k16 or m16n8k4 (PTX
/// ISA, warp-level matrix instructions).
template <int R, int C, class S = float> struct Warps {
  using Sum = S;
  static constexpr int slots = R * C / 32, run = 2;
  i32 firstRow, firstColumn, lane;

  WARP_INLINE Warps(i32, i32 n, i32 thread) {
    i32 across = n / C, warp = u32(thread) / 32;
    lane = u32(thread) % 32;
    firstRow = u32(warp) / u32(across) * R;
    firstColumn = u32(warp) % u32(across) * C;
  }
  /// Fragments of 16 x 8 one after the other, four slots each.
  WARP_INLINE i32 runRow(int slot) const {
    return firstRow + slot / 4 / (C / 8) * 16 + slot % 4 / 2 * 8 + lane / 4;
  }
  WARP_INLINE i32 runColumn(int slot) const {
    return firstColumn + slot / 4 % (C / 8) * 8 + lane % 4 * 2;
  }
};

template <class Layout>
WARP_INLINE void set(u64 sums, typename Layout::Sum value) {
  WARP_FOR_SUMS
  for (int i = 0; i < Layout::slots; ++i)
    own<typename Layout::Sum>(sums)[i] = value;
}

/// The type of a tile's elements: T, or that of the sums.
template <class Layout, class T> struct ElementOf {
  using Type = T;
};
template <class Layout> struct ElementOf<Layout, void> {
  using Type = typename Layout::Sum;
};

/// From packed shared memory to sums, or back.
template <class Layout, bool back, class T>
WARP_INLINE void exchange(u64 sums, u64 memory, i32 m, i32 n) {
  constexpr int run = Layout::run;
  using Element = typename ElementOf<Layout, T>::Type;
  using Run = Vec<Element, run>;
  using Sum = typename Layout::Sum;
  Layout layout(m, n, threadNumber());
  Sum *kept = own<Sum>(sums);
  WARP_FOR_SUMS
  for (int slot = 0; slot < Layout::slots; slot += run) {
    auto *at =
        (Shared<Run> *)(shared<Element>(memory) + layout.runRow(slot) * n +
                        layout.runColumn(slot));
    Run values;
    if (!back)
      values = *at;
#pragma unroll
    for (int i = 0; i < run; ++i)
      if constexpr (back)
        values[i] = Element(kept[slot + i]);
      else
        kept[slot + i] = Sum(values[i]);
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
  using Sum = typename Layout::Sum;
  Layout layout(window.rows, window.columns, threadNumber());
  const Sum *kept = own<Sum>(sums);
  Sum copies[Layout::slots];
  if constexpr (!isCalled) {
#pragma unroll
    for (int slot = 0; slot < Layout::slots; ++slot)
      copies[slot] = kept[slot];
    kept = copies;
  }
#pragma clang loop unroll(disable)
  for (int slot = 0; slot < Layout::slots; ++slot) {
    i32 row = layout.runRow(slot / run * run),
        column = layout.runColumn(slot / run * run) + slot % run;
    if (window.has(row, column))
      use(window.at(row, column), kept[slot]);
  }
}

template <class Layout> WARP_INLINE void store(u64 sums, const Window &window) {
  constexpr int run = Layout::run;
  using Sum = typename Layout::Sum;
  using Run = Vec<Sum, run>;
  Layout layout(window.rows, window.columns, threadNumber());
  const Sum *kept = own<Sum>(sums);
  if (isCalled || !window.isAligned(sizeof(Sum), run * sizeof(Sum)) ||
      !window.isInside()) {
    forThoseInside<Layout>(sums, window, [](u64 address, Sum value) {
      *global<Sum>(address) = value;
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
WARP_INLINE void addAtomically(u64 address, double value) {
  asm volatile("red.relaxed.gpu.global.add.f64 [%0], %1;" ::"l"(address),
               "d"(value)
               : "memory");
}

/// Adds sums to an array, as others may at a time.
template <class Layout> WARP_INLINE void add(u64 sums, const Window &window) {
  constexpr int run = Layout::run;
  Layout layout(window.rows, window.columns, threadNumber());
  const auto *kept = own<typename Layout::Sum>(sums);
  if (isCalled || !window.isInside()) {
    forThoseInside<Layout>(sums, window, [](u64 address, auto value) {
      addAtomically(address, value);
    });
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

/// For tiles whose elements are of a type, void for that of the sums.
#define WARP_EXCHANGE(name, type, ...)                                         \
  WARP_TILES warp_tile_take_##name(u64 sums, u64 from, i32 m, i32 n, void *) { \
    exchange<__VA_ARGS__, false, type>(sums, from, m, n);                      \
  }                                                                            \
  WARP_TILES warp_tile_give_##name(u64 sums, u64 to, i32 m, i32 n, void *) {   \
    exchange<__VA_ARGS__, true, type>(sums, to, m, n);                         \
  }

#define WARP_LAYOUT(name, ...)                                                 \
  WARP_TILES warp_tile_set_##name(u64 sums, __VA_ARGS__::Sum value, void *) {  \
    set<__VA_ARGS__>(sums, value);                                             \
  }                                                                            \
  WARP_EXCHANGE(name, void, __VA_ARGS__)                                       \
  WARP_WINDOW(store, name, __VA_ARGS__)                                        \
  WARP_WINDOW(add, name, __VA_ARGS__)

#define WARP_PRODUCT(name, function, ...)                                      \
  WARP_TILES warp_tile_multiply_##name(u64 sums, u64 a, u64 b, i32 m, i32 n,   \
                                       i32 depth, i32 aPitch, i32 bPitch,      \
                                       i32 subtracts, void *) {                \
    function<__VA_ARGS__>(sums, a, b, m, n, depth, aPitch, bPitch,             \
                          subtracts != 0);                                     \
  }

/// For each order of the elements of both factors.
#define WARP_PRODUCTS(name, function, isBrain, R, C)                           \
  WARP_PRODUCT(name##_##R##x##C##_kk, function, isBrain, R, C, true, true)     \
  WARP_PRODUCT(name##_##R##x##C##_kn, function, isBrain, R, C, true, false)    \
  WARP_PRODUCT(name##_##R##x##C##_mk, function, isBrain, R, C, false, true)    \
  WARP_PRODUCT(name##_##R##x##C##_mn, function, isBrain, R, C, false, false)

#endif // WARP_DEVICELIB_NVIDIA_TILESUMS_H
