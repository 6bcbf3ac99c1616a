//===- TileMatrices.h - Matrices in the memory of a block -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Matrices come with the elements from row to row and column to column, so that
// one code does for both triangles.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GPU_TILEMATRICES_H
#define WARP_DEVICELIB_GPU_TILEMATRICES_H

#include "Tiles.h"

namespace {

using Four = Vec<float, 4>;

WARP_INLINE void meetLanes() { asm volatile("bar.warp.sync -1;" ::: "memory"); }

/// All threads of the block.
WARP_INLINE void meet(i32 threads) {
  if (threads == 32)
    meetLanes();
  else
    asm volatile("bar.sync 0;" ::: "memory");
}

WARP_INLINE float fromLane(float value, i32 lane) {
  float result;
  asm volatile("shfl.sync.idx.b32 %0, %1, %2, 31, -1;"
               : "=f"(result)
               : "f"(value), "r"(lane));
  return result;
}

WARP_INLINE float inverse(float x) {
  float result;
  asm("rcp.rn.f32 %0, %1;" : "=f"(result) : "f"(x));
  return result;
}

struct Matrix {
  u64 place;
  i32 row, column;

  WARP_INLINE Shared<float> *at(i32 i, i32 j) const {
    return shared<float>(place) + (i * row + j * column);
  }
  /// Four elements of a row, the first at a multiple of four.
  WARP_INLINE Four four(i32 i, i32 j) const {
    if (column == 1 && row % 4 == 0)
      return *(Shared<Four> *)at(i, j);
    return Four{*at(i, j), *at(i, j + 1), *at(i, j + 2), *at(i, j + 3)};
  }
  WARP_INLINE void setFour(i32 i, i32 j, Four values) const {
    if (column == 1 && row % 4 == 0) {
      *(Shared<Four> *)at(i, j) = values;
      return;
    }
#pragma unroll
    for (int k = 0; k < 4; ++k)
      *at(i, j + k) = values[k];
  }
};

} // namespace

#endif // WARP_DEVICELIB_GPU_TILEMATRICES_H
