//===- TileBlockFactors.cpp - Factors by blocks of any shape --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For matrices, blocks and architectures that TileFactors.cpp,
// TileFactorAdjoints.cpp and TileSubstitutions.cpp are not for.
//
//===----------------------------------------------------------------------===//

#include "Tiles.h"

#include "tiles/Factors.h"

namespace {

struct Block {
  i32 thread, threads;

  WARP_INLINE explicit Block(i32 threads)
      : thread(threadNumber()), threads(threads) {}
  WARP_INLINE void barrier() const {
    if (threads > 1)
      syncThreads();
  }
};

template <class T> using Matrix = tiles::Matrix<Shared<T> *>;

} // namespace

#define WARP_BLOCK_FACTORS(suffix, T)                                          \
  WARP_TILES warp_tile_block_factor_##suffix(                                  \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      i32 n, i32 threads, void *) {                                            \
    tiles::factor<T>(Block(threads),                                           \
                     Matrix<T>{shared<T>(to), toRow, toColumn},                \
                     Matrix<T>{shared<T>(from), fromRow, fromColumn}, n);      \
  }                                                                            \
  WARP_TILES warp_tile_block_factor_adjoint_##suffix(                          \
      u64 to, i32 toRow, i32 toColumn, u64 from, i32 fromRow, i32 fromColumn,  \
      i32 n, i32 threads, void *) {                                            \
    tiles::factorAdjoint<T>(                                                   \
        Block(threads), Matrix<T>{shared<T>(to), toRow, toColumn},             \
        Matrix<T>{shared<T>(from), fromRow, fromColumn}, n);                   \
  }                                                                            \
  WARP_TILES warp_tile_block_solve_##suffix(u64 x, u64 m, i32 row, i32 column, \
                                            i32 n, i32 columns, i32 backwards, \
                                            i32 threads, void *) {             \
    tiles::solve<T>(Block(threads), Matrix<T>{shared<T>(x), columns, 1},       \
                    Matrix<T>{shared<T>(m), row, column}, n, columns,          \
                    backwards != 0);                                           \
  }

WARP_BLOCK_FACTORS(f32, float)
WARP_BLOCK_FACTORS(f64, double)
