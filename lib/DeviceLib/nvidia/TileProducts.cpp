//===- TileProducts.cpp - Products of tiles -------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads hold the sums, in one of two layouts, and read factors from the
// shared memory. A factor lies along the depth (`k`: elements that are summed
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

#include "TileRings.h"

namespace {

//===----------------------------------------------------------------------===//
// Layouts
//===----------------------------------------------------------------------===//

/// Threads that share the rows and columns of a tile.
template <int R, int C, bool aAlong, bool bAlong> struct Blocked {
  using Sum = float;
  static constexpr int slots = R * C, run = bAlong ? 1 : 4,
                       rowRun = R < 4 ? R : 4;
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
    if (rows % high != 0) {
      y = u32(thread) / u32(columns);
      x = u32(thread) % u32(columns);
      return;
    }
    // Runs of 16 bytes are read by half a warp at a time where lanes next to
    // each other, or one apart, have the same: rows take the lowest bit of the
    // lane's number, and columns the next ones.
    y = u32(warp) / u32(across) * high + lane % 2 +
        u32(lane) / u32(2 * wide) * 2;
    x = u32(warp) % u32(across) * wide + u32(lane) / 2 % u32(wide);
  }
  WARP_INLINE i32 row(int i) const {
    return aAlong ? y + i * rows
                  : (i / rowRun * rows + y) * rowRun + i % rowRun;
  }
  WARP_INLINE i32 column(int j) const {
    return bAlong ? x + j * columns : (j / 4 * columns + x) * 4 + j % 4;
  }
  /// The place of the first element of a run.
  WARP_INLINE i32 runRow(int slot) const { return row(slot / C); }
  WARP_INLINE i32 runColumn(int slot) const { return column(slot % C); }
};

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

/// A factor along the depth: rows so many elements apart, or, of pitch 0, in
/// TMA's swizzle of rows of 128 bytes, one group of columns after the other.
struct Along {
  static constexpr i32 width = 32, run = 4, chunks = width / run;
  u64 place;
  i32 rows, pitch;

  /// The start of four elements, `k` a multiple of four. A swizzled factor lies
  /// at a multiple of what a group of rows repeats after, so that numbers of
  /// chunks are bits of the address.
  WARP_INLINE u32 at(i32 row, i32 k) const {
    if (pitch != 0)
      return u32(place) + (row * pitch + k) * 4;
    u32 first = u32(place) + (row * width + u32(row) % chunks * run) * 4;
    return (first ^ u32(k) % width * 4) + u32(k) / width * rows * width * 4;
  }
};

/// From the first half of four elements to the second one, in a way that the
/// assembler does not see, which would read both at once.
WARP_INLINE u32 secondHalf(u32 address) {
  asm("xor.b32 %0, %1, 8;" : "=r"(address) : "r"(address));
  return address;
}

/// Some elements of the depth, from `k`, a multiple of `width`, on: one, if
/// they lie across, or two or four neighbours.
template <bool along, int width, int n, class Place>
WARP_INLINE void readRuns(float (&to)[n][width], u64 from, i32 rows, i32 pitch,
                          i32 k, Place place) {
  constexpr int run = along ? width : n < 4 ? n : 4;
  using Run = Vec<float, run>;
  if constexpr (along) {
    Along factor{from, rows, pitch};
    i32 start = u32(k) / 4 * 4, step = pitch == 0 ? factor.width : pitch;
    auto addressOf = [&](int i) {
      u32 address = factor.at(place(i), start);
      return k == start ? address : secondHalf(address);
    };
    u32 first = addressOf(0);
#pragma unroll
    for (int i = 0; i < n; ++i) {
      // Rows that are a multiple of eight apart are swizzled alike.
      i32 behind = place(i) - place(0);
      bool isAlike = pitch != 0 || u32(behind) % factor.chunks == 0;
      u32 address = isAlike ? first + behind * step * 4 : addressOf(i);
      Run values = *(Shared<Run> *)shared<float>(address);
#pragma unroll
      for (int q = 0; q < width; ++q)
        to[i][q] = values[q];
    }
  } else {
#pragma unroll
    for (int i = 0; i < n; i += run) {
      Run values = *(Shared<Run> *)(shared<float>(from) + k * pitch + place(i));
#pragma unroll
      for (int j = 0; j < run; ++j)
        to[i + j][0] = values[j];
    }
  }
}

