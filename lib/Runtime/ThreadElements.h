//===- ThreadElements.h - Elements that one thread touches ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_THREADELEMENTS_H
#define WARP_LIB_RUNTIME_THREADELEMENTS_H

#include "warp/Kernel.h"
#include "warp/Launch.h"

#include <optional>
#include <string>
#include <vector>

namespace warp {

/// An access of a launch, as far as it depends on the thread.
struct ThreadAccess {
  /// `base` plus the thread's indices times factors, if that is known.
  struct Index {
    bool isKnown = false;
    int64_t base = 0, factors[maxRank] = {};
    bool operator==(const Index &other) const = default;
  };

  ArrayDescriptor array;
  int64_t elementSize = 0;
  bool writes = false;
  /// By dimension of the array.
  Index indices[maxRank];
  /// The parameter.
  std::string name;
};

/// The accesses of a launch to the arrays in its arguments.
std::vector<ThreadAccess>
threadAccesses(const Kernel &kernel, const LaunchDim &dim, const void *params);

/// Nothing if no two threads share an element that one of two launches of the
/// same extents writes; otherwise the name of an array where they may.
std::optional<std::string> findCrossing(const std::vector<ThreadAccess> &first,
                                        const std::vector<ThreadAccess> &second,
                                        const LaunchDim &dim);

/// The same for rows, the threads of one index of the first extent, which two
/// launches have in common.
std::optional<std::string>
findRowCrossing(const std::vector<ThreadAccess> &first, const LaunchDim &dim,
                const std::vector<ThreadAccess> &second,
                const LaunchDim &otherDim);

/// True if two launches may touch one element that one of them writes.
bool mayMeet(const std::vector<ThreadAccess> &first,
             const std::vector<ThreadAccess> &second);

} // namespace warp

#endif // WARP_LIB_RUNTIME_THREADELEMENTS_H
