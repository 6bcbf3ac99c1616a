//===- Cuts.h - Binned splits of BVH builds ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Primitives are counted in bins of their centroids along all axes in one
// sweep; the cut between two bins that costs least wins. A second sweep orders
// the primitives by their side, each side as it was before. The centroids of a
// side are in its box, so bins need no sweep for their extent. Where boxes are
// so much larger that all centroids are in one bin, nothing is cut; who then
// halves the range finds the extent of the halves' centroids (`makeRange`).
//
// Large ranges are swept by several threads, in chunks whose results are
// joined in order: nothing depends on the number of threads.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_GEOMETRY_CUTS_H
#define WARP_LIB_GEOMETRY_CUTS_H

#include "HierarchyBuilder.h"

#include <cstring>
#include <utility>

namespace warp::geometry {

/// A box as the eight numbers of a primitive, highs negated, so that the least
/// of two has both; what is behind the box means nothing.
inline Floats boxOf(const BuildPrimitive &primitive) {
  static_assert(sizeof(BuildPrimitive) == sizeof(Floats));
  Ints bits;
  std::memcpy(&bits, &primitive, sizeof bits);
  bits ^= Ints{0, 0, 0, 1, 1, 1, 0, 0} << 31;
  return __builtin_bit_cast(Floats, bits);
}

/// Primitives [begin, end).
struct Range {
  int64_t begin = 0, end = 0;
  /// The box of the primitives, and the box of twice their centroids, as
  /// `boxOf` has it.
  Floats box = Floats(infinity), centroids = Floats(infinity);

  int64_t size() const { return end - begin; }
  Bounds bounds() const {
    return {{box[0], box[1], box[2]}, {-box[3], -box[4], -box[5]}};
  }
  float area() const { return bounds().area(); }
};

/// The primitives, and as much memory to order them in; threads have ranges of
/// their own in both.
struct Sorted {
  std::vector<BuildPrimitive> &primitives;
  std::vector<BuildPrimitive> spare;

  explicit Sorted(std::vector<BuildPrimitive> &primitives)
      : primitives(primitives), spare(primitives.size()) {}
};

/// A range with its boxes.
Range makeRange(const Sorted &all, int64_t begin, int64_t end);

/// Cuts a range by the surface area heuristic. False, and nothing is done, if
/// all centroids are in one bin.
bool cutByArea(Sorted &all, const Range &range,
               std::pair<Range, Range> &halves);

} // namespace warp::geometry

#endif // WARP_LIB_GEOMETRY_CUTS_H
