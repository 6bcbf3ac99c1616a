//===- MemoryTracker.h - Memory tracker by call site ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A list of the allocations that were made while somebody watched, with the
// place in the user's program that each comes from. Nothing is noted, and
// nothing is spent, for the others.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_MEMORYTRACKER_H
#define WARP_MEMORYTRACKER_H

#include "warp/Export.h"
#include "warp/Forks.h"

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace warp {

class WARP_API MemoryTracker {
public:
  struct Allocation {
    const void *memory;
    size_t bytes;
    int device;
    bool pinned;
    /// "step.py:12 (simulate)".
    std::string site;
    /// Allocations are numbered in their order.
    uint64_t number;
  };
  struct Totals {
    size_t current = 0, peak = 0;
    uint64_t allocations = 0, frees = 0;
  };

  static MemoryTracker &get();

  void add(const void *memory, size_t bytes, int device, bool pinned,
           const std::string &site);
  void remove(const void *memory);
  /// Forgets everything.
  void clear();

  /// The live allocations, in the order of allocation.
  std::vector<Allocation> live() const;
  /// By device; -2 is pinned host memory.
  std::map<int, Totals> totals() const;
  /// The sites with most memory on a device: "1.0 GiB at a.py:3, ...". Empty
  /// if nothing is tracked.
  std::string largestUsers(int device, size_t count = 3) const;

private:
  mutable ForkMutex mutex;
  std::map<const void *, Allocation> allocations;
  std::map<int, Totals> sums;
  uint64_t next = 0;
};

} // namespace warp

#endif // WARP_MEMORYTRACKER_H
