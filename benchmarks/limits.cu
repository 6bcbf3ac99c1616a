// What the card can do: hand-written kernels and copies, for benchmarks/gpu.py.
//
// Every rate is that of the fastest of several passes, timed by events, as are
// those of the kernels they are compared with. The output is one line of JSON;
// bytes count each array element once per read and once per write.
//
//   nvcc -O3 -arch=native limits.cu -o limits && ./limits

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cuda_runtime.h>

static void check(cudaError_t result, const char *what) {
  if (result == cudaSuccess)
    return;
  std::fprintf(stderr, "%s: %s\n", what, cudaGetErrorString(result));
  std::exit(1);
}
#define CHECK(call) check(call, #call)

/// Seconds of the fastest pass.
template <typename F> static double fastest(F function, int passes = 15) {
  cudaEvent_t begin, end;
  CHECK(cudaEventCreate(&begin));
  CHECK(cudaEventCreate(&end));
  float best = 1e9f;
  for (int i = 0; i < passes; ++i) {
    CHECK(cudaEventRecord(begin));
    function();
    CHECK(cudaEventRecord(end));
    CHECK(cudaEventSynchronize(end));
    float milliseconds;
    CHECK(cudaEventElapsedTime(&milliseconds, begin, end));
    best = i == 0 ? best : std::min(best, milliseconds);
  }
  CHECK(cudaGetLastError());
  return best * 1e-3;
}

struct Vec3 {
  float x, y, z;
};

static __device__ int threadIndex() {
  return blockIdx.x * blockDim.x + threadIdx.x;
}

__global__ void saxpy(float a, const float4 *x, float4 *y) {
  int i = threadIndex();
  float4 p = x[i], q = y[i];
  y[i] = {a * p.x + q.x, a * p.y + q.y, a * p.z + q.z, a * p.w + q.w};
}

__global__ void integrate(Vec3 *x, Vec3 *v, const Vec3 *f, const float *w,
                          Vec3 g, float dt) {
  int i = threadIndex();
  Vec3 x0 = x[i], v0 = v[i], f0 = f[i];
  float w0 = w[i];
  Vec3 v1 = {v0.x + (f0.x * w0 + g.x) * dt, v0.y + (f0.y * w0 + g.y) * dt,
             v0.z + (f0.z * w0 + g.z) * dt};
  x[i] = {x0.x + v1.x * dt, x0.y + v1.y * dt, x0.z + v1.z * dt};
  v[i] = v1;
}

__global__ void stencil(const float *u, float *out, int n, float c) {
  int k = blockIdx.x * blockDim.x + threadIdx.x;
  int j = blockIdx.y * blockDim.y + threadIdx.y;
  int i = blockIdx.z;
  if (i == 0 || j == 0 || k == 0 || i >= n - 1 || j >= n - 1 || k >= n - 1)
    return;
  int at = (i * n + j) * n + k;
  out[at] = u[at] + c * (u[at - n * n] + u[at + n * n] + u[at - n] + u[at + n] +
                         u[at - 1] + u[at + 1] - 6.0f * u[at]);
}

/// Four cells along the last dimension per thread, by 16-byte accesses.
__global__ void stencilWide(const float *u, float *out, int n, float c) {
  int k = 4 * (blockIdx.x * blockDim.x + threadIdx.x);
  int j = blockIdx.y * blockDim.y + threadIdx.y;
  int i = blockIdx.z;
  if (i == 0 || j == 0 || i >= n - 1 || j >= n - 1 || k >= n)
    return;
  int at = (i * n + j) * n + k;
  auto load = [&](int index) {
    return *reinterpret_cast<const float4 *>(u + index);
  };
  float4 v = load(at), below = load(at - n * n), above = load(at + n * n),
         before = load(at - n), after = load(at + n);
  float left = u[at - 1], right = u[at + 4];
  auto cell = [&](float mid, float a, float b, float d, float e, float l,
                  float r) {
    return mid + c * (a + b + d + e + l + r - 6.0f * mid);
  };
  float4 result = {
      cell(v.x, below.x, above.x, before.x, after.x, left, v.y),
      cell(v.y, below.y, above.y, before.y, after.y, v.x, v.z),
      cell(v.z, below.z, above.z, before.z, after.z, v.y, v.w),
      cell(v.w, below.w, above.w, before.w, after.w, v.z, right)};
  if (k == 0)
    result.x = out[at];
  if (k == n - 4)
    result.w = out[at + 3];
  *reinterpret_cast<float4 *>(out + at) = result;
}

/// `Count` cells along the first dimension per thread: a plane that one cell
/// has loaded serves the next two.
template <int Count>
__global__ void stencilDeep(const float *u, float *out, int n, float c) {
  int k = blockIdx.x * blockDim.x + threadIdx.x;
  int j = blockIdx.y * blockDim.y + threadIdx.y;
  int first = 1 + blockIdx.z * Count;
  if (j == 0 || k == 0 || j >= n - 1 || k >= n - 1)
    return;
  const float *p = u + (first * n + j) * n + k;
  int planes = min(Count, n - 1 - first);
  float mid[Count + 2], around[Count];
#pragma unroll
  for (int i = 0; i < Count + 2; ++i)
    mid[i] = i < planes + 2 ? p[(i - 1) * n * n] : 0.0f;
#pragma unroll
  for (int i = 0; i < Count; ++i)
    if (i < planes)
      around[i] = p[i * n * n - n] + p[i * n * n + n] + p[i * n * n - 1] +
                  p[i * n * n + 1];
#pragma unroll
  for (int i = 0; i < Count; ++i)
    if (i < planes)
      out[((first + i) * n + j) * n + k] =
          mid[i + 1] +
          c * (mid[i] + mid[i + 2] + around[i] - 6.0f * mid[i + 1]);
}

