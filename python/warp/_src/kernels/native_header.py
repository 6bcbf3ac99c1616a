"""Declarations for C++ snippets of users: numbers, arrays, and their operations.

The names and the order of arguments are those of NVIDIA Warp's headers, as far as snippets use
them; the text is our own.
"""

import re

from warp._src.kernels.native_geometry import MESHES, RAYS
from warp._src.kernels.native_math import NUMBER_FUNCTIONS, VECTORS
from warp._src.kernels.native_matrices import MATRICES, ROTATIONS

# Words of code that uses more than numbers of C.
_MORE = re.compile(r"\bwp\s*::|\b(vec|mat|quat|transform|spatial)\w*|\barray_t\b")
_MESHES = re.compile(r"\b(mesh|bvh)_\w+|\bMesh\b")


def header(body: str, arrays: bool = False) -> str:
    """The text before a function of the user.

    Args:
        body: the user's text.
        arrays: the function has more than numbers among its parameters.
    """
    if not arrays and not _MORE.search(body):
        return NUMBERS
    parts = [NUMBERS, NUMBER_FUNCTIONS, VECTORS, MATRICES, ROTATIONS, ARRAYS, RAYS]
    if _MESHES.search(body):
        parts.append(MESHES)
    return "".join(parts)


NUMBERS = """#ifdef __CUDACC_RTC__
typedef signed char int8_t;
typedef unsigned char uint8_t;
typedef short int16_t;
typedef unsigned short uint16_t;
typedef int int32_t;
typedef unsigned int uint32_t;
typedef long long int64_t;
typedef unsigned long long uint64_t;
#define INFINITY __int_as_float(0x7f800000)
#define NAN __int_as_float(0x7fffffff)
#define HUGE_VALF INFINITY
#define HUGE_VAL __longlong_as_double(0x7ff0000000000000ULL)
#define FLT_MAX 3.402823466e38f
#define FLT_MIN 1.175494351e-38f
#define FLT_EPSILON 1.192092896e-7f
#define DBL_MAX 1.7976931348623158e308
#define DBL_MIN 2.2250738585072014e-308
#define DBL_EPSILON 2.2204460492503131e-16
#define INT_MAX 2147483647
#define INT_MIN (-INT_MAX - 1)
#define UINT_MAX 4294967295u
#define LLONG_MAX 9223372036854775807ll
#define LLONG_MIN (-LLONG_MAX - 1ll)
#define ULLONG_MAX 18446744073709551615ull
#define WP_TILE_SYNC() __syncthreads()
#define CUDA_CALLABLE __device__
#else
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#define WP_TILE_SYNC()
#define CUDA_CALLABLE
#endif
namespace wp {
typedef int8_t int8;
typedef uint8_t uint8;
typedef int16_t int16;
typedef uint16_t uint16;
typedef int32_t int32;
typedef uint32_t uint32;
typedef int64_t int64;
typedef uint64_t uint64;
typedef float float32;
typedef double float64;
} // namespace wp
using namespace wp;
"""

