//===- TileTransforms.cpp - Fourier transforms of the rows of a tile ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lengths are powers of two. Real and imaginary parts lie apart, and stages of
// radix 4 go from one memory to another (Stockham's order), so that nothing is
// reordered at the end:
//
//   y[q + s (4p + k)] = w^(kp) sum over j of i^(-jk) x[q + s (p + m j)]
//
// for q < s, p < m, with s 4 times as large and m 4 times as small in each next
// stage; w is exp(-2 pi i / 4m). Contiguous indices are computed in vectors: q,
// and where s is short, q and p. The inverse has real and imaginary parts
// swapped. The factors of usual lengths are constants. Where two stages at a
// time fill vectors, they are in TileLongTransforms.h.
//
//===----------------------------------------------------------------------===//

#include "TileLongTransforms.h"

namespace {

template <class T> struct Transform {
  i64 n;
  Split<T> x, y;
  Split<const T> w;

  template <int s> void narrowStage(i64 length) const;
  template <int width> void stage(i64 length, i64 s) const;
  void lastPair(i64 s) const;
  void read(const T *in, bool inverse) const;
  void write(T *out, bool inverse) const;
  void run();
};

/// For s shorter than a vector: lanes are neighbours p, each with all q, so
/// results of a lane are next to each other.
template <class T>
template <int s>
void Transform<T>::narrowStage(i64 length) const {
  using V = Vec<T>;
  constexpr int count = lanes<T>;
  auto write = [&](T *to, V a, V b, V c, V d) {
    V ac[2], bd[2];
    interleave<s>(a, c, ac[0], ac[1]);
    interleave<s>(b, d, bd[0], bd[1]);
#pragma unroll
    for (int half = 0; half < 2; ++half) {
      V low, high;
      interleave<s>(ac[half], bd[half], low, high);
      ::store(to + 2 * half * count, low);
      ::store(to + (2 * half + 1) * count, high);
    }
  };
  /// A factor for each p.
  auto spread = [](V factors) {
    V made;
#pragma unroll
    for (int i = 0; i < count; ++i)
      made[i] = factors[i / s * s];
    return made;
  };
  i64 m = length / 4 * s;
  for (i64 p = 0; p < m; p += count) {
    Butterfly<V> made(x.template load<V>(p), x.template load<V>(p + m),
                      x.template load<V>(p + 2 * m),
                      x.template load<V>(p + 3 * m));
    Complex<V> w1 = w.template load<V>(p);
    w1 = {spread(w1.re), spread(w1.im)};
    Complex<V> w2 = w1 * w1, w3 = w1 * w2;
    Complex<V> b = made.y[1] * w1, c = made.y[2] * w2, d = made.y[3] * w3;
    write(y.re + 4 * p, made.y[0].re, b.re, c.re, d.re);
    write(y.im + 4 * p, made.y[0].im, b.im, c.im, d.im);
  }
}

template <class T>
template <int width>
void Transform<T>::stage(i64 length, i64 s) const {
  using V = typename LanesOf<T, width>::type;
  i64 m = length / 4;
  for (i64 p = 0; p < m; ++p) {
    Complex<T> one = w.template load<T>(p * s), two = one * one;
    Complex<T> three = one * two;
    Complex<V> w1{V(one.re), V(one.im)}, w2{V(two.re), V(two.im)};
    Complex<V> w3{V(three.re), V(three.im)};
    for (i64 q = 0; q < s; q += width) {
      i64 from = q + s * p, to = q + 4 * s * p;
      Butterfly<V> made(x.template load<V>(from),
                        x.template load<V>(from + s * m),
                        x.template load<V>(from + 2 * s * m),
                        x.template load<V>(from + 3 * s * m));
      y.store(to, made.y[0]);
      y.store(to + s, made.y[1] * w1);
      y.store(to + 2 * s, made.y[2] * w2);
      y.store(to + 3 * s, made.y[3] * w3);
    }
  }
}

/// For two numbers each, s apart.
template <class T> void Transform<T>::lastPair(i64 s) const {
  auto pairs = [&]<class V>(V, i64 q) {
    Complex<V> a = x.template load<V>(q), b = x.template load<V>(q + s);
    y.store(q, a + b);
    y.store(q + s, a - b);
  };
  i64 q = 0;
  for (; q + lanes<T> <= s; q += lanes<T>)
    pairs(Vec<T>(), q);
  for (; q < s; ++q)
    pairs(T(), q);
}

template <class T> void Transform<T>::run() {
  i64 s = 1, length = n;
  auto swap = [&] {
    Split<T> old = x;
    x = y;
    y = old;
  };
  for (; length >= 4; length /= 4, s *= 4, swap()) {
    bool fills = n / 4 >= lanes<T>;
    if (s == 1)
      fills ? narrowStage<1>(length) : stage<1>(length, s);
    else if (s == 4)
      fills ? narrowStage<4>(length) : stage<4>(length, s);
    else
      stage<lanes<T>>(length, s);
  }
  if (length == 1)
    return;
  lastPair(s);
  swap();
}

template <class T> void Transform<T>::read(const T *in, bool inverse) const {
  constexpr int count = lanes<T>;
  T *first = inverse ? x.im : x.re, *second = inverse ? x.re : x.im;
  i64 i = 0;
  for (; i + count <= n; i += count) {
    Vec<T> a = ::load(in + 2 * i), b = ::load(in + 2 * i + count), even, odd;
#pragma unroll
    for (int l = 0; l < count; ++l) {
      even[l] = l < count / 2 ? a[2 * l] : b[2 * l - count];
      odd[l] = l < count / 2 ? a[2 * l + 1] : b[2 * l + 1 - count];
    }
    ::store(first + i, even);
    ::store(second + i, odd);
  }
  for (; i < n; ++i) {
    first[i] = in[2 * i];
    second[i] = in[2 * i + 1];
  }
}

template <class T> void Transform<T>::write(T *out, bool inverse) const {
  constexpr int count = lanes<T>;
  const T *first = inverse ? x.im : x.re, *second = inverse ? x.re : x.im;
  i64 i = 0;
  for (; i + count <= n; i += count) {
    Vec<T> low, high;
    interleave<1>(::load(first + i), ::load(second + i), low, high);
    ::store(out + 2 * i, low);
    ::store(out + 2 * i + count, high);
  }
  for (; i < n; ++i) {
    out[2 * i] = first[i];
    out[2 * i + 1] = second[i];
  }
}

/// The factors for a length, which are computed where no table has them.
template <class T> Split<const T> factorsOf(i64 n, T *re, T *im) {
  if (n <= longestKnown) {
    i64 known = n < 4 ? 0 : n / 4 - 1;
    return {knownFactors<T>.re + known, knownFactors<T>.im + known};
  }
  setFactors(re, im, n);
  return {re, im};
}

/// Values that all rows share.
template <class T> struct Rows {
  T *out;
  const T *in;
  i64 rows, n;
  Split<T> x, y;
  Split<const T> factors;

  void shortOnes(bool inverse) const;
  template <bool inverse>
  __attribute__((noinline)) void longOnes(Split<const T> inner) const;
};

template <class T> void Rows<T>::shortOnes(bool inverse) const {
  for (i64 row = 0; row < rows; ++row) {
    Transform<T> work{n, x, y, factors};
    work.read(in + 2 * n * row, inverse);
    work.run();
    work.write(out + 2 * n * row, inverse);
  }
}

template <class T>
template <bool inverse>
void Rows<T>::longOnes(Split<const T> inner) const {
  for (i64 row = 0; row < rows; ++row) {
    LongTransform<T> work{n, x, y, factors, inner};
    work.first(Pairs<const T, inverse>{in + 2 * n * row});
    work.run(Pairs<T, inverse>{out + 2 * n * row});
  }
}

template <class T>
void transform(T *out, const T *in, T *scratch, i64 rows, i64 n, bool inverse) {
  T *made = scratch + 4 * n;
  Rows<T> work{out,
               in,
               rows,
               n,
               {scratch, scratch + n},
               {scratch + 2 * n, scratch + 3 * n},
               factorsOf(n, made, made + n)};
  if (n < LongTransform<T>::shortest)
    return work.shortOnes(inverse);
  Split<const T> inner = factorsOf(n / 4, made + n / 4, made + n + n / 4);
  inverse ? work.template longOnes<true>(inner)
          : work.template longOnes<false>(inner);
}

} // namespace

/// The scratch memory has room for three rows.
WARP_TILES void warp_tile_fft_f32(u64 out, u64 in, u64 scratch, i32 rows, i32 n,
                                  i32 inverse, void *) {
  transform(at<float>(out), at<const float>(in), at<float>(scratch), rows, n,
            inverse != 0);
}

WARP_TILES void warp_tile_fft_f64(u64 out, u64 in, u64 scratch, i32 rows, i32 n,
                                  i32 inverse, void *) {
  transform(at<double>(out), at<const double>(in), at<double>(scratch), rows, n,
            inverse != 0);
}
