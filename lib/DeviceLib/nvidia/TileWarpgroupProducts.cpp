//===- TileWarpgroupProducts.cpp - Warpgroup matrix products --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For compute capability 9.0 alone: the matrix instructions of a warpgroup (PTX
// ISA, asynchronous warpgroup level matrix instructions) read both factors from
// shared memory while its threads go on. A warpgroup has rows x columns of
// sums, fragments of 64 rows one after the other; of each, a warp has 16 rows,
// as it has with mma.m16n8k16.
//
// Factors lie as copies to `swizzled` places put them (TileCopies.cpp): columns
// in groups of 64, or all if there are fewer, and the 16-byte chunks of a row
// of a group exchanged by the number of the row.
//
//===----------------------------------------------------------------------===//

#include "TileRings.h"

namespace {

template <int R, int C> struct Warpgroups {
  using Sum = float;
  static constexpr int slots = R * C / 128, run = 2;
  i32 firstRow, firstColumn, lane;

  WARP_INLINE Warpgroups(i32, i32 n, i32 thread) {
    i32 across = n / C, group = u32(thread) / 128;
    lane = u32(thread) % 32;
    firstRow = u32(group) / u32(across) * R + u32(thread) / 32 % 4 * 16;
    firstColumn = u32(group) % u32(across) * C;
  }
  WARP_INLINE i32 runRow(int slot) const {
    return firstRow + slot / (C / 2) * 64 + slot % 4 / 2 * 8 + lane / 4;
  }
  WARP_INLINE i32 runColumn(int slot) const {
    return firstColumn + slot % (C / 2) / 4 * 8 + lane % 4 * 2;
  }
};

//===----------------------------------------------------------------------===//
// Instructions
//===----------------------------------------------------------------------===//

#define WARP_SUMS_8(i)                                                         \
  "+f"(sum[i]), "+f"(sum[i + 1]), "+f"(sum[i + 2]), "+f"(sum[i + 3]),          \
      "+f"(sum[i + 4]), "+f"(sum[i + 5]), "+f"(sum[i + 6]), "+f"(sum[i + 7])
#define WARP_SUMS_32(i)                                                        \
  WARP_SUMS_8(i), WARP_SUMS_8(i + 8), WARP_SUMS_8(i + 16), WARP_SUMS_8(i + 24)
#define WARP_NAMES_16                                                          \
  "%0, %1, %2, %3, %4, %5, %6, %7, %8, %9, %10, %11, %12, %13, %14, %15"
#define WARP_NAMES_32                                                          \
  WARP_NAMES_16                                                                \
  ", %16, %17, %18, %19, %20, %21, %22, %23, %24, %25, %26, %27, %28, %29, "   \
  "%30, %31"
#define WARP_NAMES_64                                                          \
  WARP_NAMES_32                                                                \
  ", %32, %33, %34, %35, %36, %37, %38, %39, %40, %41, %42, %43, %44, %45, "   \
  "%46, %47, %48, %49, %50, %51, %52, %53, %54, %55, %56, %57, %58, %59, "     \
  "%60, %61, %62, %63"
#define WARP_NAMES_128                                                         \
  WARP_NAMES_64                                                                \
  ", %64, %65, %66, %67, %68, %69, %70, %71, %72, %73, %74, %75, %76, %77, "   \
  "%78, %79, %80, %81, %82, %83, %84, %85, %86, %87, %88, %89, %90, %91, "     \
  "%92, %93, %94, %95, %96, %97, %98, %99, %100, %101, %102, %103, %104, "     \
  "%105, %106, %107, %108, %109, %110, %111, %112, %113, %114, %115, %116, "   \
  "%117, %118, %119, %120, %121, %122, %123, %124, %125, %126, %127"

/// Sums += a b; `x` and `y` say where the factors lie. Then: that it adds, the
/// signs of both, and which of them lie across the depth.
#define WARP_WGMMA(n, type, names, rest, ...)                                  \
  asm volatile("wgmma.mma_async.sync.aligned.m64n" #n "k16.f32." type "." type \
               " {" names "}, " rest                                           \
               : __VA_ARGS__                                                   \
               : "l"(x), "l"(y), "n"(int(!aAlong)), "n"(int(!bAlong)))
#define WARP_WGMMA_EITHER(n, names, rest, ...)                                 \
  if constexpr (C == n && isBrain)                                             \
    WARP_WGMMA(n, "bf16", names, rest, __VA_ARGS__);                           \
  else if constexpr (C == n)                                                   \
  WARP_WGMMA(n, "f16", names, rest, __VA_ARGS__)

template <bool isBrain, int C, bool aAlong, bool bAlong>
WARP_INLINE void multiplyFragment(float *sum, u64 x, u64 y) {
  WARP_WGMMA_EITHER(32, WARP_NAMES_16, "%16, %17, 1, 1, 1, %18, %19;",
                    WARP_SUMS_8(0), WARP_SUMS_8(8));
  WARP_WGMMA_EITHER(64, WARP_NAMES_32, "%32, %33, 1, 1, 1, %34, %35;",
                    WARP_SUMS_32(0));
  WARP_WGMMA_EITHER(128, WARP_NAMES_64, "%64, %65, 1, 1, 1, %66, %67;",
                    WARP_SUMS_32(0), WARP_SUMS_32(32));
  WARP_WGMMA_EITHER(256, WARP_NAMES_128, "%128, %129, 1, 1, 1, %130, %131;",
                    WARP_SUMS_32(0), WARP_SUMS_32(32), WARP_SUMS_32(64),
                    WARP_SUMS_32(96));
}

/// A factor in shared memory: rows and columns as it lies there. Elements
/// that are summed over are neighbours (along), or not.
template <bool along> struct Factor {
  static constexpr i32 widest = 64, bytes = 2;
  u64 place;
  i32 rows, columns;

  /// A power of two.
  WARP_INLINE i32 width() const { return columns < widest ? columns : widest; }
  /// From a group of columns to the next.
  WARP_INLINE i32 step() const { return rows * width() * bytes; }
  /// The matrix descriptor of fragments from an element on, the depth a
  /// multiple of 16: address and steps in units of 16 bytes, and how chunks
  /// lie. For a factor across the depth, the first step is from one group of
  /// columns to the next.
  WARP_INLINE u64 describe(i32 across, i32 depth) const {
    i32 row = along ? across : depth, column = along ? depth : across;
    i32 group = u32(column) >> __builtin_ctz(width());
    u64 address = place + group * step() +
                  (row * width() + (column & (width() - 1))) * bytes;
    u64 chunks = width() == 64 ? 1 : width() == 32 ? 2 : 3;
    return (address & 0x3ffff) >> 4 | u64(step() >> 4) << 16 |
           u64(8 * width() * bytes >> 4) << 32 | chunks << 62;
  }
};

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

/// Begins to add a product, which threads await, or adds it.
template <bool isBrain, int R, int C, bool aAlong, bool bAlong,
          bool awaits = isCalled>
WARP_INLINE void multiplyWarpgroups(u64 sums, u64 a, u64 b, i32 m, i32 n,
                                    i32 depth, i32, i32,
                                    bool /*subtracts*/ = false) {
  using Layout = Warpgroups<R, C>;
  i32 across = n / C, group = u32(threadNumber()) / 128;
  i32 row = u32(group) / u32(across) * R, column = u32(group) % u32(across) * C;
  Factor<aAlong> x{a, aAlong ? m : depth, aAlong ? depth : m};
  Factor<bAlong> y{b, bAlong ? n : depth, bAlong ? depth : n};
  float sum[Layout::slots];
  float *kept = own<float>(sums);
#pragma unroll
  for (int i = 0; i < Layout::slots; ++i)
    sum[i] = kept[i];
  auto multiplySome = [&](i32 k) {
#pragma unroll
    for (int i = 0; i < R / 64; ++i)
      multiplyFragment<isBrain, C, aAlong, bAlong>(sum + i * (C / 2),
                                                   x.describe(row + i * 64, k),
                                                   y.describe(column, k));
  };
  auto begin = [] { asm volatile("wgmma.fence.sync.aligned;" ::: "memory"); };
  auto end = [] {
    asm volatile("wgmma.commit_group.sync.aligned;" ::: "memory");
  };
  // If all is known the rest is; in a call instructions follow each other
  // like that only without conditions between them.
  begin();
  if (isCalled && holdsForAll(depth == 64)) {
#pragma unroll
    for (i32 k = 0; k < 64; k += 16)
      multiplySome(k);
    end();
  } else {
    for (i32 k = 0; holdsForAll(k < depth); k += 64)
#pragma unroll
      for (i32 part = 0; part < 64; part += 16)
        if (holdsForAll(k + part < depth)) {
          if (isCalled)
            begin();
          multiplySome(k + part);
        }
    end();
  }
  if (awaits)
    awaitProducts<0>();
#pragma unroll
  for (int i = 0; i < Layout::slots; ++i)
    kept[i] = sum[i];
}

} // namespace