/// Instructions that do not multiply take time that others need: four elements
/// of the depth are read at once, or two, where registers are short, and a turn
/// of the loop has eight. (Turns of four take 1.08 to 1.15 of the time, fours
/// for 64 sums 1.08; turns of 32 take 0.98, for three times the code.)
template <int R, int C, bool aAlong, bool bAlong>
WARP_INLINE void multiplyBlocked(u64 sums, u64 a, u64 b, i32 m, i32 n,
                                 i32 depth, i32 aPitch, i32 bPitch,
                                 bool subtracts = false) {
  Blocked<R, C, aAlong, bAlong> layout(m, n, threadNumber());
  constexpr int turn = 8, run = R * C == 64 ? 2 : 4;
  constexpr int rowRun = aAlong ? run : 1, columnRun = bAlong ? run : 1;
  float sum[R][C];
  float *kept = own<float>(sums);
#pragma unroll
  for (int i = 0; i < R * C; ++i)
    sum[i / C][i % C] = kept[i];
#pragma clang loop unroll(disable)
  for (i32 k = 0; k < depth; k += turn) {
    float x[R][rowRun], y[C][columnRun];
#pragma unroll
    for (int q = 0; q < turn; ++q) {
      if (q == 4 && depth % turn != 0 && k + q >= depth)
        break;
      if (q % rowRun == 0)
        readRuns<aAlong, rowRun>(x, a, m, aPitch, k + q,
                                 [&](int i) { return layout.row(i); });
      if (q % columnRun == 0)
        readRuns<bAlong, columnRun>(y, b, n, bPitch, k + q,
                                    [&](int j) { return layout.column(j); });
#pragma unroll
      for (int i = 0; i < R; ++i)
#pragma unroll
        for (int j = 0; j < C; ++j)
          sum[i][j] =
              __builtin_fmaf(subtracts ? -x[i][q % rowRun] : x[i][q % rowRun],
                             y[j][q % columnRun], sum[i][j]);
    }
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
                               i32 aPitch, i32 bPitch, bool subtracts) {
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
      constexpr u32 signs = 0x80008000;
#pragma unroll
      for (int q = 0; q < 4; ++q)
        x[i][q] ^= subtracts ? signs : 0;
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
  WARP_PRODUCT(f32_##R##x##C##_##name, multiplyBlocked, R, C, aAlong, bAlong)  \
  WARP_RING(f32_##R##x##C##_##name, float, false, R *C, aAlong, bAlong,        \
            multiplyBlocked<R, C, aAlong, bAlong>)

#define WARP_BLOCKED(R, C)                                                     \
  WARP_BLOCKED_AS(R, C, kk, true, true)                                        \
  WARP_BLOCKED_AS(R, C, kn, true, false)                                       \
  WARP_BLOCKED_AS(R, C, mk, false, true)                                       \
  WARP_BLOCKED_AS(R, C, mn, false, false)

WARP_BLOCKED(8, 8)
WARP_BLOCKED(8, 4)
WARP_BLOCKED(4, 8)
WARP_BLOCKED(4, 4)
WARP_BLOCKED_AS(2, 4, kk, true, true)
WARP_BLOCKED_AS(2, 4, kn, true, false)
WARP_BLOCKED_AS(2, 4, mk, false, true)
WARP_BLOCKED_AS(2, 4, mn, false, false)

#define WARP_WARPS(R, C)                                                       \
  WARP_LAYOUT(mma_##R##x##C, Warps<R, C>)                                      \
  WARP_EXCHANGE(f16_mma_##R##x##C, _Float16, Warps<R, C>)                      \
  WARP_EXCHANGE(bf16_mma_##R##x##C, __bf16, Warps<R, C>)                       \
  WARP_PRODUCTS(f16, multiplyWarps, false, R, C)                               \
  WARP_PRODUCTS(bf16, multiplyWarps, true, R, C)

WARP_WARPS(64, 64)
WARP_WARPS(64, 32)
WARP_WARPS(32, 64)
WARP_WARPS(32, 32)
WARP_WARPS(32, 16)
WARP_WARPS(16, 32)
WARP_WARPS(16, 16)
