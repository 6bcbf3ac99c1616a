//===- GraphVerify.cpp - Comparison of two orders of a graph --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "GraphVerify.h"

#include "GraphNodes.h"
#include "Overlap.h"
#include "warp/Error.h"
#include "warp/Memory.h"

#include <algorithm>

using namespace warp;

namespace {
struct Memory : AddressRange {
  int device;
};
} // namespace

/// The bytes from the first to the last one of each region, without overlaps.
static std::vector<Memory> memoryOf(const NodeRecord &record, int device) {
  std::vector<Memory> ranges;
  for (const NodeAccess &access : record.accesses)
    for (const MemoryBlock &block : access.region.blocks)
      if (block.start < outputAddress)
        ranges.push_back(
            {{block.start, block.end()}, access.isOnHost ? cpuDevice : device});
  std::sort(ranges.begin(), ranges.end(),
            [](const auto &a, const auto &b) { return a.begin < b.begin; });
  std::vector<Memory> merged;
  for (const Memory &range : ranges)
    if (!merged.empty() && range.begin < merged.back().end)
      merged.back().end = std::max(merged.back().end, range.end);
    else
      merged.push_back(range);
  return merged;
}

namespace {
/// Contents of memory.
class Snapshot {
public:
  /// Waits for a device before and after.
  Snapshot(int device, const std::vector<Memory> &ranges)
      : device(device), ranges(ranges) {
    synchronizeDevice(device);
    for (const Memory &range : ranges) {
      contents.emplace_back(range.end - range.begin, '\0');
      download(contents.back().data(),
               reinterpret_cast<const void *>(range.begin), range.device,
               contents.back().size());
    }
    synchronizeDevice(device);
  }
  void restore() const {
    for (size_t i = 0; i < ranges.size(); ++i)
      upload(reinterpret_cast<void *>(ranges[i].begin), ranges[i].device,
             contents[i].data(), contents[i].size());
    synchronizeDevice(device);
  }

  int device;
  const std::vector<Memory> &ranges;
  std::vector<std::string> contents;
};
} // namespace

/// Names of the parameters that have a byte.
static std::string namesAt(const NodeRecord &record, uint64_t address) {
  std::string names;
  for (const NodeAccess &access : record.accesses)
    for (const MemoryBlock &block : access.region.blocks) {
      std::string quoted = "'" + access.name + "'";
      if (block.start <= address && address < block.end() &&
          !access.name.empty() && names.find(quoted) == std::string::npos)
        names += (names.empty() ? "" : ", ") + quoted;
    }
  return names.empty() ? "memory" : names;
}

void warp::runBothOrders(int device, const GraphTrace &trace,
                         const std::function<void()> &recorded,
                         const std::function<void()> &ordered) {
  NodeRecord record = recordOf(trace, 0, trace.operations.size());
  if (!record.barrier.empty())
    return recorded();
  std::vector<Memory> ranges = memoryOf(record, device);
  Snapshot before(device, ranges);
  recorded();
  Snapshot expected(device, ranges);
  before.restore();
  ordered();
  Snapshot found(device, ranges);
  for (size_t i = 0; i < ranges.size(); ++i) {
    const std::string &a = expected.contents[i], &b = found.contents[i];
    size_t place =
        std::mismatch(a.begin(), a.end(), b.begin()).first - a.begin();
    if (place != a.size())
      throw Error(Error::Kind::Runtime,
                  "the optimized graph on '" + deviceInfo(device).alias +
                      "' differs from its recording in " +
                      namesAt(record, ranges[i].begin + place) + ", at byte " +
                      std::to_string(place) + " of " +
                      std::to_string(a.size()));
  }
}