//===----------------------------------------------------------------------===//
// Functions of the library
//===----------------------------------------------------------------------===//

#define WARP_WARPGROUP_RINGS(type, isBrain, R, C)                              \
  WARP_WARPGROUP_RING(type, isBrain, R, C, kk, true, true)                     \
  WARP_WARPGROUP_RING(type, isBrain, R, C, kn, true, false)                    \
  WARP_WARPGROUP_RING(type, isBrain, R, C, mk, false, true)                    \
  WARP_WARPGROUP_RING(type, isBrain, R, C, mn, false, false)
#define WARP_WARPGROUP_RING(type, isBrain, R, C, name, aAlong, bAlong)         \
  WARP_RING(wg_##type##_##R##x##C##_##name, u16, true, R *C / 128, aAlong,     \
            bAlong, multiplyWarpgroups<isBrain, R, C, aAlong, bAlong, false>)

#define WARP_WARPGROUPS(R, C)                                                  \
  WARP_LAYOUT(wg_##R##x##C, Warpgroups<R, C>)                                  \
  WARP_PRODUCTS(wg_f16, multiplyWarpgroups, false, R, C)                       \
  WARP_PRODUCTS(wg_bf16, multiplyWarpgroups, true, R, C)                       \
  WARP_WARPGROUP_RINGS(f16, false, R, C)                                       \
  WARP_WARPGROUP_RINGS(bf16, true, R, C)

WARP_WARPGROUPS(64, 32)
WARP_WARPGROUPS(64, 64)
WARP_WARPGROUPS(64, 128)
WARP_WARPGROUPS(64, 256)
WARP_WARPGROUPS(128, 64)
WARP_WARPGROUPS(128, 128)

WARP_TILES warp_tile_publish_copies(void *) { publishCopies(); }

WARP_TILES warp_tile_await_products(void *) { awaitProducts<0>(); }
