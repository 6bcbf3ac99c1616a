"""Matrices, quaternions and transforms that C++ snippets of users find in namespace `wp`."""

MATRICES = """namespace wp {
template <unsigned R, unsigned C, typename T> struct mat_t {
  T data[R][C] = {};
  mat_t() = default;
  explicit mat_t(T all) {
    for (auto &row : data)
      for (T &one : row)
        one = all;
  }
  /// By rows.
  template <typename... N> mat_t(T x, T y, N... rest) {
    T all[] = {x, y, T(rest)...};
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] = all[i];
  }
  /// By columns.
  template <typename... N> mat_t(const vec_t<R, T> &x, const vec_t<R, T> &y, const N &...rest) {
    vec_t<R, T> all[] = {x, y, rest...};
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] = all[i % C].c[i / C];
  }
  T *operator[](int i) { return data[i]; }
  const T *operator[](int i) const { return data[i]; }
  T &operator()(int i, int j) { return data[i][j]; }
  const T &operator()(int i, int j) const { return data[i][j]; }
  vec_t<C, T> get_row(int i) const {
    vec_t<C, T> r;
    for (unsigned j = 0; j < C; ++j)
      r.c[j] = data[i][j];
    return r;
  }
  void set_row(int i, const vec_t<C, T> &v) {
    for (unsigned j = 0; j < C; ++j)
      data[i][j] = v.c[j];
  }
  vec_t<R, T> get_col(int j) const {
    vec_t<R, T> r;
    for (unsigned i = 0; i < R; ++i)
      r.c[i] = data[i][j];
    return r;
  }
  void set_col(int j, const vec_t<R, T> &v) {
    for (unsigned i = 0; i < R; ++i)
      data[i][j] = v.c[i];
  }
  mat_t &operator+=(const mat_t &o) {
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] += o.data[i / C][i % C];
    return *this;
  }
  mat_t &operator-=(const mat_t &o) {
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] -= o.data[i / C][i % C];
    return *this;
  }
  mat_t &operator*=(T s) {
    for (unsigned i = 0; i < R * C; ++i)
      data[i / C][i % C] *= s;
    return *this;
  }
  friend mat_t operator+(mat_t a, const mat_t &b) { return a += b; }
  friend mat_t operator-(mat_t a, const mat_t &b) { return a -= b; }
  friend mat_t operator*(mat_t a, T s) { return a *= s; }
  friend mat_t operator*(T s, mat_t a) { return a *= s; }
  friend mat_t operator/(mat_t a, T s) {
    for (unsigned i = 0; i < R * C; ++i)
      a.data[i / C][i % C] /= s;
    return a;
  }
};
#define WARP_MAT template <unsigned R, unsigned C, typename T>
WARP_MAT mat_t<R, C, T> add(const mat_t<R, C, T> &a, const mat_t<R, C, T> &b) { return a + b; }
WARP_MAT mat_t<R, C, T> sub(const mat_t<R, C, T> &a, const mat_t<R, C, T> &b) { return a - b; }
WARP_MAT mat_t<R, C, T> mul(const mat_t<R, C, T> &a, T s) { return a * s; }
WARP_MAT mat_t<R, C, T> mul(T s, const mat_t<R, C, T> &a) { return a * s; }
WARP_MAT mat_t<R, C, T> div(const mat_t<R, C, T> &a, T s) { return a / s; }
WARP_MAT mat_t<R, C, T> neg(const mat_t<R, C, T> &a) { return a * T(-1); }
WARP_MAT vec_t<R, T> mul(const mat_t<R, C, T> &a, const vec_t<C, T> &v) {
  vec_t<R, T> r;
  for (unsigned i = 0; i < R; ++i)
    for (unsigned j = 0; j < C; ++j)
      r.c[i] += a.data[i][j] * v.c[j];
  return r;
}
WARP_MAT vec_t<C, T> mul(const vec_t<R, T> &v, const mat_t<R, C, T> &a) {
  vec_t<C, T> r;
  for (unsigned i = 0; i < R; ++i)
    for (unsigned j = 0; j < C; ++j)
      r.c[j] += v.c[i] * a.data[i][j];
  return r;
}
template <unsigned R, unsigned K, unsigned C, typename T>
mat_t<R, C, T> mul(const mat_t<R, K, T> &a, const mat_t<K, C, T> &b) {
  mat_t<R, C, T> r;
  for (unsigned i = 0; i < R; ++i)
    for (unsigned k = 0; k < K; ++k)
      for (unsigned j = 0; j < C; ++j)
        r.data[i][j] += a.data[i][k] * b.data[k][j];
  return r;
}
WARP_MAT mat_t<R, C, T> cw_mul(mat_t<R, C, T> a, const mat_t<R, C, T> &b) {
  for (unsigned i = 0; i < R * C; ++i)
    a.data[i / C][i % C] *= b.data[i / C][i % C];
  return a;
}
WARP_MAT mat_t<C, R, T> transpose(const mat_t<R, C, T> &a) {
  mat_t<C, R, T> r;
  for (unsigned i = 0; i < R * C; ++i)
    r.data[i % C][i / C] = a.data[i / C][i % C];
  return r;
}
WARP_MAT T ddot(const mat_t<R, C, T> &a, const mat_t<R, C, T> &b) {
  T sum = 0;
  for (unsigned i = 0; i < R * C; ++i)
    sum += a.data[i / C][i % C] * b.data[i / C][i % C];
  return sum;
}
template <unsigned R, unsigned C, typename T>
mat_t<R, C, T> outer(const vec_t<R, T> &a, const vec_t<C, T> &b) {
  mat_t<R, C, T> r;
  for (unsigned i = 0; i < R * C; ++i)
    r.data[i / C][i % C] = a.c[i / C] * b.c[i % C];
  return r;
}
template <unsigned N, typename T> T trace(const mat_t<N, N, T> &a) {
  T sum = 0;
  for (unsigned i = 0; i < N; ++i)
    sum += a.data[i][i];
  return sum;
}
template <unsigned N, typename T> mat_t<N, N, T> diag(const vec_t<N, T> &v) {
  mat_t<N, N, T> r;
  for (unsigned i = 0; i < N; ++i)
    r.data[i][i] = v.c[i];
  return r;
}
template <unsigned N, typename T> vec_t<N, T> get_diag(const mat_t<N, N, T> &a) {
  vec_t<N, T> r;
  for (unsigned i = 0; i < N; ++i)
    r.c[i] = a.data[i][i];
  return r;
}
template <unsigned N, typename T> mat_t<N, N, T> identity() { return diag(vec_t<N, T>(T(1))); }
template <typename T> T determinant(const mat_t<2, 2, T> &a) {
  return a.data[0][0] * a.data[1][1] - a.data[0][1] * a.data[1][0];
}
template <typename T> T determinant(const mat_t<3, 3, T> &a) {
  return dot(a.get_row(0), cross(a.get_row(1), a.get_row(2)));
}
template <typename T> mat_t<2, 2, T> inverse(const mat_t<2, 2, T> &a) {
  T d = determinant(a);
  if (d == T(0))
    return {};
  return mat_t<2, 2, T>(a.data[1][1], -a.data[0][1], -a.data[1][0], a.data[0][0]) / d;
}
template <typename T> mat_t<3, 3, T> inverse(const mat_t<3, 3, T> &a) {
  vec_t<3, T> x = a.get_row(0), y = a.get_row(1), z = a.get_row(2);
  T d = dot(x, cross(y, z));
  if (d == T(0))
    return {};
  return mat_t<3, 3, T>(cross(y, z), cross(z, x), cross(x, y)) / d;
}
template <typename T> mat_t<3, 3, T> skew(const vec_t<3, T> &v) {
  return {T(0), -v.c[2], v.c[1], v.c[2], T(0), -v.c[0], -v.c[1], v.c[0], T(0)};
}
WARP_MAT T extract(const mat_t<R, C, T> &a, int i, int j) { return a.data[i][j]; }
WARP_MAT vec_t<C, T> extract(const mat_t<R, C, T> &a, int i) { return a.get_row(i); }
typedef mat_t<2, 2, float> mat22, mat22f;
typedef mat_t<3, 3, float> mat33, mat33f;
typedef mat_t<4, 4, float> mat44, mat44f;
typedef mat_t<2, 2, double> mat22d;
typedef mat_t<3, 3, double> mat33d;
typedef mat_t<4, 4, double> mat44d;
typedef mat_t<6, 6, float> spatial_matrix, spatial_matrixf;
typedef mat_t<6, 6, double> spatial_matrixd;
} // namespace wp
"""

