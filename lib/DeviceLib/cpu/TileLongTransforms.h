//===- TileLongTransforms.h - Fourier transforms in pairs of stages -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// For lengths that fill vectors in every stage. Two stages of radix 4 at a
// time, with 16 numbers per lane in registers: with j = 4a + b and k = k1 + 4
// k2,
//
//   y[q + s (16p + k)] = w^(4p k2) sum over b of i^(-b k2) w^((p + m b) k1)
//                        sum over a of i^(-a k1) x[q + s (p + m j)]
//
// for q < s, p < m; w is exp(-2 pi i / 16m). The first pair reads numbers as
// they lie in the tile, with lanes that are neighbours p, and exchanges rows
// and columns of its results; the last stage writes them as they lie in the
// tile.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILELONGTRANSFORMS_H
#define WARP_DEVICELIB_CPU_TILELONGTRANSFORMS_H

#include "TileComplex.h"
#include "TileSquares.h"

namespace {

/// Results go to `give(k, number)`; `outer(b)` and `inner()` are the factors
/// for k1 = 1 and k2 = 1. In the last pair p is 0.
template <bool isLast, class V, class Take, class Give, class Outer,
          class Inner>
__attribute__((always_inline)) inline void
pairAt(const Take &take, const Give &give, const Outer &outer,
       const Inner &inner) {
  Complex<V> y[4][4];
#pragma unroll
  for (int b = 0; b < 4; ++b) {
    Butterfly<V> made(take(b), take(4 + b), take(8 + b), take(12 + b));
    bool isTurned = !isLast || b > 0;
    Complex<V> w1 = made.y[0], w2 = w1, w3 = w1;
    if (isTurned) {
      w1 = outer(b);
      w2 = w1 * w1;
      w3 = w1 * w2;
    }
    y[b][0] = made.y[0];
    y[b][1] = isTurned ? made.y[1] * w1 : made.y[1];
    y[b][2] = isTurned ? made.y[2] * w2 : made.y[2];
    y[b][3] = isTurned ? made.y[3] * w3 : made.y[3];
  }
#pragma unroll
  for (int k1 = 0; k1 < 4; ++k1) {
    Butterfly<V> made(y[0][k1], y[1][k1], y[2][k1], y[3][k1]);
    give(k1, made.y[0]);
    if (isLast) {
      give(k1 + 4, made.y[1]);
      give(k1 + 8, made.y[2]);
      give(k1 + 12, made.y[3]);
    } else {
      Complex<V> w1 = inner(), w2 = w1 * w1, w3 = w1 * w2;
      give(k1 + 4, made.y[1] * w1);
      give(k1 + 8, made.y[2] * w2);
      give(k1 + 12, made.y[3] * w3);
    }
  }
}

template <class T> struct LongTransform {
  using V = Vec<T>;
  static constexpr int count = lanes<T>;
  /// Elements that fill vectors in the first pair.
  static constexpr i64 shortest = 16 * count;

  i64 n;
  Split<T> x, y;
  /// Factors of n and of n / 4.
  Split<const T> w, inner;

  void swap() {
    Split<T> old = x;
    x = y;
    y = old;
  }
  Complex<V> factor(i64 p) const {
    Complex<T> one = w.template load<T>(p);
    return {V(one.re), V(one.im)};
  }
  template <class From> void first(From in) const;
  template <bool isLast, class To> void pair(i64 length, i64 s, To to) const;
  template <bool isLast, class To> void stage(i64 length, i64 s, To to) const;
  template <class To> void run(To out);
};

template <class T>
template <class From>
void LongTransform<T>::first(From in) const {
  i64 m = n / 16;
  for (i64 p = 0; p < m; p += count) {
    // Results of so many k each.
    Square<T> re[16 / count], im[16 / count];
    pairAt<false, V>([&](int j) { return in.template load<V>(p + m * j); },
                     [&](int k, Complex<V> made) {
                       re[k / count].rows[k % count] = made.re;
                       im[k / count].rows[k % count] = made.im;
                     },
                     [&](int b) { return w.template load<V>(p + m * b); },
                     [&] { return inner.template load<V>(p); });
#pragma unroll
    for (int part = 0; part < 16 / count; ++part) {
      re[part].transpose();
      im[part].transpose();
#pragma unroll
      for (int l = 0; l < count; ++l)
        x.store(16 * (p + l) + part * count,
                Complex<V>{re[part].rows[l], im[part].rows[l]});
    }
  }
}

template <class T>
template <bool isLast, class To>
void LongTransform<T>::pair(i64 length, i64 s, To to) const {
  i64 m = length / 16;
  for (i64 p = 0; p < m; ++p)
    for (i64 q = 0; q < s; q += count)
      pairAt<isLast, V>(
          [&](int j) { return x.template load<V>(q + s * (p + m * j)); },
          [&](int k, Complex<V> made) { to.store(q + s * (16 * p + k), made); },
          [&](int b) { return factor((p + m * b) * s); },
          [&] { return factor(4 * p * s); });
}

template <class T>
template <bool isLast, class To>
void LongTransform<T>::stage(i64 length, i64 s, To to) const {
  i64 m = length / 4;
  for (i64 p = 0; p < m; ++p) {
    Complex<V> w1 = factor(p * s), w2 = w1 * w1, w3 = w1 * w2;
    for (i64 q = 0; q < s; q += count) {
      auto take = [&](int j) {
        return x.template load<V>(q + s * (p + m * j));
      };
      Butterfly<V> made(take(0), take(1), take(2), take(3));
      i64 place = q + 4 * s * p;
      to.store(place, made.y[0]);
      to.store(place + s, isLast ? made.y[1] : made.y[1] * w1);
      to.store(place + 2 * s, isLast ? made.y[2] : made.y[2] * w2);
      to.store(place + 3 * s, isLast ? made.y[3] : made.y[3] * w3);
    }
  }
}

/// After the first pair.
template <class T> template <class To> void LongTransform<T>::run(To out) {
  i64 s = 16, length = n / 16;
  for (; length > 16; length /= 16, s *= 16, swap())
    pair<false>(length, s, y);
  if (length == 16)
    return pair<true>(length, s, out);
  if (length == 4)
    return stage<true>(length, s, out);
  if (length == 8) {
    stage<false>(length, s, y);
    swap();
    s *= 4;
  }
  for (i64 q = 0; q < s; q += count) {
    Complex<V> a = x.template load<V>(q), b = x.template load<V>(q + s);
    out.store(q, a + b);
    out.store(q + s, a - b);
  }
}

} // namespace

#endif // WARP_DEVICELIB_CPU_TILELONGTRANSFORMS_H
