//===- TileSystemAdjoints.cpp - Adjoints of factors of many blocks --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileSystems.h"

namespace {

template <class T> struct SystemAdjoints : Systems<T> {
  using V = typename Systems<T>::V;
  using Systems<T>::n, Systems<T>::inverses, Systems<T>::rowOf;

  /// The second triangle of the factor's cotangent.
  V *barOf(i64 i) const { return this->sides + i * (i + 1) / 2; }

  template <int width> void differentiate(i64 j, i64 k, V diagonal) const;
  void differentiate() const;
};

/// The contribution of earlier columns to column j of the factor. Iain Murray,
/// Differentiation of the Cholesky decomposition, 2016.
template <class T>
template <int width>
__attribute__((always_inline)) inline void
SystemAdjoints<T>::differentiate(i64 j, i64 k, V diagonal) const {
  V common[width], own[width];
#pragma unroll
  for (int c = 0; c < width; ++c) {
    common[c] = V(T(0));
    own[c] = rowOf(j)[k + c];
  }
  for (i64 i = j + 1; i < n; ++i) {
    V bar = barOf(i)[j];
#pragma unroll
    for (int c = 0; c < width; ++c)
      common[c] = fma(bar, rowOf(i)[k + c], common[c]);
  }
#pragma unroll
  for (int c = 0; c < width; ++c) {
    V change = fma(common[c], inverses[j], diagonal * own[c]);
    barOf(j)[k + c] -= change;
    own[c] *= -inverses[j];
  }
  for (i64 i = j + 1; i < n; ++i) {
    V bar = barOf(i)[j];
#pragma unroll
    for (int c = 0; c < width; ++c)
      barOf(i)[k + c] = fma(bar, own[c], barOf(i)[k + c]);
  }
}

/// In place of the cotangent, columns from the last to the first.
template <class T> void SystemAdjoints<T>::differentiate() const {
  for (i64 j = n - 1; j >= 0; --j) {
    V common = V(T(0)), over = inverses[j];
    for (i64 i = j + 1; i < n; ++i)
      common = fma(barOf(i)[j], rowOf(i)[j], common);
    V diagonal = (barOf(j)[j] - common * over) * over;
    i64 k = 0;
    for (; k + 4 <= j; k += 4)
      differentiate<4>(j, k, diagonal);
    for (; k < j; ++k)
      differentiate<1>(j, k, diagonal);
    barOf(j)[j] = diagonal * V(T(0.5));
    for (i64 i = j + 1; i < n; ++i)
      barOf(i)[j] *= over;
  }
}

/// In place of the cotangents.
template <class T>
void differentiateAll(u64 bar, u64 factor, u64 scratch, i64 bytes, i64 systems,
                      i64 n, bool upper) {
  SystemAdjoints<T> work{};
  work.step = bytes / i64(sizeof(T));
  work.n = n;
  i64 rows = work.padded(), triangle = rows * (rows + 1) / 2;
  Vec<T> *l = at<Vec<T>>(scratch);
  work.inverses = l + triangle;
  work.sides = work.inverses + rows;
  for (i64 first = 0; first < systems; first += lanes<T>) {
    u64 behind = u64(first * bytes);
    work.systems = systems - first < lanes<T> ? systems - first : lanes<T>;
    work.out = at<T>(bar + behind);
    auto read = [&](u64 matrix, Vec<T> *into) {
      work.in = at<const T>(matrix + behind);
      work.l = into;
      upper ? work.template readMatrix<true>()
            : work.template readMatrix<false>();
    };
    read(bar, work.sides);
    read(factor, l);
    work.invertDiagonal();
    work.differentiate();
    work.l = work.sides;
    upper ? work.template writeFactor<true>()
          : work.template writeFactor<false>();
  }
}

} // namespace

#define WARP_SYSTEMS_ADJOINT(name, T)                                          \
  WARP_TILES void name(u64 bar, u64 factor, u64 scratch, i32 bytes,            \
                       i32 systems, i32 n, i32 upper, void *) {                \
    differentiateAll<T>(bar, factor, scratch, bytes, systems, n, upper != 0);  \
  }

WARP_SYSTEMS_ADJOINT(warp_tile_systems_adjoint_f32, float)
WARP_SYSTEMS_ADJOINT(warp_tile_systems_adjoint_f64, double)
