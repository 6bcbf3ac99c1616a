//===- TileProducts.cpp - Products of tiles -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads hold the sums, in one of two layouts, and read factors from the
// block's memory. A factor lies along the depth (`k`: elements that are summed
// over are neighbours) or across it.
//
//   blocked   a thread has rows x columns of sums; factors come in runs of four
//             elements, so that a warp, 4 x 8 threads or the like, reads whole
//             lines. Runs lie along the depth, when threads have every so many
//             rows, or across, when they have four neighbours
//   warps     a warp has rows x columns of sums, in the fragments of
//             mma.m16n8k16 (PTX ISA, warp-level matrix instructions)
//
//===----------------------------------------------------------------------===//

#include "TileSums.h"

namespace {

//===----------------------------------------------------------------------===//
// Layouts
//===----------------------------------------------------------------------===//

/// Threads that share the rows and columns of a tile.
template <int R, int C, bool aAlong, bool bAlong> struct Blocked {
  static constexpr int slots = R * C, run = bAlong ? 1 : 4;
  i32 y, x, rows, columns;

  WARP_INLINE Blocked(i32 m, i32 n, i32 thread) {
    rows = m / R;
    columns = n / C;
    i32 wide = columns % 8 == 0   ? 8
               : columns % 4 == 0 ? 4
               : columns % 2 == 0 ? 2
                                  : 1;
    i32 high = 32 / wide, across = columns / wide;
    i32 warp = u32(thread) / 32, lane = u32(thread) % 32;
    // Runs of 16 bytes are read by half a warp at a time where lanes next to
    // each other, or one apart, have the same: rows take the lowest bit of the
    // lane's number, and columns the next ones.
    y = u32(warp) / u32(across) * high + lane % 2 +
        u32(lane) / u32(2 * wide) * 2;
    x = u32(warp) % u32(across) * wide + u32(lane) / 2 % u32(wide);
  }
  WARP_INLINE i32 row(int i) const {
    return aAlong ? y + i * rows : (i / 4 * rows + y) * 4 + i % 4;
  }
  WARP_INLINE i32 column(int j) const {
    return bAlong ? x + j * columns : (j / 4 * columns + x) * 4 + j % 4;
  }
  /// Where the first element of a run is.
  WARP_INLINE i32 runRow(int slot) const { return row(slot / C); }
  WARP_INLINE i32 runColumn(int slot) const { return column(slot % C); }
};

template <int R, int C> struct Warps {
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

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

/// A factor along the depth: rows so many elements apart, or, of pitch 0, as
/// the copy engine swizzles rows of 128 bytes, one group of columns after the
/// other.
struct Along {
  static constexpr i32 width = 32, run = 4, chunks = width / run;
  u64 place;
  i32 rows, pitch;

  /// Where runs begin.
  WARP_INLINE u32 at(i32 row, i32 k) const {
    i32 chunk = u32(k) % width / run ^ u32(row) % chunks;
    i32 swizzled = (u32(k) / width * rows + row) * width + chunk * run;
    return u32(place) + (pitch == 0 ? swizzled : row * pitch + k) * 4;
  }
};

/// From an even pair of elements to the next one, in a way that the assembler
/// does not see: it would read both at once.
WARP_INLINE u32 nextPair(u32 address) {
  asm("xor.b32 %0, %1, 8;" : "=r"(address) : "r"(address));
  return address;
}

/// Elements `k` and k + 1 of the depth. Two at a time leave registers for those
/// that are read while these are multiplied.
template <bool along, int n, class Place>
WARP_INLINE void readPairs(float (&to)[n][2], u64 from, i32 rows, i32 pitch,
                           i32 k, Place place) {
  if constexpr (along) {
    Along factor{from, rows, pitch};
    i32 start = u32(k) / 4 * 4, step = pitch == 0 ? factor.width : pitch;
    u32 first = factor.at(place(0), start);
    if (k != start)
      first = nextPair(first);
#pragma unroll
    for (int i = 0; i < n; ++i) {
      // Rows that are a multiple of eight apart are swizzled alike.
      i32 behind = place(i) - place(0);
      u32 address = first + behind * step * 4;
      if (pitch == 0 && u32(behind) % factor.chunks != 0) {
        address = factor.at(place(i), start);
        if (k != start)
          address = nextPair(address);
      }
      asm volatile("ld.shared.v2.f32 {%0, %1}, [%2];"
                   : "=f"(to[i][0]), "=f"(to[i][1])
                   : "r"(address));
    }
  } else {
    using Run = Vec<float, 4>;
#pragma unroll
    for (int q = 0; q < 2; ++q)
#pragma unroll
      for (int i = 0; i < n; i += 4) {
        Run run =
            *(Shared<Run> *)(shared<float>(from) + (k + q) * pitch + place(i));
#pragma unroll
        for (int j = 0; j < 4; ++j)
          to[i + j][q] = run[j];
      }
  }
}

template <int R, int C, bool aAlong, bool bAlong>
WARP_INLINE void multiplyBlocked(u64 sums, u64 a, u64 b, i32 m, i32 n,
                                 i32 depth, i32 aPitch, i32 bPitch) {
  Blocked<R, C, aAlong, bAlong> layout(m, n, threadNumber());
  float sum[R][C];
  float *kept = own<float>(sums);
#pragma unroll
  for (int i = 0; i < R * C; ++i)
    sum[i / C][i % C] = kept[i];
  // Half of the waits at the beginning of a turn, for twice the code.
#pragma clang loop unroll(disable)
  for (i32 k = 0; k < depth; k += 8)
#pragma unroll
    for (i32 pair = 0; pair < 8; pair += 2) {
      if (depth % 8 != 0 && k + pair >= depth)
        break;
      float x[R][2], y[C][2];
      readPairs<aAlong>(x, a, m, aPitch, k + pair,
                        [&](int i) { return layout.row(i); });
      readPairs<bAlong>(y, b, n, bPitch, k + pair,
                        [&](int j) { return layout.column(j); });
#pragma unroll
      for (int q = 0; q < 2; ++q)
#pragma unroll
        for (int i = 0; i < R; ++i)
#pragma unroll
          for (int j = 0; j < C; ++j)
            sum[i][j] = __builtin_fmaf(x[i][q], y[j][q], sum[i][j]);
    }
#pragma unroll
  for (int i = 0; i < R * C; ++i)
    kept[i] = sum[i / C][i % C];
}

/// Four matrices of 8 x 8; lane l names row l % 8 of matrix l / 8.
template <bool transposed>
WARP_INLINE void readMatrices(u32 (&to)[4], u64 address) {
  if constexpr (transposed)
    asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 "
                 "{%0, %1, %2, %3}, [%4];"
                 : "=r"(to[0]), "=r"(to[1]), "=r"(to[2]), "=r"(to[3])
                 : "r"(u32(address)));
  else
    asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 "
                 "{%0, %1, %2, %3}, [%4];"
                 : "=r"(to[0]), "=r"(to[1]), "=r"(to[2]), "=r"(to[3])
                 : "r"(u32(address)));
}

