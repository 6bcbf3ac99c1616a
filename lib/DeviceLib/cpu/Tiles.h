//===- Tiles.h - Vectors for the algebra of tiles ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A block of the CPU is one thread, so functions for tiles get whole ones:
// addresses in shared memory, extents, steps between rows and columns in
// elements. Contiguous elements are computed in vectors of 64 bytes, which
// the compiler cuts in two where registers are shorter. Functions of the
// library are called with an address for results last; these give none.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILES_H
#define WARP_DEVICELIB_CPU_TILES_H

#include "DeviceLib/Prototypes.h"

using i32 = int;
using i64 = long long;
using u64 = unsigned long long;

#define WARP_TILES extern "C" __attribute__((used, visibility("default")))

namespace {

/// True if registers have 64 bytes.
#ifdef __AVX512F__
constexpr bool hasWideRegisters = true;
#else
constexpr bool hasWideRegisters = false;
#endif

template <class T> constexpr int lanes = 64 / int(sizeof(T));

template <class T> using Vec = T __attribute__((ext_vector_type(lanes<T>)));
template <class T> using Mask = bool __attribute__((ext_vector_type(lanes<T>)));

template <class T> inline T *at(u64 address) {
  return reinterpret_cast<T *>(address);
}

/// At any address.
template <class V> inline V loadAs(const void *from) {
  V value;
  __builtin_memcpy(&value, from, sizeof(V));
  return value;
}
template <class V> inline void storeAs(void *to, V value) {
  __builtin_memcpy(to, &value, sizeof(V));
}

template <class T> inline Vec<T> load(const T *from) {
  return loadAs<Vec<T>>(from);
}
template <class T> inline void store(T *to, Vec<T> value) {
  storeAs(to, value);
}

/// The first `count` lanes.
template <class T> inline Mask<T> firstLanes(i64 count) {
  using Numbers = i32 __attribute__((ext_vector_type(lanes<T>)));
  Numbers numbers;
#pragma unroll
  for (int lane = 0; lane < lanes<T>; ++lane)
    numbers[lane] = lane;
  return __builtin_convertvector(numbers < Numbers(i32(count)), Mask<T>);
}

/// The lanes of a vector that are left of `count` elements; zero elsewhere.
template <class T> inline Vec<T> load(const T *from, i64 count) {
  if (count >= lanes<T>)
    return load(from);
  return __builtin_masked_load(firstLanes<T>(count), from, Vec<T>(0));
}
template <class T> inline void store(T *to, Vec<T> value, i64 count) {
  if (count >= lanes<T>)
    return store(to, value);
  __builtin_masked_store(firstLanes<T>(count), value, to);
}

template <class V> inline V fma(V a, V b, V c) {
  return __builtin_elementwise_fma(a, b, c);
}

} // namespace

#endif // WARP_DEVICELIB_CPU_TILES_H
