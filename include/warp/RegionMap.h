//===- RegionMap.h - Interval map of memory regions -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds those of many regions that share memory with a given one. Blocks are
// found by their range of addresses. Columns of a matrix all have nearly the
// same range, so blocks that take a small part of each row are found by their
// place within a row instead.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_REGIONMAP_H
#define WARP_REGIONMAP_H

#include "warp/Regions.h"

#include <map>
#include <set>
#include <unordered_map>

namespace warp {

class WARP_API RegionMap {
public:
  /// The number of a region; the same one if it is there.
  int64_t add(const Region &region);
  /// Its number, or -1.
  int64_t find(const Region &region) const;
  void remove(int64_t number);
  const Region &operator[](int64_t number) const { return regions.at(number); }
  size_t size() const { return regions.size(); }
  void clear();

  /// Numbers of the regions that share a byte with one, in no order.
  void meeting(const Region &region, std::vector<int64_t> &found) const;

private:
  /// Numbers by the first byte, in classes by the bits of the length.
  using Line = std::map<int, std::set<std::pair<uint64_t, int64_t>>>;

  static void collect(const Line &line, uint64_t begin, uint64_t end,
                      std::vector<int64_t> &found);

  std::unordered_map<int64_t, Region> regions;
  std::unordered_multimap<size_t, int64_t> byContents;
  Line byAddress;
  /// By the place within a row, for each length of rows.
  std::map<int64_t, Line> byColumn;
  int64_t next = 0;
};

} // namespace warp

#endif // WARP_REGIONMAP_H
