//===- Vectors.h - 8-wide vectors and points in space -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Geometry is freestanding C++ for three readers: bitcode for the CPU, where
// eight floats are one register or two, bitcode for GPUs, where they are taken
// apart, and the runtime, which builds with the same formulas. Roundings are
// written down (`fma`, -ffp-contract=off), so all three have the same bits.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_GEOMETRY_VECTORS_H
#define WARP_DEVICELIB_GEOMETRY_VECTORS_H

namespace warp::geometry {

using f32 = float;
using f64 = double;
using i32 = int;
using u8 = unsigned char;
using u32 = unsigned int;
using i64 = long long;
using u64 = unsigned long long;

constexpr int width = 8;
using Floats = f32 __attribute__((ext_vector_type(width)));
using Ints = i32 __attribute__((ext_vector_type(width)));
using Doubles = f64 __attribute__((ext_vector_type(width)));

constexpr f32 infinity = __builtin_inff();
constexpr i32 largestInt = 0x7fffffff;

template <class V> inline V fma(V a, V b, V c) {
  return __builtin_elementwise_fma(a, b, c);
}

/// The second where a comparison with NaN fails.
inline f32 least(f32 a, f32 b) { return a < b ? a : b; }
inline f64 least(f64 a, f64 b) { return a < b ? a : b; }
inline Floats least(Floats a, Floats b) { return a < b ? a : b; }
inline f32 greatest(f32 a, f32 b) { return a > b ? a : b; }
inline f64 greatest(f64 a, f64 b) { return a > b ? a : b; }
inline Floats greatest(Floats a, Floats b) { return a > b ? a : b; }

/// a where a comparison holds.
inline f32 choose(bool where, f32 a, f32 b) { return where ? a : b; }
inline f64 choose(bool where, f64 a, f64 b) { return where ? a : b; }
inline Floats choose(Ints where, Floats a, Floats b) { return where ? a : b; }
inline Ints choose(Ints where, Ints a, Ints b) { return where ? a : b; }

/// Both; comparisons of numbers are `bool`.
inline bool both(bool a, bool b) { return a && b; }
inline Ints both(Ints a, Ints b) { return a & b; }

/// A bit per lane of a comparison.
inline u32 bitsOf(Ints where) {
#ifdef WARP_GPU
  u32 bits = 0;
#pragma unroll
  for (int lane = 0; lane < width; ++lane)
    bits |= u32(where[lane] & 1) << lane;
  return bits;
#else
  using Bits = bool __attribute__((ext_vector_type(width)));
  return __builtin_bit_cast(u8, __builtin_convertvector(where, Bits));
#endif
}

/// True if a comparison holds, of eight numbers anywhere.
inline bool isAny(bool where) { return where; }
inline bool isAny(Ints where) { return bitsOf(where) != 0; }

/// The lanes whose bit is set.
inline Ints lanesOf(u32 bits) {
  constexpr Ints weights{1, 2, 4, 8, 16, 32, 64, 128};
  return (Ints(i32(bits)) & weights) != 0;
}

inline int lowestBit(u32 bits) { return __builtin_ctz(bits); }
inline int countBits(u32 bits) { return __builtin_popcount(bits); }

inline f32 leastOf(Floats x) {
  using Half = f32 __attribute__((ext_vector_type(4)));
  Half half = x.lo < x.hi ? x.lo : x.hi;
  f32 even = least(half.x, half.z), odd = least(half.y, half.w);
  return least(even, odd);
}

inline i32 leastOf(Ints x) { return __builtin_reduce_min(x); }

/// a b - c d within 1.5 units in the last place, and zero only where it is
/// (Jeannerod, Louvet, Muller, "Further analysis of Kahan's algorithm", 2013).
template <class V> inline V differenceOfProducts(V a, V b, V c, V d) {
  V product = c * d;
  V error = fma(-c, d, product);
  return fma(a, b, -product) + error;
}

/// A point or direction; of one number each, or of eight.
template <class V> struct Point {
  V x, y, z;

  Point operator-(Point other) const {
    return {x - other.x, y - other.y, z - other.z};
  }
  /// Themselves, moved along a direction.
  Point along(V t, Point direction) const {
    return {fma(t, direction.x, x), fma(t, direction.y, y),
            fma(t, direction.z, z)};
  }
};

template <class V> inline V dot(Point<V> a, Point<V> b) {
  return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z));
}

template <class V> inline Point<V> cross(Point<V> a, Point<V> b) {
  return {differenceOfProducts(a.y, b.z, a.z, b.y),
          differenceOfProducts(a.z, b.x, a.x, b.z),
          differenceOfProducts(a.x, b.y, a.y, b.x)};
}

inline Point<Floats> spread(Point<f32> p) {
  return {Floats(p.x), Floats(p.y), Floats(p.z)};
}

} // namespace warp::geometry

#endif // WARP_DEVICELIB_GEOMETRY_VECTORS_H
