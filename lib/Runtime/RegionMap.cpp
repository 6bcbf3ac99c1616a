//===- RegionMap.cpp - Interval map of memory regions ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "warp/RegionMap.h"

#include <algorithm>

using namespace warp;

namespace {

/// The place at which a block is looked for: in `pitch`, if that is not 0, by
/// columns.
struct Place {
  int64_t pitch;
  uint64_t begin, end;

  int lengthClass() const { return 64 - __builtin_clzll(end - begin); }
};

} // namespace

/// The place of a block, within rows of `pitch` bytes if its rows are so long.
static Place placeOf(const MemoryBlock &block) {
  if (block.rank) {
    int64_t pitch = block.dims[0].stride;
    MemoryBlock row = block;
    std::copy(block.dims + 1, block.dims + block.rank, row.dims);
    --row.rank;
    uint64_t begin = block.start % pitch, length = row.end() - row.start;
    if (block.rank > 1 || block.dims[0].step == 1) {
      bool isColumn =
          2 * length < uint64_t(pitch) && begin + length <= uint64_t(pitch);
      if (isColumn)
        return {pitch, begin, begin + length};
    }
  }
  return {0, block.start, block.end()};
}

void RegionMap::collect(const Line &line, uint64_t begin, uint64_t end,
                        std::vector<int64_t> &found) {
  for (const auto &[bits, entries] : line) {
    // The longest of this class has fewer than 2^bits bytes.
    uint64_t reach = bits < 64 ? (uint64_t(1) << bits) : ~uint64_t(0);
    uint64_t first = begin > reach ? begin - reach : 0;
    for (auto entry = entries.lower_bound({first, 0});
         entry != entries.end() && entry->first < end; ++entry)
      found.push_back(entry->second);
  }
}

int64_t RegionMap::find(const Region &region) const {
  auto [begin, end] = byContents.equal_range(region.hash());
  for (auto entry = begin; entry != end; ++entry)
    if (regions.at(entry->second) == region)
      return entry->second;
  return -1;
}

int64_t RegionMap::add(const Region &region) {
  int64_t number = find(region);
  if (number >= 0)
    return number;
  number = next++;
  regions.emplace(number, region);
  byContents.emplace(region.hash(), number);
  for (const MemoryBlock &block : region.blocks) {
    Place place = placeOf(block);
    Line &line = place.pitch ? byColumn[place.pitch] : byAddress;
    line[place.lengthClass()].insert({place.begin, number});
  }
  return number;
}

void RegionMap::remove(int64_t number) {
  auto known = regions.find(number);
  if (known == regions.end())
    return;
  const Region &region = known->second;
  for (const MemoryBlock &block : region.blocks) {
    Place place = placeOf(block);
    Line &line = place.pitch ? byColumn[place.pitch] : byAddress;
    line[place.lengthClass()].erase({place.begin, number});
  }
  auto [begin, end] = byContents.equal_range(region.hash());
  for (auto entry = begin; entry != end; ++entry)
    if (entry->second == number) {
      byContents.erase(entry);
      break;
    }
  regions.erase(known);
}

void RegionMap::clear() {
  regions.clear();
  byContents.clear();
  byAddress.clear();
  byColumn.clear();
}

void RegionMap::meeting(const Region &region,
                        std::vector<int64_t> &found) const {
  found.clear();
  for (const MemoryBlock &block : region.blocks) {
    collect(byAddress, block.start, block.end(), found);
    for (const auto &[pitch, line] : byColumn) {
      // The range in a row of a block that is no column of these rows.
      Place place = placeOf(block);
      if (place.pitch != pitch) {
        uint64_t length = block.end() - block.start;
        uint64_t begin = block.start % pitch;
        bool isInRow = begin + length <= uint64_t(pitch);
        place = {pitch, isInRow ? begin : 0,
                 isInRow ? begin + length : uint64_t(pitch)};
      }
      collect(line, place.begin, place.end, found);
    }
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  found.erase(std::remove_if(found.begin(), found.end(),
                             [&](int64_t number) {
                               return !regions.at(number).overlaps(region);
                             }),
              found.end());
}
