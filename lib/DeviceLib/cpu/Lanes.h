//===- Lanes.h - SIMD vectors of lane values --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elementary functions are templates over the number of lanes. One lane is
// a plain number, more are a vector of clang's; arithmetic, comparisons, `&`,
// `|` and `?:` read the same for both, and what does not is here. A function
// does the same operations in the same order whatever the number of lanes, so
// its result has the same bits; -ffp-contract=off and explicit fma keep it so.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_CPU_LANES_H
#define WARP_DEVICELIB_CPU_LANES_H

namespace {

using f32 = float;
using f64 = double;
using i32 = int;
using i64 = long long;
using u32 = unsigned int;
using u64 = unsigned long long;

template <class T, int n> struct LanesOf {
  using type = T __attribute__((ext_vector_type(n)));
};
template <class T> struct LanesOf<T, 1> {
  using type = T;
};
template <class T, int n> using Lanes = typename LanesOf<T, n>::type;

// Functions are inlined whatever their size.
#pragma clang attribute push(__attribute__((always_inline)),                  \
                             apply_to = function)

template <class V> inline V fma(V a, V b, V c) {
  return __builtin_elementwise_fma(a, b, c);
}
template <class V> inline V abs(V x) { return __builtin_elementwise_abs(x); }
template <class V> inline V sqrt(V x) { return __builtin_elementwise_sqrt(x); }
template <class V> inline V trunc(V x) {
  return __builtin_elementwise_trunc(x);
}
template <class V> inline V copysign(V x, V sign) {
  return __builtin_elementwise_copysign(x, sign);
}

/// The same bits as another type of the same width.
template <class To, class V> inline To cast(V x) {
  return __builtin_bit_cast(To, x);
}

/// The same numbers in another type.
template <class To, class V> inline To convert(V x) {
  if constexpr (requires { x[0]; })
    return __builtin_convertvector(x, To);
  else
    return To(x);
}

/// True if a comparison holds in some lane.
template <class Mask> inline bool any(Mask mask) {
  if constexpr (requires { mask[0]; })
    return __builtin_reduce_or(mask) != 0;
  else
    return mask;
}

template <class V> inline auto laneOf(V x, int lane) {
  if constexpr (requires { x[0]; })
    return x[lane];
  else
    return x;
}

template <class V, class T> inline void setLane(V &x, int lane, T value) {
  if constexpr (requires { x[0]; })
    x[lane] = value;
  else
    x = value;
}

/// Horner's rule, from the constant term.
template <class V, class T, int n>
inline V polynomial(V x, const T (&c)[n]) {
  V sum = V(c[n - 1]);
#pragma clang loop unroll(full)
  for (int i = n - 2; i >= 0; --i)
    sum = fma(sum, x, V(c[i]));
  return sum;
}

/// The same as a sum of pairs, of pairs of pairs and so on (Estrin's scheme).
/// Polynomials of doubles are long: one term after the other would take most of
/// the time of a function.
template <class V, class T, int n>
inline V polynomialOfPairs(V x, const T (&c)[n]) {
  V terms[n];
#pragma clang loop unroll(full)
  for (int i = 0; i < n; ++i)
    terms[i] = V(c[i]);
#pragma clang loop unroll(full)
  for (int count = n; count > 1; count = (count + 1) / 2) {
#pragma clang loop unroll(full)
    for (int i = 0; i < count / 2; ++i)
      terms[i] = fma(x, terms[2 * i + 1], terms[2 * i]);
    if (count % 2)
      terms[count / 2] = terms[count - 1];
    x = x * x;
  }
  return terms[0];
}

/// Keeps NaN.
template <class V, class T> inline V limit(V x, T low, T high) {
  x = x < low ? V(low) : x;
  return x > high ? V(high) : x;
}

#pragma clang attribute pop

} // namespace

#endif // WARP_DEVICELIB_CPU_LANES_H
