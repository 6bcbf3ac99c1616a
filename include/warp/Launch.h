//===- Launch.h - Layouts shared with compiled code -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Data that cross the border between a compiled kernel and its caller, defined
// here and nowhere else: the compiler takes sizes and offsets from these types,
// Python from the bindings. Code on disk has them too, so each is asserted.
//
// A kernel gets one pointer (GPU: one by-value struct), the parameter block:
//
//   offset  0  LaunchHeader: extents of the launch, error record or block
//             order
//          24  the arguments in order, each at its natural alignment;
//              arrays as ArrayDescriptor, structs in C layout
//
// rounded up to a multiple of 8. A CPU entry runs the linear thread indices
// [begin, end) of the launch; the last dimension varies fastest.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCH_H
#define WARP_LAUNCH_H

#include "warp/Export.h"

#include <cstddef>
#include <cstdint>

namespace warp {

inline constexpr int maxRank = 4;

struct ArrayDescriptor {
  void *data = nullptr;
  void *grad = nullptr;
  int32_t shape[maxRank] = {0, 0, 0, 0};
  /// In bytes.
  int32_t strides[maxRank] = {0, 0, 0, 0};
  int32_t ndim = 0;
  /// A mask of `ArrayFact`; 0 says nothing. To be made again, or cleared, when
  /// another field changes.
  int32_t flags = 0;
};
static_assert(sizeof(ArrayDescriptor) == 56 && alignof(ArrayDescriptor) == 8 &&
              offsetof(ArrayDescriptor, data) == 0 &&
              offsetof(ArrayDescriptor, grad) == 8 &&
              offsetof(ArrayDescriptor, shape) == 16 &&
              offsetof(ArrayDescriptor, strides) == 32 &&
              offsetof(ArrayDescriptor, ndim) == 48 &&
              offsetof(ArrayDescriptor, flags) == 52);

/// Facts that are found when an array is made (`arrayFacts` of warp/Memory.h),
/// so that launches need not look at extents and strides.
enum ArrayFact : int32_t {
  /// The others have been looked for; a launch does so if this is missing.
  arrayKnown = 1 << 17,
  /// Elements are packed in row-major order.
  arrayPacked = 1 << 18,
  /// Data and gradient lie at multiples of `packedAlignment`.
  arrayAligned = 1 << 19,
  /// All elements lie in the `shape[0] * strides[0]` bytes at `data`.
  arraySpan = 1 << 20,
  /// Rows begin a multiple of 2 KiB apart: elements of many fall into one set
  /// of a CPU's cache.
  arrayFarRows = 1 << 21,
  /// 2^31 elements or more.
  arrayLong = 1 << 22,
  arrayFactMask = arrayKnown | arrayPacked | arrayAligned | arraySpan |
                  arrayFarRows | arrayLong
};

/// Alignment of the data and gradient of an array that a GPU's code takes for
/// packed: 16 bytes at most, for an access of that many.
constexpr int64_t packedAlignment(int64_t elementSize) {
  int64_t lowest = elementSize & -elementSize;
  return lowest == 0 ? 1 : lowest < 16 ? lowest : 16;
}

struct LaunchHeader {
  int32_t dim[maxRank] = {1, 1, 1, 1};
  union {
    /// Address of the record that checks write to, in code that has checks.
    uint64_t errorRecord = 0;
    /// GPU code without checks whose schedule may reverse the order of blocks:
    /// 1 if this launch runs them last to first.
    uint64_t reversed;
  };
};
static_assert(sizeof(LaunchHeader) == 24 && offsetof(LaunchHeader, dim) == 0 &&
              offsetof(LaunchHeader, errorRecord) == 16);

/// Lowest offset of an argument in the parameter block.
inline constexpr size_t firstArgument = sizeof(LaunchHeader);

/// The finding of a check: an index outside of an array, of another object, or
/// of one whose indices count from the beginning only; a failed assertion; an
/// error of release mode.
enum class CheckKind : uint8_t {
  OutOfBounds = 0,
  Assertion = 1,
  Part = 2,
  Offset = 3,
  Failure = 4
};

/// Written once, by the first failed check of a launch.
struct ErrorRecord {
  int32_t flag = 0;
  /// Index into `Code::sites`.
  int32_t site = 0;
  int64_t index[maxRank] = {0, 0, 0, 0};
  int32_t shape[maxRank] = {0, 0, 0, 0};
  CheckKind kind = CheckKind::OutOfBounds;
  /// How many entries of `index` and `shape` count.
  uint8_t rank = 0;
  int16_t pad[3] = {0, 0, 0};
};
static_assert(sizeof(ErrorRecord) == 64 && offsetof(ErrorRecord, flag) == 0 &&
              offsetof(ErrorRecord, site) == 4 &&
              offsetof(ErrorRecord, index) == 8 &&
              offsetof(ErrorRecord, shape) == 40 &&
              offsetof(ErrorRecord, kind) == 56 &&
              offsetof(ErrorRecord, rank) == 57);

using CpuEntry = void (*)(const void *params, int64_t begin, int64_t end);

} // namespace warp

/// `printf` of kernels on the CPU.
extern "C" WARP_API int warp_printf(const char *format, ...);

#endif // WARP_LAUNCH_H
