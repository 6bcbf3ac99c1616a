"""What C++ snippets of users find declared: names of numbers, and of arrays and their elements.

The names and the order of arguments are those of NVIDIA Warp's headers, as far as snippets use
them; the text is our own.
"""

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
#else
#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <string.h>
#define WP_TILE_SYNC()
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
template <unsigned N, typename T> struct vec_t {
  T c[N] = {};
  vec_t() = default;
  explicit vec_t(T all) {
    for (T &one : c)
      one = all;
  }
  template <typename... R> vec_t(T x, T y, R... rest) : c{x, y, T(rest)...} {}
  T &operator[](int i) { return c[i]; }
  const T &operator[](int i) const { return c[i]; }
  T &operator()(int i) { return c[i]; }
  vec_t &operator+=(const vec_t &o) {
    for (unsigned i = 0; i < N; ++i)
      c[i] += o.c[i];
    return *this;
  }
  vec_t &operator-=(const vec_t &o) {
    for (unsigned i = 0; i < N; ++i)
      c[i] -= o.c[i];
    return *this;
  }
  vec_t &operator*=(T s) {
    for (T &one : c)
      one *= s;
    return *this;
  }
  friend vec_t operator+(vec_t a, const vec_t &b) { return a += b; }
  friend vec_t operator-(vec_t a, const vec_t &b) { return a -= b; }
  friend vec_t operator*(vec_t a, T s) { return a *= s; }
  friend vec_t operator*(T s, vec_t a) { return a *= s; }
};
template <unsigned N, typename T> T dot(const vec_t<N, T> &a, const vec_t<N, T> &b) {
  T sum = 0;
  for (unsigned i = 0; i < N; ++i)
    sum += a.c[i] * b.c[i];
  return sum;
}
template <unsigned R, unsigned C, typename T> struct mat_t {
  T data[R][C] = {};
  mat_t() = default;
  template <typename... N> mat_t(T x, T y, N... rest) {
    T all[] = {x, y, T(rest)...};
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] = all[i];
  }
  T *operator[](int i) { return data[i]; }
  const T *operator[](int i) const { return data[i]; }
};
template <typename T> using quat_t = vec_t<4, T>;
template <typename T> using transform_t = vec_t<7, T>;
typedef vec_t<2, float> vec2, vec2f;
typedef vec_t<3, float> vec3, vec3f;
typedef vec_t<4, float> vec4, vec4f;
typedef vec_t<2, double> vec2d;
typedef vec_t<3, double> vec3d;
typedef vec_t<4, double> vec4d;
typedef vec_t<2, int> vec2i;
typedef vec_t<3, int> vec3i;
typedef vec_t<4, int> vec4i;
typedef mat_t<2, 2, float> mat22, mat22f;
typedef mat_t<3, 3, float> mat33, mat33f;
typedef mat_t<4, 4, float> mat44, mat44f;
typedef mat_t<2, 2, double> mat22d;
typedef mat_t<3, 3, double> mat33d;
typedef mat_t<4, 4, double> mat44d;
typedef quat_t<float> quat, quatf;
typedef quat_t<double> quatd;

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
template <typename T> T array_load(const array_t<T> &a, int i) { return index(a, i); }
template <typename T> void array_store(const array_t<T> &a, int i, T v) { index(a, i) = v; }
template <typename T> void array_store(const array_t<T> &a, int i, int j, T v) {
  index(a, i, j) = v;
}
template <typename T> void array_store(const array_t<T> &a, int i, int j, int k, T v) {
  index(a, i, j, k) = v;
}
#ifdef __CUDACC_RTC__
template <typename T> T atomic_add(T *p, T value) { return ::atomicAdd(p, value); }
#else
template <typename T> T atomic_add(T *p, T value) {
  T old, next;
  __atomic_load(p, &old, __ATOMIC_RELAXED);
  do
    next = old + value;
  while (!__atomic_compare_exchange(p, &old, &next, false, __ATOMIC_RELAXED, __ATOMIC_RELAXED));
  return old;
}
#endif
template <typename T> T atomic_add(const array_t<T> &a, int i, T v) {
  return atomic_add(address(a, i), v);
}
template <typename T> T atomic_add(const array_t<T> &a, int i, int j, T v) {
  return atomic_add(address(a, i, j), v);
}
} // namespace wp

#ifndef __CUDACC_RTC__
template <typename T> T atomicAdd(T *p, T value) { return wp::atomic_add(p, value); }
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
