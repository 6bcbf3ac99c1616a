//===- Predicates.h - Exact geometric predicates ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Sums of doubles that do not overlap are numbers of any precision (Shewchuk,
// "Adaptive precision floating-point arithmetic and fast robust geometric
// predicates", Discrete & Computational Geometry 18, 1997). Callers have tried
// a filter before: what comes here is flat or nearly so.
//
// Signs are exact unless a product overflows or its rounding error underflows,
// which coordinates that were floats before never do.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_PREDICATES_H
#define WARP_DEVICELIB_GEOMETRY_PREDICATES_H

#include "Vectors.h"

namespace warp::geometry {

/// A sum of at most so many parts, the smallest first, none of them 0.
template <int capacity> struct Expansion {
  f64 part[capacity];
  int count = 0;

  void add(f64 x) {
    int kept = 0;
    for (int i = 0; i < count; ++i) {
      f64 sum = part[i] + x, other = sum - part[i];
      f64 error = (part[i] - (sum - other)) + (x - other);
      x = sum;
      if (error != 0)
        part[kept++] = error;
    }
    if (x != 0)
      part[kept++] = x;
    count = kept;
  }

  /// Adds `sign` times a product, which takes 2 n m parts.
  template <int n, int m>
  void addProduct(const Expansion<n> &a, const Expansion<m> &b, f64 sign) {
    for (int i = 0; i < a.count; ++i)
      for (int j = 0; j < b.count; ++j) {
        f64 factor = sign * a.part[i], product = factor * b.part[j];
        add(fma(factor, b.part[j], -product));
        add(product);
      }
  }

  i32 sign() const {
    f64 largest = count ? part[count - 1] : 0;
    return i32(largest > 0) - i32(largest < 0);
  }
};

inline Expansion<2> differenceOf(f64 a, f64 b) {
  Expansion<2> result;
  result.add(a);
  result.add(-b);
  return result;
}

/// The minor u0 v1 - u1 v0.
inline Expansion<16> minorOf(const Expansion<2> &u0, const Expansion<2> &v1,
                             const Expansion<2> &u1, const Expansion<2> &v0) {
  Expansion<16> result;
  result.addProduct(u0, v1, 1);
  result.addProduct(u1, v0, -1);
  return result;
}

/// True if p, q, r turn left (1), right (-1) or lie on a line (0).
inline i32 orient2d(const f64 (&p)[2], const f64 (&q)[2], const f64 (&r)[2]) {
  return minorOf(differenceOf(q[0], p[0]), differenceOf(r[1], p[1]),
                 differenceOf(q[1], p[1]), differenceOf(r[0], p[0]))
      .sign();
}

/// The sign of det(a - d, b - d, c - d).
inline i32 orient3d(const f64 (&a)[3], const f64 (&b)[3], const f64 (&c)[3],
                    const f64 (&d)[3]) {
  Expansion<2> u[3], v[3];
  for (int i = 0; i < 3; ++i) {
    u[i] = differenceOf(a[i], d[i]);
    v[i] = differenceOf(b[i], d[i]);
  }
  Expansion<192> volume;
  for (int i = 0; i < 3; ++i) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    volume.addProduct(differenceOf(c[i], d[i]), minorOf(u[j], v[k], u[k], v[j]),
                      1);
  }
  return volume.sign();
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_PREDICATES_H