/// 32 columns and 32 rows per block of 32 x 8 threads.
__global__ void transpose(const float *x, float *y, int n) {
  __shared__ float tile[32][33];
  int column = blockIdx.x * 32, row = blockIdx.y * 32;
  for (int i = threadIdx.y; i < 32; i += 8)
    tile[i][threadIdx.x] = x[size_t(row + i) * n + column + threadIdx.x];
  __syncthreads();
  for (int i = threadIdx.y; i < 32; i += 8)
    y[size_t(column + i) * n + row + threadIdx.x] = tile[threadIdx.x][i];
}

__global__ void sinExp(const float *x, float *y) {
  int i = threadIndex();
  float a = x[i];
  y[i] = sinf(a) * expf(-a * a) + sqrtf(fabsf(a)) + logf(1.0f + a * a);
}

/// Sums over the warp, over the block, then one atomic.
__global__ void sum(const float *x, float *total) {
  __shared__ float partial[32];
  float v = x[threadIndex()];
  for (int d = 16; d; d >>= 1)
    v += __shfl_down_sync(~0u, v, d);
  if (threadIdx.x % 32 == 0)
    partial[threadIdx.x / 32] = v;
  __syncthreads();
  if (threadIdx.x >= 32)
    return;
  v = threadIdx.x < blockDim.x / 32 ? partial[threadIdx.x] : 0.0f;
  for (int d = 16; d; d >>= 1)
    v += __shfl_down_sync(~0u, v, d);
  if (threadIdx.x == 0)
    atomicAdd(total, v);
}

__global__ void scatter(const float *x, float *y) {
  int i = threadIndex();
  atomicAdd(y + i, x[i]);
}

__global__ void empty(Vec3, float *) {}

/// Numbers between 0 and 1 without a pattern.
__global__ void fill(float *x, unsigned seed) {
  unsigned i = threadIndex(), h = (i ^ seed) * 0x9e3779b9u;
  h = (h ^ h >> 15) * 0x85ebca6bu;
  x[i] = (h >> 8) * 0x1p-24f;
}

int main() {
  const int n = 1 << 26, edge = 512, side = 8192, block = 256;
  float *x, *y;
  CHECK(cudaMalloc(&x, n * 16ull));
  CHECK(cudaMalloc(&y, n * 16ull));
  fill<<<n / block * 4, block>>>(x, 1);
  fill<<<n / block * 4, block>>>(y, 2);
  auto report = [](const char *name, double rate) {
    std::printf("\"%s\": %.6g, ", name, rate);
  };
  std::printf("{");
  report("copy", n * 8.0 / fastest([&] {
           cudaMemcpyAsync(y, x, n * 4ull, cudaMemcpyDeviceToDevice);
         }));
  report("saxpy", n * 12.0 / fastest([&] {
           saxpy<<<n / 4 / block, block>>>(2, (float4 *)x, (float4 *)y);
         }));
  int particles = n / 4;
  report("integrate", particles * 64.0 / fastest([&] {
           integrate<<<particles / block, block>>>(
               (Vec3 *)x, (Vec3 *)y, (Vec3 *)(x + 4ull * particles),
               y + 4ull * particles, {0, -9.8f, 0}, 1e-3f);
         }));
  dim3 threads(32, 8), blocks(edge / 32, edge / 8, edge);
  double cells = double(edge) * edge * edge * 8;
  report("stencil", cells / fastest([&] {
           stencil<<<blocks, threads>>>(x, y, edge, 0.1f);
         }));
  report("stencil_wide", cells / fastest([&] {
           stencilWide<<<dim3(edge / 128, edge / 8, edge), threads>>>(
               x, y, edge, 0.1f);
         }));
  report("stencil_deep2", cells / fastest([&] {
           stencilDeep<2><<<dim3(edge / 32, edge / 8, edge / 2), threads>>>(
               x, y, edge, 0.1f);
         }));
  report("stencil_deep4", cells / fastest([&] {
           stencilDeep<4><<<dim3(edge / 32, edge / 8, edge / 4), threads>>>(
               x, y, edge, 0.1f);
         }));
  report("transpose", double(side) * side * 8 / fastest([&] {
           transpose<<<dim3(side / 32, side / 32), threads>>>(x, y, side);
         }));
  report("math",
         n / fastest([&] { sinExp<<<n / block, block>>>(x, y); }));
  report("sum", n / fastest([&] { sum<<<n / block, block>>>(x, y); }));
  report("scatter", n / fastest([&] { scatter<<<n / block, block>>>(x, y); }));
  void *host;
  const size_t bytes = 1 << 28;
  CHECK(cudaMallocHost(&host, bytes));
  report("upload", bytes / fastest([&] {
           cudaMemcpyAsync(x, host, bytes, cudaMemcpyHostToDevice);
         }));
  report("download", bytes / fastest([&] {
           cudaMemcpyAsync(host, x, bytes, cudaMemcpyDeviceToHost);
         }));
  double best = 1e9;
  for (int batch = 0; batch < 50; ++batch) {
    auto begin = std::chrono::steady_clock::now();
    for (int i = 0; i < 100; ++i)
      empty<<<1, block>>>({}, x);
    std::chrono::duration<double> time =
        std::chrono::steady_clock::now() - begin;
    best = std::min(best, time.count() / 100);
    CHECK(cudaDeviceSynchronize());
  }
  std::printf("\"launch\": %.6g}\n", best);
}
