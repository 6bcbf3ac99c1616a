//===- TileSystems.cpp - Factors and solves of many blocks at a time ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileSystems.h"

namespace {

/// The steps to carry out, in this order.
enum Step { factors = 1, isUpper = 2, keeps = 4, forwards = 8, backwards = 16 };

template <class T> void run(const Systems<T> &work, i32 steps) {
  steps &isUpper ? work.template readMatrix<true>()
                 : work.template readMatrix<false>();
  if (steps & factors)
    work.factor();
  else
    work.invertDiagonal();
  if (steps & keeps)
    steps &isUpper ? work.template writeFactor<true>()
                   : work.template writeFactor<false>();
  if (!(steps & (forwards | backwards)))
    return;
  work.readSides();
  if (steps & forwards)
    work.solveForwards();
  if (steps & backwards)
    work.solveBackwards();
  work.writeSides();
}

/// As many systems at a time as a vector has lanes.
template <class T>
void solveAll(u64 out, u64 in, u64 x, u64 scratch, i64 bytes, i64 systems,
              i64 n, i64 columns, i32 steps) {
  Systems<T> work{};
  work.step = bytes / i64(sizeof(T));
  work.n = n;
  work.columns = columns;
  i64 rows = work.padded();
  work.l = at<Vec<T>>(scratch);
  work.inverses = work.l + rows * (rows + 1) / 2;
  work.sides = work.inverses + rows;
  for (i64 first = 0; first < systems; first += lanes<T>) {
    u64 behind = u64(first * bytes);
    work.out = at<T>(out + behind);
    work.in = at<const T>(in + behind);
    work.x = at<T>(x + behind);
    work.systems = systems - first < lanes<T> ? systems - first : lanes<T>;
    run(work, steps);
  }
}

} // namespace

#define WARP_SYSTEMS(name, T)                                                  \
  WARP_TILES void name(u64 out, u64 in, u64 x, u64 scratch, i32 bytes,         \
                       i32 systems, i32 n, i32 columns, i32 steps, void *) {   \
    solveAll<T>(out, in, x, scratch, bytes, systems, n, columns, steps);       \
  }

WARP_SYSTEMS(warp_tile_systems_f32, float)
WARP_SYSTEMS(warp_tile_systems_f64, double)
