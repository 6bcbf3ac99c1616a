//===- Tiles.h - Tile operations of the threads of a block ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions for tiles get addresses in shared memory and in that of
// arrays, and shapes, which are constants where they become part of a kernel:
// all are inlined there. A thread's own values come by address, too; accesses
// at known places make registers of them. Functions of the library are called
// with an address for results last; these give none.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_TILES_H
#define WARP_DEVICELIB_GPU_TILES_H

#ifdef __AMDGCN__
#include "../amd/TileInstructions.h"
#else
#include "../nvidia/TileInstructions.h"
#endif

#include "DeviceLib/Prototypes.h"

using i32 = int;
using u16 = unsigned short;
using u32 = unsigned;
using i64 = long long;
using u64 = unsigned long long;

#define WARP_TILES extern "C" __attribute__((used, always_inline)) void

namespace {

template <class T> using Shared = T __attribute__((address_space(3)));
template <class T> using Global = T __attribute__((address_space(1)));
template <class T, int n> using Vec = T __attribute__((ext_vector_type(n)));

template <class T> WARP_INLINE Shared<T> *shared(u64 address) {
  return (Shared<T> *)address;
}
template <class T> WARP_INLINE Global<T> *global(u64 address) {
  return (Global<T> *)address;
}
template <class T> WARP_INLINE T *own(u64 address) { return (T *)address; }

#ifndef __AMDGCN__
/// Waits for all threads of a block of so many.
WARP_INLINE void syncBlock(i32 threads) {
  if (threads == warpSize)
    syncWarp();
  else
    syncThreads();
}
#endif

/// For an array of two dimensions, steps in bytes, and a tile in it.
struct Window {
  u64 data;
  i32 first[2], extent[2], step[2];
  i32 rows, columns;
  bool checked;

  WARP_INLINE bool isInside() const {
    return !checked || (first[0] >= 0 && first[0] <= extent[0] - rows &&
                        first[1] >= 0 && first[1] <= extent[1] - columns);
  }
  WARP_INLINE bool has(i32 row, i32 column) const {
    return !checked || ((u32)(first[0] + row) < (u32)extent[0] &&
                        (u32)(first[1] + column) < (u32)extent[1]);
  }
  WARP_INLINE u64 at(i32 row, i32 column) const {
    return data + i64(first[0] + row) * step[0] +
           i64(first[1] + column) * step[1];
  }
  /// True if runs of elements lie at multiples of `bytes`.
  WARP_INLINE bool isAligned(i32 size, i32 bytes) const {
    u64 start = data + u64(i64(first[1]) * size);
    return step[1] == size && ((start | u64(i64(step[0]))) & (bytes - 1)) == 0;
  }
};

} // namespace

#endif // WARP_DEVICELIB_GPU_TILES_H
