//===- TileComplex.h - Complex numbers of Fourier transforms ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Vectors of real parts and of imaginary parts, where they lie in memory, and
// the factors exp(-2 pi i j / n), which are constants for usual lengths.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_TILECOMPLEX_H
#define WARP_DEVICELIB_CPU_TILECOMPLEX_H

#include "Tiles.h"

namespace {

template <class T, int n> struct LanesOf {
  using type = T __attribute__((ext_vector_type(n)));
};
template <class T> struct LanesOf<T, 1> {
  using type = T;
};

template <class V> struct Complex {
  V re, im;

  Complex operator+(Complex x) const { return {re + x.re, im + x.im}; }
  Complex operator-(Complex x) const { return {re - x.re, im - x.im}; }
  Complex operator*(Complex w) const {
    return {re * w.re - im * w.im, re * w.im + im * w.re};
  }
  /// Times -i.
  Complex turned() const { return {im, -re}; }
};

/// The four sums of a butterfly, before they are turned.
template <class V> struct Butterfly {
  Complex<V> y[4];

  Butterfly(Complex<V> a, Complex<V> b, Complex<V> c, Complex<V> d) {
    Complex<V> even = a + c, odd = b + d;
    Complex<V> left = a - c, right = (b - d).turned();
    y[0] = even + odd;
    y[1] = left + right;
    y[2] = even - odd;
    y[3] = left - right;
  }
};

/// a0 b0 a1 b1 ..., of runs of `run` elements each.
template <int run, class V>
__attribute__((always_inline)) inline void interleave(V a, V b, V &low,
                                                      V &high) {
  constexpr int count = sizeof(V) / sizeof(a[0]);
#pragma unroll
  for (int i = 0; i < count; ++i) {
    int from = i / (2 * run) * run + i % run;
    bool isFirst = i / run % 2 == 0;
    low[i] = isFirst ? a[from] : b[from];
    high[i] = isFirst ? a[count / 2 + from] : b[count / 2 + from];
  }
}

/// A number per element, its parts in two arrays.
template <class T> struct Split {
  T *re, *im;

  template <class V> Complex<V> load(i64 i) const {
    return {loadAs<V>(re + i), loadAs<V>(im + i)};
  }
  template <class V> void store(i64 i, Complex<V> x) const {
    storeAs(re + i, x.re);
    storeAs(im + i, x.im);
  }
};

/// Real and imaginary parts in turn; they change places if `isSwapped`.
template <class T, bool isSwapped> struct Pairs {
  T *parts;

  template <class V> Complex<V> load(i64 i) const {
    constexpr int count = lanes<T>;
    V a = loadAs<V>(parts + 2 * i), b = loadAs<V>(parts + 2 * i + count);
    V even, odd;
#pragma unroll
    for (int l = 0; l < count; ++l) {
      even[l] = l < count / 2 ? a[2 * l] : b[2 * l - count];
      odd[l] = l < count / 2 ? a[2 * l + 1] : b[2 * l + 1 - count];
    }
    return isSwapped ? Complex<V>{odd, even} : Complex<V>{even, odd};
  }
  template <class V> void store(i64 i, Complex<V> x) const {
    V low, high;
    interleave<1>(isSwapped ? x.im : x.re, isSwapped ? x.re : x.im, low, high);
    storeAs(parts + 2 * i, low);
    storeAs(parts + 2 * i + lanes<T>, high);
  }
};

/// Sine and cosine of an angle from 0 to pi / 4: series to the last bit.
constexpr void turn(double x, double &sine, double &cosine) {
  double z = x * x, s = 0, c = 0;
#pragma unroll
  for (int k = 8; k > 0; --k) {
    s = (1 - s) * z / (2 * k * (2 * k + 1));
    c = (1 - c) * z / (2 * k * (2 * k - 1));
  }
  sine = x * (1 - s);
  cosine = 1 - c;
}

/// exp(-2 pi i j / n) for j < n / 4.
template <class T> constexpr void setFactors(T *re, T *im, i64 n) {
  constexpr double full = 6.283185307179586476925;
  for (i64 j = 0; j < n / 4; ++j) {
    bool isLow = 8 * j <= n;
    double sine = 0, cosine = 0;
    turn(full * double(isLow ? j : n / 4 - j) / double(n), sine, cosine);
    re[j] = T(isLow ? cosine : sine);
    im[j] = -T(isLow ? sine : cosine);
  }
}

/// The roots of all lengths up to one: of n from element n / 4 - 1 on.
constexpr i64 longestKnown = 4096;
template <class T> struct FactorTable {
  T re[longestKnown / 2] = {}, im[longestKnown / 2] = {};

  constexpr FactorTable() {
    for (i64 n = 4; n <= longestKnown; n *= 2)
      setFactors(re + n / 4 - 1, im + n / 4 - 1, n);
  }
};
template <class T> constexpr FactorTable<T> knownFactors;

} // namespace

#endif // WARP_DEVICELIB_CPU_TILECOMPLEX_H
