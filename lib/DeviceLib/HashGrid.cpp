//===- HashGrid.cpp - Cell ranges of hash grid queries --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Distances are in the type of the points. The form for lanes has one loop that
// the compiler makes one of vectors; a query beyond the grid's first round, if
// there is one, is wrapped behind it.
//
//===----------------------------------------------------------------------===//

#include "geometry/Exports.h"
#include "geometry/GridCells.h"

using namespace warp::geometry;

template <class F>
static inline CellBox findCells(F inverse, i32 nx, i32 ny, i32 nz, F x, F y,
                                F z, F distance) {
  CellRange i(x, distance, inverse, nx), j(y, distance, inverse, ny),
      k(z, distance, inverse, nz);
  bool asks = asksGrid(x, y, z, distance);
  return {wrapCell(i.first, nx), i.count,
          wrapCell(j.first, ny), j.count,
          wrapCell(k.first, nz), asks ? k.count : 0};
}

WARP_GEOMETRY_PART warp_grid_cells_f32(f32 inverse, i32 nx, i32 ny, i32 nz,
                                       f32 x, f32 y, f32 z, f32 distance,
                                       CellBox *result) {
  *result = findCells(inverse, nx, ny, nz, x, y, z, distance);
}

WARP_GEOMETRY_PART warp_grid_cells_f64(f64 inverse, i32 nx, i32 ny, i32 nz,
                                       f64 x, f64 y, f64 z, f64 distance,
                                       CellBox *result) {
  *result = findCells(inverse, nx, ny, nz, x, y, z, distance);
}

#ifndef WARP_GPU

/// Results are as many numbers as lanes for each member of a box.
template <class F>
static inline void
findCellsOfLanes(F inverse, i32 nx, i32 ny, i32 nz, const F *x, const F *y,
                 const F *z, const F *distances, i32 lanes, i32 *result) {
  i32 *counts[3] = {result + lanes, result + 3 * lanes, result + 5 * lanes};
  i32 *firsts[3] = {result, result + 2 * lanes, result + 4 * lanes};
  const i32 cells[3] = {nx, ny, nz};
  u32 outside = 0;
#pragma clang loop vectorize(enable) interleave(disable)
  for (i32 n = 0; n < lanes; ++n) {
    F distance = distances[n];
    CellRange i(x[n], distance, inverse, nx), j(y[n], distance, inverse, ny),
        k(z[n], distance, inverse, nz);
    firsts[0][n] = i.first;
    firsts[1][n] = j.first;
    firsts[2][n] = k.first;
    counts[0][n] = i.count;
    counts[1][n] = j.count;
    counts[2][n] = asksGrid(x[n], y[n], z[n], distance) ? k.count : 0;
    outside |= u32(u32(i.first) >= u32(nx)) | u32(u32(j.first) >= u32(ny)) |
               u32(u32(k.first) >= u32(nz));
  }
  if (!outside)
    return;
  for (i32 axis = 0; axis < 3; ++axis)
    for (i32 n = 0; n < lanes; ++n)
      firsts[axis][n] = wrapCell(firsts[axis][n], cells[axis]);
}

WARP_GEOMETRY warp_grid_cells_f32_lanes(f32 inverse, i32 nx, i32 ny, i32 nz,
                                        const f32 *x, const f32 *y,
                                        const f32 *z, const f32 *distance,
                                        i32 lanes, i32 *result) {
  findCellsOfLanes(inverse, nx, ny, nz, x, y, z, distance, lanes, result);
}

WARP_GEOMETRY warp_grid_cells_f64_lanes(f64 inverse, i32 nx, i32 ny, i32 nz,
                                        const f64 *x, const f64 *y,
                                        const f64 *z, const f64 *distance,
                                        i32 lanes, i32 *result) {
  findCellsOfLanes(inverse, nx, ny, nz, x, y, z, distance, lanes, result);
}

#endif
