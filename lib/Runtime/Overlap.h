//===- Overlap.h - Alias checks of launch arguments -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_OVERLAP_H
#define WARP_LIB_RUNTIME_OVERLAP_H

#include "warp/Compile.h"
#include "warp/Launch.h"

#include <optional>
#include <vector>

namespace warp {

/// From the lowest address of an array to the end of its last element.
struct AddressRange {
  uint64_t begin = 0, end = 0;

  bool overlaps(const AddressRange &other) const {
    return begin < other.end && other.begin < end;
  }
};

/// The range of elements of that size at `data`, with the extents of a
/// descriptor and its strides times `strideScale`; empty without elements.
AddressRange rangeOf(const void *data, const ArrayDescriptor &array,
                     int64_t elementSize, int64_t strideScale);

/// The same for a descriptor that nobody has checked: nothing if it is none, or
/// if its elements or their bytes are more than 2^62.
std::optional<AddressRange> possibleRangeOf(const void *data,
                                            const ArrayDescriptor &array,
                                            int64_t elementSize,
                                            int64_t strideScale);

/// True if no array that the kernel writes, and none of the gradients of such,
/// overlaps another array of the launch or its gradient.
bool areDisjoint(const std::vector<Access> &accesses, const void *params);

} // namespace warp

#endif // WARP_LIB_RUNTIME_OVERLAP_H