ROTATIONS = """namespace wp {
template <typename T> struct quat_t {
  T x = 0, y = 0, z = 0, w = 0;
  quat_t() = default;
  quat_t(T x, T y, T z, T w) : x(x), y(y), z(z), w(w) {}
  quat_t(const vec_t<3, T> &v, T w) : x(v.c[0]), y(v.c[1]), z(v.c[2]), w(w) {}
  T &operator[](int i) { return (&x)[i]; }
  const T &operator[](int i) const { return (&x)[i]; }
  vec_t<3, T> imaginary() const { return {x, y, z}; }
  friend quat_t operator+(const quat_t &a, const quat_t &b) {
    return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w};
  }
  friend quat_t operator-(const quat_t &a, const quat_t &b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w};
  }
  friend quat_t operator*(const quat_t &a, T s) { return {a.x * s, a.y * s, a.z * s, a.w * s}; }
  friend quat_t operator*(T s, const quat_t &a) { return a * s; }
  friend quat_t operator/(const quat_t &a, T s) { return {a.x / s, a.y / s, a.z / s, a.w / s}; }
  friend quat_t operator*(const quat_t &a, const quat_t &b) {
    vec_t<3, T> u = a.imaginary(), v = b.imaginary();
    return {v * a.w + u * b.w + cross(u, v), a.w * b.w - dot(u, v)};
  }
  quat_t &operator+=(const quat_t &o) { return *this = *this + o; }
};
#define WARP_QUAT template <typename T>
WARP_QUAT quat_t<T> add(const quat_t<T> &a, const quat_t<T> &b) { return a + b; }
WARP_QUAT quat_t<T> sub(const quat_t<T> &a, const quat_t<T> &b) { return a - b; }
WARP_QUAT quat_t<T> mul(const quat_t<T> &a, const quat_t<T> &b) { return a * b; }
WARP_QUAT quat_t<T> mul(const quat_t<T> &a, T s) { return a * s; }
WARP_QUAT quat_t<T> mul(T s, const quat_t<T> &a) { return a * s; }
WARP_QUAT T dot(const quat_t<T> &a, const quat_t<T> &b) {
  return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w;
}
WARP_QUAT T length_sq(const quat_t<T> &q) { return dot(q, q); }
WARP_QUAT T length(const quat_t<T> &q) { return sqrt(dot(q, q)); }
WARP_QUAT quat_t<T> normalize(const quat_t<T> &q) {
  T l = length(q);
  return l > T(0) ? q / l : quat_t<T>(T(0), T(0), T(0), T(1));
}
template <typename T = float> quat_t<T> quat_identity() { return {T(0), T(0), T(0), T(1)}; }
WARP_QUAT quat_t<T> quat_inverse(const quat_t<T> &q) { return {-q.x, -q.y, -q.z, q.w}; }
WARP_QUAT quat_t<T> quat_from_axis_angle(const vec_t<3, T> &axis, T angle) {
  return {normalize(axis) * sin(angle / T(2)), cos(angle / T(2))};
}
WARP_QUAT vec_t<3, T> quat_rotate(const quat_t<T> &q, const vec_t<3, T> &v) {
  vec_t<3, T> u = q.imaginary();
  return v + cross(u, v) * (T(2) * q.w) + cross(u, cross(u, v)) * T(2);
}
WARP_QUAT vec_t<3, T> quat_rotate_inv(const quat_t<T> &q, const vec_t<3, T> &v) {
  return quat_rotate(quat_inverse(q), v);
}
WARP_QUAT mat_t<3, 3, T> quat_to_matrix(const quat_t<T> &q) {
  return {quat_rotate(q, vec_t<3, T>(T(1), T(0), T(0))),
          quat_rotate(q, vec_t<3, T>(T(0), T(1), T(0))),
          quat_rotate(q, vec_t<3, T>(T(0), T(0), T(1)))};
}
typedef quat_t<float> quat, quatf;
typedef quat_t<double> quatd;

template <typename T> struct transform_t {
  vec_t<3, T> p;
  quat_t<T> q;
  transform_t() = default;
  transform_t(const vec_t<3, T> &p, const quat_t<T> &q) : p(p), q(q) {}
  transform_t(T x, T y, T z, T a, T b, T c, T d) : p(x, y, z), q(a, b, c, d) {}
  T &operator[](int i) { return i < 3 ? p.c[i] : q[i - 3]; }
  const T &operator[](int i) const { return i < 3 ? p.c[i] : q[i - 3]; }
};
WARP_QUAT vec_t<3, T> transform_get_translation(const transform_t<T> &t) { return t.p; }
WARP_QUAT quat_t<T> transform_get_rotation(const transform_t<T> &t) { return t.q; }
WARP_QUAT void transform_set_translation(transform_t<T> &t, const vec_t<3, T> &p) { t.p = p; }
WARP_QUAT void transform_set_rotation(transform_t<T> &t, const quat_t<T> &q) { t.q = q; }
template <typename T = float> transform_t<T> transform_identity() {
  return {vec_t<3, T>(), quat_identity<T>()};
}
WARP_QUAT vec_t<3, T> transform_vector(const transform_t<T> &t, const vec_t<3, T> &v) {
  return quat_rotate(t.q, v);
}
WARP_QUAT vec_t<3, T> transform_point(const transform_t<T> &t, const vec_t<3, T> &x) {
  return t.p + quat_rotate(t.q, x);
}
WARP_QUAT transform_t<T> transform_multiply(const transform_t<T> &a, const transform_t<T> &b) {
  return {transform_point(a, b.p), a.q * b.q};
}
WARP_QUAT transform_t<T> mul(const transform_t<T> &a, const transform_t<T> &b) {
  return transform_multiply(a, b);
}
WARP_QUAT transform_t<T> transform_inverse(const transform_t<T> &t) {
  quat_t<T> q = quat_inverse(t.q);
  return {quat_rotate(q, t.p) * T(-1), q};
}
WARP_QUAT vec_t<3, T> transform_point(const mat_t<4, 4, T> &m, const vec_t<3, T> &x) {
  vec_t<4, T> r = mul(m, vec_t<4, T>(x.c[0], x.c[1], x.c[2], T(1)));
  return {r.c[0], r.c[1], r.c[2]};
}
typedef transform_t<float> transform, transformf;
typedef transform_t<double> transformd;

WARP_QUAT vec_t<3, T> spatial_top(const vec_t<6, T> &a) { return {a.c[0], a.c[1], a.c[2]}; }
WARP_QUAT vec_t<3, T> spatial_bottom(const vec_t<6, T> &a) { return {a.c[3], a.c[4], a.c[5]}; }
WARP_QUAT T spatial_dot(const vec_t<6, T> &a, const vec_t<6, T> &b) { return dot(a, b); }
} // namespace wp
"""
