//===- Published.h - Decoupled look-back between blocks of a GPU *- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CUDA_PUBLISHED_H
#define WARP_DEVICELIB_CUDA_PUBLISHED_H

#include "../gpu/Gpu.h"

namespace gpu {

/// A number that one block publishes for others: 32 of its bits per word, with
/// a mark above them. Zero is none.
template <typename T> class Published {
public:
  static constexpr int words = sizeof(T) / 4;

  explicit Published(uint64_t *at) : at(at) {}

  void set(T value) const {
    auto bits = __builtin_bit_cast(Bits, value);
#pragma unroll
    for (int i = 0; i < words; ++i)
      __scoped_atomic_store_n(at + i, bits.at[i] | mark, __ATOMIC_RELAXED,
                              __MEMORY_SCOPE_DEVICE);
  }

  /// Waits for it.
  T get() const {
    Bits bits;
#pragma unroll
    for (int i = 0; i < words; ++i) {
      uint64_t word;
      do {
        word = __scoped_atomic_load_n(at + i, __ATOMIC_RELAXED,
                                      __MEMORY_SCOPE_DEVICE);
      } while (!(word & mark));
      bits.at[i] = static_cast<uint32_t>(word);
    }
    return __builtin_bit_cast(T, bits);
  }

private:
  struct Bits {
    uint32_t at[words];
  };
  static constexpr uint64_t mark = uint64_t(1) << 32;

  uint64_t *at;
};

/// The sum of `value` over the threads of a block of so many warps, always
/// added in the same order.
template <int warps, typename T> static T sumOfBlock(T value) {
  WARP_SHARED T sums[warps];
  T own = sumOfLanes(value);
  if (lane() == warpSize - 1)
    sums[thread() / warpSize] = own;
  syncThreads();
  T total = 0;
#pragma unroll
  for (int i = 0; i < warps; ++i)
    total += sums[i];
  syncThreads();
  return total;
}

} // namespace gpu

#endif // WARP_DEVICELIB_CUDA_PUBLISHED_H