#define WARP_MMA(type)                                                         \
  asm("mma.sync.aligned.m16n8k16.row.col.f32." type "." type ".f32 "           \
      "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"        \
      : "+f"(sum[0]), "+f"(sum[1]), "+f"(sum[2]), "+f"(sum[3])                 \
      : "r"(x[0]), "r"(x[1]), "r"(x[2]), "r"(x[3]), "r"(y[0]), "r"(y[1]))

template <bool isBrain>
WARP_INLINE void multiplyFragment(float *sum, const u32 (&x)[4], const u32 *y) {
  if constexpr (isBrain)
    WARP_MMA("bf16");
  else
    WARP_MMA("f16");
}

template <bool isBrain, int R, int C, bool aAlong, bool bAlong>
WARP_INLINE void multiplyWarps(u64 sums, u64 a, u64 b, i32 m, i32 n, i32 depth,
                               i32 aPitch, i32 bPitch) {
  Warps<R, C> layout(m, n, threadNumber());
  constexpr int slots = Warps<R, C>::slots;
  float sum[slots];
  float *kept = own<float>(sums);
#pragma unroll
  for (int i = 0; i < slots; ++i)
    sum[i] = kept[i];
  // Within each group of 16 lanes a row or column; see readMatrices.
  i32 lane = layout.lane, low = lane % 16, high = lane / 16 * 8;
  i32 inner = lane % 8 + high, middle = lane / 8 % 2 * 8;
  u64 fromA = aAlong ? a + ((layout.firstRow + low) * aPitch + high) * 2
                     : a + (inner * aPitch + layout.firstRow + middle) * 2;
  u64 fromB = bAlong ? b + ((layout.firstColumn + inner) * bPitch + middle) * 2
                     : b + (low * bPitch + layout.firstColumn + high) * 2;
  for (i32 k = 0; k < depth; k += 16) {
    u32 x[R / 16][4], y[C / 16][4];
#pragma unroll
    for (int i = 0; i < R / 16; ++i) {
      i32 place = aAlong ? i * 16 * aPitch + k : k * aPitch + i * 16;
      readMatrices<!aAlong>(x[i], fromA + place * 2);
    }
#pragma unroll
    for (int j = 0; j < C / 16; ++j) {
      i32 place = bAlong ? j * 16 * bPitch + k : k * bPitch + j * 16;
      readMatrices<!bAlong>(y[j], fromB + place * 2);
    }
#pragma unroll
    for (int i = 0; i < R / 16; ++i)
#pragma unroll
      for (int j = 0; j < C / 8; ++j)
        multiplyFragment<isBrain>(sum + (i * (C / 8) + j) * 4, x[i],
                                  y[j / 2] + j % 2 * 2);
  }
#pragma unroll
  for (int i = 0; i < slots; ++i)
    kept[i] = sum[i];
}

} // namespace

//===----------------------------------------------------------------------===//
// Functions of the library
//===----------------------------------------------------------------------===//

#define WARP_BLOCKED_AS(R, C, name, aAlong, bAlong)                            \
  WARP_LAYOUT(f32_##R##x##C##_##name, Blocked<R, C, aAlong, bAlong>)           \
  WARP_PRODUCT(f32_##R##x##C##_##name, multiplyBlocked, R, C, aAlong, bAlong)

#define WARP_BLOCKED(R, C)                                                     \
  WARP_BLOCKED_AS(R, C, kk, true, true)                                        \
  WARP_BLOCKED_AS(R, C, kn, true, false)                                       \
  WARP_BLOCKED_AS(R, C, mk, false, true)                                       \
  WARP_BLOCKED_AS(R, C, mn, false, false)

WARP_BLOCKED(8, 8)
WARP_BLOCKED(8, 4)
WARP_BLOCKED(4, 8)
WARP_BLOCKED(4, 4)

#define WARP_WARPS(R, C)                                                       \
  WARP_LAYOUT(mma_##R##x##C, Warps<R, C>)                                      \
  WARP_PRODUCTS(f16, multiplyWarps, false, R, C)                               \
  WARP_PRODUCTS(bf16, multiplyWarps, true, R, C)

WARP_WARPS(64, 64)
WARP_WARPS(64, 32)
WARP_WARPS(32, 64)
WARP_WARPS(32, 32)
WARP_WARPS(32, 16)
WARP_WARPS(16, 32)
WARP_WARPS(16, 16)