ARRAYS = """#ifdef __CUDACC_RTC__
inline void *calloc(size_t count, size_t size) {
  void *made = malloc(count * size);
  if (!made)
    __trap();
  return memset(made, 0, count * size);
}
#else
#include <stdlib.h>
#endif
namespace wp {
struct shape_t {
  int dims[4] = {1, 1, 1, 1};
  int operator[](int i) const { return dims[i]; }
  int size() const { return dims[0] * dims[1] * dims[2] * dims[3]; }
  operator const int *() const { return dims; }
};
template <typename T> struct array_t {
  T *data = nullptr;
  T *grad = nullptr;
  shape_t shape;
  int strides[4] = {};
  int ndim = 0;
  int flags = 0;
  bool empty() const { return !data; }
  operator T *() const { return data; }
};
template <typename T> size_t byte_offset(const array_t<T> &a, int i) {
  return int64_t(i) * a.strides[0];
}
template <typename T> size_t byte_offset(const array_t<T> &a, int i, int j) {
  return byte_offset(a, i) + int64_t(j) * a.strides[1];
}
template <typename T> size_t byte_offset(const array_t<T> &a, int i, int j, int k) {
  return byte_offset(a, i, j) + int64_t(k) * a.strides[2];
}
template <typename T> size_t byte_offset(const array_t<T> &a, int i, int j, int k, int l) {
  return byte_offset(a, i, j, k) + int64_t(l) * a.strides[3];
}
template <typename T, typename... I> T *address(const array_t<T> &a, I... i) {
  return (T *)((char *)a.data + byte_offset(a, i...));
}
template <typename T, typename... I> T &index(const array_t<T> &a, I... i) {
  return *address(a, i...);
}
template <typename T> T *data(const array_t<T> &a) { return a.data; }
template <typename T> T load(const T *p) { return *p; }
template <typename T> void store(T *p, T value) { *p = value; }
template <typename T> array_t<T> view(const array_t<T> &a, int i) {
  array_t<T> row = a;
  row.data = address(a, i);
  for (int d = 0; d < 3; ++d) {
    row.shape.dims[d] = a.shape.dims[d + 1];
    row.strides[d] = a.strides[d + 1];
  }
  row.shape.dims[3] = 1;
  row.strides[3] = 0;
  row.ndim = a.ndim - 1;
  return row;
}
template <typename T, typename... I> T array_load(const array_t<T> &a, I... i) {
  return index(a, i...);
}
template <typename T> void array_store(const array_t<T> &a, int i, T v) { index(a, i) = v; }
template <typename T> void array_store(const array_t<T> &a, int i, int j, T v) {
  index(a, i, j) = v;
}
template <typename T> void array_store(const array_t<T> &a, int i, int j, int k, T v) {
  index(a, i, j, k) = v;
}
template <typename T> T atomic_cas(T *p, T expected, T value) {
#ifdef __CUDACC_RTC__
  return ::atomicCAS(p, expected, value);
#else
  __atomic_compare_exchange(p, &expected, &value, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED);
  return expected;
#endif
}
#ifdef __CUDACC_RTC__
template <unsigned S> struct word_of { typedef unsigned type; };
template <> struct word_of<8> { typedef unsigned long long type; };
/// The old value of a number of 4 or 8 bytes that `next` has changed.
template <typename T, typename F> T update(T *p, F next) {
  typedef typename word_of<sizeof(T)>::type word;
  word old = *(volatile word *)p, seen;
  T value;
  do {
    seen = old;
    memcpy(&value, &seen, sizeof(T));
    T made = next(value);
    word changed;
    memcpy(&changed, &made, sizeof(T));
    old = ::atomicCAS((word *)p, seen, changed);
  } while (old != seen);
  return value;
}
inline float atomic_add(float *p, float value) { return ::atomicAdd(p, value); }
inline double atomic_add(double *p, double value) { return ::atomicAdd(p, value); }
inline int atomic_add(int *p, int value) { return ::atomicAdd(p, value); }
inline unsigned atomic_add(unsigned *p, unsigned value) { return ::atomicAdd(p, value); }
#else
/// The old value of a number that `next` has changed.
template <typename T, typename F> T update(T *p, F next) {
  T old, made;
  __atomic_load(p, &old, __ATOMIC_RELAXED);
  do
    made = next(old);
  while (!__atomic_compare_exchange(p, &old, &made, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED));
  return old;
}
#endif
#define WARP_UPDATE(name, text) \\
  template <typename T> warp_native::number_t<T> name(T *p, T value) { \\
    return update(p, [=](T old) { return T(text); }); \\
  }
WARP_UPDATE(atomic_add, old + value)
WARP_UPDATE(atomic_sub, old - value)
WARP_UPDATE(atomic_min, value < old ? value : old)
WARP_UPDATE(atomic_max, old < value ? value : old)
WARP_UPDATE(atomic_and, old & value)
WARP_UPDATE(atomic_or, old | value)
WARP_UPDATE(atomic_xor, old ^ value)
WARP_UPDATE(atomic_exch, value)
#undef WARP_UPDATE
/// Number by number.
#define WARP_UPDATE(name) \\
  WARP_VEC vec_t<N, T> name(vec_t<N, T> *p, const vec_t<N, T> &value) { \\
    vec_t<N, T> old; \\
    for (unsigned i = 0; i < N; ++i) \\
      old.c[i] = name(&p->c[i], value.c[i]); \\
    return old; \\
  } \\
  WARP_MAT mat_t<R, C, T> name(mat_t<R, C, T> *p, const mat_t<R, C, T> &value) { \\
    mat_t<R, C, T> old; \\
    for (unsigned i = 0; i < R * C; ++i) \\
      old.data[i / C][i % C] = name(&p->data[i / C][i % C], value.data[i / C][i % C]); \\
    return old; \\
  }
WARP_UPDATE(atomic_add) WARP_UPDATE(atomic_sub) WARP_UPDATE(atomic_min) WARP_UPDATE(atomic_max)
#undef WARP_UPDATE
#define WARP_UPDATE(name) \\
  template <typename T> T name(const array_t<T> &a, int i, T v) { \\
    return name(address(a, i), v); \\
  } \\
  template <typename T> T name(const array_t<T> &a, int i, int j, T v) { \\
    return name(address(a, i, j), v); \\
  } \\
  template <typename T> T name(const array_t<T> &a, int i, int j, int k, T v) { \\
    return name(address(a, i, j, k), v); \\
  } \\
  template <typename T> T name(const array_t<T> &a, int i, int j, int k, int l, T v) { \\
    return name(address(a, i, j, k, l), v); \\
  }
WARP_UPDATE(atomic_add) WARP_UPDATE(atomic_sub) WARP_UPDATE(atomic_min) WARP_UPDATE(atomic_max)
WARP_UPDATE(atomic_and) WARP_UPDATE(atomic_or) WARP_UPDATE(atomic_xor) WARP_UPDATE(atomic_exch)
#undef WARP_UPDATE
template <typename T> T atomic_cas(const array_t<T> &a, int i, T expected, T value) {
  return atomic_cas(address(a, i), expected, value);
}
template <unsigned N, typename T> using fixedarray_t = vec_t<N, T>;
} // namespace wp

#ifndef __CUDACC_RTC__
template <typename T> T atomicAdd(T *p, T value) { return wp::atomic_add(p, value); }
template <typename T> T atomicSub(T *p, T value) { return wp::atomic_sub(p, value); }
template <typename T> T atomicMin(T *p, T value) { return wp::atomic_min(p, value); }
template <typename T> T atomicMax(T *p, T value) { return wp::atomic_max(p, value); }
template <typename T> T atomicAnd(T *p, T value) { return wp::atomic_and(p, value); }
template <typename T> T atomicOr(T *p, T value) { return wp::atomic_or(p, value); }
template <typename T> T atomicXor(T *p, T value) { return wp::atomic_xor(p, value); }
template <typename T> T atomicExch(T *p, T value) { return wp::atomic_exch(p, value); }
template <typename T> T atomicCAS(T *p, T expected, T value) {
  return wp::atomic_cas(p, expected, value);
}
#endif

namespace warp_native {
/// A vector, matrix or quaternion of these numbers.
template <typename T, typename S, typename... R> T made_of(R... numbers) {
  T made;
  S all[] = {S(numbers)...};
  memcpy(&made, all, sizeof(made));
  return made;
}
/// What an adjoint finds where there are no gradients: zeros, which nobody reads afterwards.
template <typename T> struct Gradients {
  wp::array_t<T> array;
  void *made = nullptr;
  Gradients(wp::array_t<T> given, const wp::array_t<T> &like) : array(given) {
    if (given.data || !like.data)
      return;
    array = like;
    int64_t step = sizeof(T);
    for (int d = like.ndim - 1; d >= 0; --d) {
      array.strides[d] = int(step);
      step *= like.shape[d];
    }
    made = calloc(1, size_t(step));
    array.data = (T *)made;
  }
  ~Gradients() { free(made); }
};
} // namespace warp_native
"""
