"""Functions of numbers and vectors that C++ snippets of users find declared in namespace `wp`.

All are templates, so that names without `wp::` mean C's functions where there are such.
"""

NUMBER_FUNCTIONS = """namespace warp_native {
template <typename T> struct number {};
template <typename T> struct real {};
#define WARP_IS(kind, T) \\
  template <> struct kind<T> { typedef T type; };
WARP_IS(number, bool) WARP_IS(number, char) WARP_IS(number, signed char)
WARP_IS(number, unsigned char) WARP_IS(number, short) WARP_IS(number, unsigned short)
WARP_IS(number, int) WARP_IS(number, unsigned) WARP_IS(number, long)
WARP_IS(number, unsigned long) WARP_IS(number, long long) WARP_IS(number, unsigned long long)
WARP_IS(number, float) WARP_IS(number, double) WARP_IS(real, float) WARP_IS(real, double)
#undef WARP_IS
template <typename T> using number_t = typename number<T>::type;
template <typename T> using real_t = typename real<T>::type;
#define WARP_UNARY(name) \\
  inline float c_##name(float x) { return ::name##f(x); } \\
  inline double c_##name(double x) { return ::name(x); }
#define WARP_BINARY(name) \\
  inline float c_##name(float x, float y) { return ::name##f(x, y); } \\
  inline double c_##name(double x, double y) { return ::name(x, y); }
#define WARP_ALL_UNARY(_) _(sqrt) _(cbrt) _(exp) _(exp2) _(expm1) _(log) _(log2) _(log10) \\
  _(log1p) _(sin) _(cos) _(tan) _(asin) _(acos) _(atan) _(sinh) _(cosh) \\
  _(tanh) _(asinh) _(acosh) _(atanh) _(floor) _(ceil) _(round) _(rint) _(trunc) _(erf) _(erfc)
#define WARP_ALL_BINARY(_) _(pow) _(atan2) _(fmod) _(copysign) _(hypot)
WARP_ALL_UNARY(WARP_UNARY)
WARP_ALL_BINARY(WARP_BINARY)
inline bool is_finite(float x) { return ::fabsf(x) <= 3.402823466e38f; }
inline bool is_finite(double x) { return ::fabs(x) <= 1.7976931348623158e308; }
template <typename T> bool is_finite(T) { return true; }
inline float c_fabs(float x) { return ::fabsf(x); }
inline double c_fabs(double x) { return ::fabs(x); }
} // namespace warp_native
namespace wp {
#undef WARP_UNARY
#undef WARP_BINARY
#define WARP_UNARY(name) \\
  template <typename T> warp_native::real_t<T> name(T x) { return warp_native::c_##name(x); }
#define WARP_BINARY(name) \\
  template <typename T> warp_native::real_t<T> name(T x, T y) { \\
    return warp_native::c_##name(x, y); \\
  }
WARP_ALL_UNARY(WARP_UNARY)
WARP_ALL_BINARY(WARP_BINARY)
#undef WARP_UNARY
#undef WARP_BINARY
#undef WARP_ALL_UNARY
#undef WARP_ALL_BINARY
template <typename T> warp_native::number_t<T> min(T a, T b) { return b < a ? b : a; }
template <typename T> warp_native::number_t<T> max(T a, T b) { return a < b ? b : a; }
template <typename T> warp_native::number_t<T> clamp(T x, T low, T high) {
  return min(max(low, x), high);
}
template <typename T> warp_native::number_t<T> abs(T x) { return x < T(0) ? T(-x) : x; }
template <> inline float abs(float x) { return warp_native::c_fabs(x); }
template <> inline double abs(double x) { return warp_native::c_fabs(x); }
template <typename T> warp_native::number_t<T> sign(T x) { return x < T(0) ? T(-1) : T(1); }
template <typename T> warp_native::number_t<T> step(T x) { return x < T(0) ? T(1) : T(0); }
template <typename T> warp_native::number_t<T> nonzero(T x) { return x == T(0) ? T(0) : T(1); }
template <typename T> warp_native::number_t<T> add(T a, T b) { return T(a + b); }
template <typename T> warp_native::number_t<T> sub(T a, T b) { return T(a - b); }
template <typename T> warp_native::number_t<T> mul(T a, T b) { return T(a * b); }
template <typename T> warp_native::number_t<T> neg(T a) { return T(-a); }
template <typename T> warp_native::number_t<T> pos(T a) { return a; }
template <typename T> warp_native::number_t<T> div(T a, T b) { return a / b; }
template <typename T> warp_native::real_t<T> mod(T a, T b) { return fmod(a, b); }
template <typename T> warp_native::real_t<T> floordiv(T a, T b) { return floor(a / b); }
template <typename T> warp_native::real_t<T> frac(T x) { return x - trunc(x); }
template <typename T> warp_native::real_t<T> degrees(T x) { return x * T(57.295779513082320877); }
template <typename T> warp_native::real_t<T> radians(T x) { return x * T(0.017453292519943295769); }
template <typename T> warp_native::real_t<T> lerp(T a, T b, T t) { return a * (T(1) - t) + b * t; }
template <typename T> warp_native::real_t<T> smoothstep(T low, T high, T x) {
  x = clamp((x - low) / (high - low), T(0), T(1));
  return x * x * (T(3) - T(2) * x);
}
template <typename T> bool isfinite(T x, warp_native::number_t<T> = 0) {
  return warp_native::is_finite(x);
}
template <typename T> bool isnan(T x, warp_native::number_t<T> = 0) {
  return !warp_native::is_finite(x) && !(x == x);
}
template <typename T> bool isinf(T x, warp_native::number_t<T> = 0) {
  return !warp_native::is_finite(x) && x == x;
}
template <typename T> T select(bool c, const T &if_false, const T &if_true) {
  return c ? if_true : if_false;
}
template <typename T> T where(bool c, const T &if_true, const T &if_false) {
  return c ? if_true : if_false;
}
} // namespace wp
"""

