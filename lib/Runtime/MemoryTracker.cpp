//===- MemoryTracker.cpp - Memory tracker: allocations by call site -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/MemoryTracker.h"

#include "Support.h"

#include <algorithm>

using namespace warp;

static constexpr int pinnedKey = -2;

MemoryTracker &MemoryTracker::get() {
  static auto *tracker = new MemoryTracker;
  return *tracker;
}

void MemoryTracker::add(const void *memory, size_t bytes, int device,
                        bool pinned, const std::string &site) {
  std::lock_guard lock(mutex);
  allocations[memory] = {memory, bytes, device, pinned, site, next++};
  Totals &sum = sums[pinned ? pinnedKey : device];
  ++sum.allocations;
  sum.current += bytes;
  sum.peak = std::max(sum.peak, sum.current);
}

void MemoryTracker::remove(const void *memory) {
  std::lock_guard lock(mutex);
  auto found = allocations.find(memory);
  // Absent after `clear`.
  if (found == allocations.end())
    return;
  const Allocation &gone = found->second;
  Totals &sum = sums[gone.pinned ? pinnedKey : gone.device];
  ++sum.frees;
  sum.current -= gone.bytes;
  allocations.erase(found);
}

void MemoryTracker::clear() {
  std::lock_guard lock(mutex);
  allocations.clear();
  sums.clear();
}

std::vector<MemoryTracker::Allocation> MemoryTracker::live() const {
  std::vector<Allocation> list;
  {
    std::lock_guard lock(mutex);
    for (const auto &[memory, allocation] : allocations)
      list.push_back(allocation);
  }
  std::sort(list.begin(), list.end(),
            [](const auto &a, const auto &b) { return a.number < b.number; });
  return list;
}

std::map<int, MemoryTracker::Totals> MemoryTracker::totals() const {
  std::lock_guard lock(mutex);
  return sums;
}

std::string MemoryTracker::largestUsers(int device, size_t count) const {
  std::map<std::string, size_t> bySite;
  for (const Allocation &allocation : live())
    if (allocation.device == device)
      bySite[allocation.site] += allocation.bytes;
  std::vector<std::pair<size_t, std::string>> order;
  for (const auto &[site, bytes] : bySite)
    order.emplace_back(bytes, site);
  std::sort(order.rbegin(), order.rend());
  std::string text;
  for (size_t i = 0; i < std::min(count, order.size()); ++i)
    text += (i ? ", " : "") + formatBytes(order[i].first) + " at " +
            order[i].second;
  return text;
}
