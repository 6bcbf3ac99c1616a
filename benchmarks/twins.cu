// The kernels of _spine_cases.py and _gpu_cases.py in CUDA C++, for the count
// of registers and instructions that nvcc needs; benchmarks/gpu.py compiles
// but does not run them. Names match, and arrays carry what their kernel uses
// of a descriptor: pointer, and extents where a thread looks at them.

struct vec3 {
  float x, y, z;
};
__device__ inline vec3 operator+(vec3 a, vec3 b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
__device__ inline vec3 operator-(vec3 a, vec3 b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
__device__ inline vec3 operator*(vec3 a, float s) {
  return {a.x * s, a.y * s, a.z * s};
}
__device__ inline float dot(vec3 a, vec3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
__device__ inline vec3 cross(vec3 a, vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

struct mat33 {
  vec3 rows[3];
};

#define THREAD(n)                                                              \
  int i = blockIdx.x * blockDim.x + threadIdx.x;                               \
  if (i >= (n))                                                                \
  return

extern "C" {

__global__ void saxpy(int n, float a, const float *x, float *y) {
  THREAD(n);
  y[i] = a * x[i] + y[i];
}

__global__ void integrate(int n, vec3 *x, vec3 *v, const vec3 *f,
                          const float *w, vec3 gravity, float dt) {
  THREAD(n);
  vec3 x0 = x[i], v0 = v[i];
  vec3 v1 = v0 + (f[i] * w[i] + gravity) * dt;
  x[i] = x0 + v1 * dt;
  v[i] = v1;
}

__global__ void sin_exp(int n, const float *x, float *y) {
  THREAD(n);
  float a = x[i];
  y[i] = sinf(a) * expf(-a * a) + sqrtf(fabsf(a)) + logf(1.0f + a * a);
}

__global__ void nbody(int threads, const vec3 *x, vec3 *a, int n, float eps) {
  THREAD(threads);
  vec3 xi = x[i], acc = {0, 0, 0};
  for (int j = 0; j < n; ++j) {
    vec3 r = x[j] - xi;
    float inv = 1.0f / sqrtf(dot(r, r) + eps);
    acc = acc + r * (inv * inv * inv);
  }
  a[i] = acc;
}

__global__ void springs(int n, const vec3 *x, const vec3 *v, const int *idx,
                        const float *rest, vec3 *f, float ke, float kd) {
  THREAD(n);
  int a = idx[i * 2], b = idx[i * 2 + 1];
  vec3 xij = x[a] - x[b], vij = v[a] - v[b];
  float length = sqrtf(dot(xij, xij));
  vec3 d = {xij.x / length, xij.y / length, xij.z / length};
  vec3 fs = d * (ke * (length - rest[i]) + kd * dot(d, vij));
  atomicAdd(&f[a].x, -fs.x);
  atomicAdd(&f[a].y, -fs.y);
  atomicAdd(&f[a].z, -fs.z);
  atomicAdd(&f[b].x, fs.x);
  atomicAdd(&f[b].y, fs.y);
  atomicAdd(&f[b].z, fs.z);
}

__global__ void mandelbrot(int rows, int columns, float *out, int w, int h,
                           int iters) {
  int j = blockIdx.x * blockDim.x + threadIdx.x;
  int i = blockIdx.y * blockDim.y + threadIdx.y;
  if (i >= rows || j >= columns)
    return;
  float cx = float(j) / float(w) * 3.0f - 2.0f;
  float cy = float(i) / float(h) * 2.0f - 1.0f;
  float zx = 0.0f, zy = 0.0f;
  int k = 0;
  while (k < iters && zx * zx + zy * zy < 4.0f) {
    float t = zx * zx - zy * zy + cx;
    zy = 2.0f * zx * zy + cy;
    zx = t;
    ++k;
  }
  out[i * columns + j] = float(k);
}

__global__ void mat33(int n, const struct mat33 *a, const vec3 *b, vec3 *y) {
  THREAD(n);
  struct mat33 m = a[i];
  vec3 p = m.rows[0], q = m.rows[1], r = m.rows[2], s = b[i];
  vec3 c0 = cross(q, r), c1 = cross(r, p), c2 = cross(p, q);
  float det = dot(p, c0), inv = det != 0.0f ? 1.0f / det : 0.0f;
  vec3 solved = (c0 * s.x + c1 * s.y + c2 * s.z) * inv;
  y[i] = solved + (p * s.x + q * s.y + r * s.z) * det;
}

__global__ void stencil(int n0, int n1, int n2, const float *u, float *out,
                        float c) {
  int k = blockIdx.x * blockDim.x + threadIdx.x;
  int j = blockIdx.y * blockDim.y + threadIdx.y;
  int i = blockIdx.z * blockDim.z + threadIdx.z;
  if (i <= 0 || j <= 0 || k <= 0 || i >= n0 - 1 || j >= n1 - 1 || k >= n2 - 1)
    return;
  int at = (i * n1 + j) * n2 + k;
  out[at] = u[at] + c * (u[at - n1 * n2] + u[at + n1 * n2] + u[at - n2] +
                         u[at + n2] + u[at - 1] + u[at + 1] - 6.0f * u[at]);
}

__global__ void scatter(int n, const float *x, float *y) {
  THREAD(n);
  atomicAdd(y + i, x[i]);
}

} // extern "C"
