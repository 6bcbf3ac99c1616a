//===- GridCells.h - Cells of a hash grid around a point --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_GRIDCELLS_H
#define WARP_DEVICELIB_GEOMETRY_GRIDCELLS_H

#include "Vectors.h"

#include "DeviceLib/Prototypes.h"

namespace warp::geometry {

/// Cells along an axis before the grid wraps: the first one, and how many, each
/// of the grid's once. For NaN it is some cell: callers check for NaN
/// before.
struct CellRange {
  i32 first, count;

  template <class F>
  CellRange(F point, F distance, F inverse, i32 cells)
      : first(cellOf((point - distance) * inverse)) {
    i64 last = cellOf((point + distance) * inverse);
    i64 all = last - first + 1;
    count = all < cells ? i32(all) : cells;
  }

private:
  /// For any coordinate in units of cells, as the builder has it.
  template <class F> static i32 cellOf(F scaled) {
    constexpr F end = 2147483648.0;
    F down = __builtin_elementwise_floor(scaled);
    bool isWithin = bool(i32(down > -end) & i32(down < end));
    i32 outside = down >= end ? largestInt : down <= -end ? -largestInt - 1 : 0;
    return isWithin ? i32(isWithin ? down : F(0)) : outside;
  }
};

/// The cell in the grid.
inline i32 wrapCell(i32 cell, i32 cells) {
  if (u32(cell) < u32(cells))
    return cell;
  i32 rest = cell % cells;
  return rest < 0 ? rest + cells : rest;
}

/// True if a query has cells at all.
template <class F> bool asksGrid(F x, F y, F z, F distance) {
  return i32(distance >= 0) & i32(x == x) & i32(y == y) & i32(z == z);
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_GRIDCELLS_H
