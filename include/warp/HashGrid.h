//===- HashGrid.h - Hash grids: neighbour search of points ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A periodic grid of cubes. After `build` kernels find the points of each cell
// in the order of the points.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_HASHGRID_H
#define WARP_HASHGRID_H

#include "warp/Export.h"
#include "warp/Handle.h"
#include "warp/Launch.h"

#include <cstddef>
#include <cstdint>
#include <memory>

namespace warp {

class WARP_API HashGrid {
public:
  /// Cells along the axes; fewer than 2^31 together.
  explicit HashGrid(const int32_t (&cells)[3]);
  ~HashGrid();

  uint64_t id() const;
  /// Sorts points of three floats of `scalarSize` bytes into cells that are
  /// `width` wide. Points that are NaN are in no cell.
  /// `groups` has a number for each point, or is empty, and is kept.
  void build(const ArrayDescriptor &points, int scalarSize, double width,
             const ArrayDescriptor &groups = {});
  /// Makes room for that many points.
  void reserve(int64_t points);
  /// Points of the last build that are in no cell.
  int64_t skipped() const;

private:
  struct Impl;
  /// Shared with graphs that update it.
  std::shared_ptr<Impl> impl;
};

} // namespace warp

#endif // WARP_HASHGRID_H
