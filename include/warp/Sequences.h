//===- Sequences.h - Scans, sorts and runs ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Primitives that libraries need besides kernels: prefix sums, stable sorts of
// pairs, and lengths of runs. On the CPU the work is spread over the thread
// pool and done on return; on CUDA it is queued. Both can be captured in a
// graph, and results do not depend on the number of threads.
//
// Order of keys: numbers ascending, -0 equal to +0, every NaN after +infinity.
// Pairs with equal keys keep their order.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_SEQUENCES_H
#define WARP_SEQUENCES_H

#include "warp/Device.h"
#include "warp/Export.h"

#include <cstdint>

namespace warp {

enum class NumberType { Int32, UInt32, Float32, Int64, UInt64, Float64 };

inline int sizeOf(NumberType kind) {
  return static_cast<int>(kind) < static_cast<int>(NumberType::Int64) ? 4 : 8;
}

/// Elements at a distance of `stride` bytes.
struct Sequence {
  void *data;
  int64_t stride;
};

/// Sums of all elements up to each one, which is counted itself if
/// `inclusive`. An element is `width` numbers that are summed on their own. On
/// the CPU, sums of 32-bit floats are kept in 64 bits and rounded once.
/// `out` may be `in`.
WARP_API void scanNumbers(int device, NumberType kind, int width, Sequence out,
                          Sequence in, int64_t count, bool inclusive,
                          const Stream *stream = nullptr);

/// Pairs to be sorted. Behind each of the two there is room for as much again,
/// which is overwritten.
struct Pairs {
  NumberType kind;
  void *keys;
  void *values;
  /// Bytes of a value: 4 or 8.
  int valueSize;
  int64_t count;
};

/// Sorts by the bits [beginBit, endBit) of the keys. Keys are compared as
/// unsigned numbers of the same order.
WARP_API void sortPairs(int device, const Pairs &pairs, int beginBit,
                        int endBit, const Stream *stream = nullptr);

/// The same, but for where the result is: returns whether it is in the room
/// behind the pairs, which saves a copy.
WARP_API bool sortPairsAnywhere(int device, const Pairs &pairs, int beginBit,
                                int endBit, const Stream *stream = nullptr);

/// Sorts each of `segments` ranges [begins[i], ends[i]) on its own; they must
/// not overlap. A range that does not lie within the pairs is an error on the
/// CPU; on CUDA it stays as it is. There keys and values have 32 bits, and
/// ranges of more than 512 pairs are sorted by a block each.
WARP_API void sortSegments(int device, const Pairs &pairs,
                           const int32_t *begins, const int32_t *ends,
                           int64_t segments, const Stream *stream = nullptr);

/// Numbers of one width, `size` bytes, and the runs of equal bits in them.
struct Runs {
  int size;
  const void *numbers;
  int64_t count;
  /// One entry per run.
  void *runNumbers;
  int32_t *runLengths;
  /// How many runs there are.
  int32_t *runCount;
};

/// Less than 2^31 numbers on CUDA.
WARP_API void findRuns(int device, const Runs &runs,
                       const Stream *stream = nullptr);

} // namespace warp

#endif // WARP_SEQUENCES_H