VECTORS = """namespace wp {
template <unsigned N, typename T> struct vec_t {
  T c[N] = {};
  vec_t() = default;
  explicit vec_t(T all) {
    for (T &one : c)
      one = all;
  }
  template <typename U> explicit vec_t(const vec_t<N, U> &o) {
    for (unsigned i = 0; i < N; ++i)
      c[i] = T(o.c[i]);
  }
  template <typename... R> vec_t(T x, T y, R... rest) : c{x, y, T(rest)...} {}
  T &operator[](int i) { return c[i < 0 ? i + int(N) : i]; }
  const T &operator[](int i) const { return c[i < 0 ? i + int(N) : i]; }
  T &operator()(int i) { return c[i]; }
  const T &operator()(int i) const { return c[i]; }
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
  vec_t &operator/=(T s) {
    for (T &one : c)
      one /= s;
    return *this;
  }
  vec_t operator-() const {
    vec_t r;
    for (unsigned i = 0; i < N; ++i)
      r.c[i] = -c[i];
    return r;
  }
  friend vec_t operator+(vec_t a, const vec_t &b) { return a += b; }
  friend vec_t operator-(vec_t a, const vec_t &b) { return a -= b; }
  friend vec_t operator*(vec_t a, T s) { return a *= s; }
  friend vec_t operator*(T s, vec_t a) { return a *= s; }
  friend vec_t operator/(vec_t a, T s) { return a /= s; }
  friend bool operator==(const vec_t &a, const vec_t &b) {
    for (unsigned i = 0; i < N; ++i)
      if (!(a.c[i] == b.c[i]))
        return false;
    return true;
  }
  friend bool operator!=(const vec_t &a, const vec_t &b) { return !(a == b); }
};
#define WARP_VEC template <unsigned N, typename T>
WARP_VEC vec_t<N, T> add(const vec_t<N, T> &a, const vec_t<N, T> &b) { return a + b; }
WARP_VEC vec_t<N, T> sub(const vec_t<N, T> &a, const vec_t<N, T> &b) { return a - b; }
WARP_VEC vec_t<N, T> mul(const vec_t<N, T> &a, T s) { return a * s; }
WARP_VEC vec_t<N, T> mul(T s, const vec_t<N, T> &a) { return a * s; }
WARP_VEC vec_t<N, T> div(const vec_t<N, T> &a, T s) { return a / s; }
WARP_VEC vec_t<N, T> neg(const vec_t<N, T> &a) { return -a; }
WARP_VEC vec_t<N, T> pos(const vec_t<N, T> &a) { return a; }
WARP_VEC T dot(const vec_t<N, T> &a, const vec_t<N, T> &b) {
  T sum = 0;
  for (unsigned i = 0; i < N; ++i)
    sum += a.c[i] * b.c[i];
  return sum;
}
WARP_VEC T tensordot(const vec_t<N, T> &a, const vec_t<N, T> &b) { return dot(a, b); }
WARP_VEC T length_sq(const vec_t<N, T> &a) { return dot(a, a); }
WARP_VEC T length(const vec_t<N, T> &a) { return sqrt(dot(a, a)); }
WARP_VEC vec_t<N, T> normalize(const vec_t<N, T> &a) {
  T l = length(a);
  return l > T(0) ? a / l : vec_t<N, T>();
}
template <typename T> vec_t<3, T> cross(const vec_t<3, T> &a, const vec_t<3, T> &b) {
  return {a.c[1] * b.c[2] - a.c[2] * b.c[1], a.c[2] * b.c[0] - a.c[0] * b.c[2],
          a.c[0] * b.c[1] - a.c[1] * b.c[0]};
}
#define WARP_EACH(name, text) \\
  WARP_VEC vec_t<N, T> name(const vec_t<N, T> &a, const vec_t<N, T> &b) { \\
    vec_t<N, T> r; \\
    for (unsigned i = 0; i < N; ++i) \\
      r.c[i] = text; \\
    return r; \\
  }
WARP_EACH(cw_mul, a.c[i] * b.c[i])
WARP_EACH(cw_div, a.c[i] / b.c[i])
WARP_EACH(min, min(a.c[i], b.c[i]))
WARP_EACH(max, max(a.c[i], b.c[i]))
WARP_EACH(mod, mod(a.c[i], b.c[i]))
#undef WARP_EACH
#define WARP_EACH(name) \\
  WARP_VEC vec_t<N, T> name(const vec_t<N, T> &a) { \\
    vec_t<N, T> r; \\
    for (unsigned i = 0; i < N; ++i) \\
      r.c[i] = name(a.c[i]); \\
    return r; \\
  }
WARP_EACH(abs) WARP_EACH(sign) WARP_EACH(floor) WARP_EACH(ceil) WARP_EACH(round) WARP_EACH(trunc)
#undef WARP_EACH
WARP_VEC unsigned argmin(const vec_t<N, T> &a) {
  unsigned at = 0;
  for (unsigned i = 1; i < N; ++i)
    at = a.c[i] < a.c[at] ? i : at;
  return at;
}
WARP_VEC unsigned argmax(const vec_t<N, T> &a) {
  unsigned at = 0;
  for (unsigned i = 1; i < N; ++i)
    at = a.c[at] < a.c[i] ? i : at;
  return at;
}
WARP_VEC T min(const vec_t<N, T> &a) { return a.c[argmin(a)]; }
WARP_VEC T max(const vec_t<N, T> &a) { return a.c[argmax(a)]; }
WARP_VEC vec_t<N, T> lerp(const vec_t<N, T> &a, const vec_t<N, T> &b, T t) {
  return a * (T(1) - t) + b * t;
}
WARP_VEC bool isfinite(const vec_t<N, T> &a) {
  for (T one : a.c)
    if (!isfinite(one))
      return false;
  return true;
}
WARP_VEC bool isnan(const vec_t<N, T> &a) { return !(a == a); }
WARP_VEC T extract(const vec_t<N, T> &a, int i) { return a[i]; }
WARP_VEC T *index(vec_t<N, T> &a, int i) { return &a[i]; }
#define WARP_NAMED(N) \\
  typedef vec_t<N, float> vec##N, vec##N##f; \\
  typedef vec_t<N, double> vec##N##d; \\
  typedef vec_t<N, int8_t> vec##N##b; \\
  typedef vec_t<N, uint8_t> vec##N##ub; \\
  typedef vec_t<N, int16_t> vec##N##s; \\
  typedef vec_t<N, uint16_t> vec##N##us; \\
  typedef vec_t<N, int32_t> vec##N##i; \\
  typedef vec_t<N, uint32_t> vec##N##ui; \\
  typedef vec_t<N, int64_t> vec##N##l; \\
  typedef vec_t<N, uint64_t> vec##N##ul;
WARP_NAMED(2) WARP_NAMED(3) WARP_NAMED(4)
#undef WARP_NAMED
typedef vec_t<6, float> spatial_vector, spatial_vectorf;
typedef vec_t<6, double> spatial_vectord;
} // namespace wp
"""
