//===- PrivateCopies.h - Privatized arrays: one copy per worker -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code whose threads update elements that other threads update runs on several
// workers without atomic instructions if each has an array of its own: all but
// the first get a copy of values that change nothing, zeros for sums, and what
// the copies have received is combined with the arrays after the launch. The
// compiler lists the arrays (lib/Transforms/Updates/CopiedArrays.h), the
// runtime decides launch by launch whether copies pay
// (lib/Runtime/PrivateCopies.h).
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PRIVATECOPIES_H
#define WARP_PRIVATECOPIES_H

#include <cstdint>
#include <vector>

namespace warp {

/// The way in which a kernel updates the numbers of an array.
enum class CopyKind : int64_t { sum, min, max };

/// An array, or the gradients of one, that a kernel only updates in one way.
struct CopiedArray {
  /// The place of the array's descriptor in the parameter block; whether it is
  /// about the gradient there.
  int64_t descriptor = 0;
  int64_t gradient = 0;
  /// Bytes of an element of the array itself.
  int64_t elementSize = 0;
  /// Numbers of one element, or of its gradient; their bits, 32 or 64, and
  /// whether they are floats, or else integers without a sign.
  int64_t numbers = 1;
  int64_t width = 32;
  int64_t floating = 1;
  int64_t isUnsigned = 0;
  CopyKind kind = CopyKind::sum;

#if __cplusplus >= 202002L // programs of users may be C++17
  bool operator==(const CopiedArray &) const = default;
#endif
};

/// The compiler's facts about copies for a kernel.
struct CopiedArrays {
  /// None if copies would not do.
  std::vector<CopiedArray> list;
  /// Nanoseconds that a launch index is estimated to take without atomic
  /// instructions, and with them.
  double plainTime = 0, atomicTime = 0;
};

} // namespace warp

#endif // WARP_PRIVATECOPIES_H
