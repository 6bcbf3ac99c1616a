// Limits of the hardware, for benchmarks/spine.py (through ctypes):
//
//   triad        a = b + s * c by pinned threads, with ordinary or streaming
//                stores: the bandwidth that a kernel over arrays can hope for
//   bare_launch  cuLaunchKernel of an empty kernel with a parameter block as
//                large as that of a kernel with four arrays
//
// Threads live for one call and first touch their own part of the arrays; each
// pass is closed by a spinning barrier. Built by spine.py with -O3
// -march=native.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <dlfcn.h>
#include <immintrin.h>
#include <pthread.h>
#include <sched.h>
#include <thread>
#include <vector>

namespace {

using Clock = std::chrono::steady_clock;

double seconds(Clock::duration d) {
  return std::chrono::duration<double>(d).count();
}

/// Sense-reversing barrier.
class Barrier {
public:
  explicit Barrier(int count) : count(count), waiting(count) {}

  void wait() {
    int round = generation.load(std::memory_order_acquire);
    if (waiting.fetch_sub(1) == 1) {
      waiting.store(count);
      generation.fetch_add(1, std::memory_order_release);
      return;
    }
    while (generation.load(std::memory_order_acquire) == round)
      _mm_pause();
  }

private:
  const int count;
  std::atomic<int> waiting;
  std::atomic<int> generation{0};
};

/// The processors this process may use.
std::vector<int> allowedProcessors() {
  cpu_set_t set;
  sched_getaffinity(0, sizeof(set), &set);
  std::vector<int> processors;
  for (int i = 0; i < CPU_SETSIZE; ++i)
    if (CPU_ISSET(i, &set))
      processors.push_back(i);
  return processors;
}

void pinTo(int processor) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(processor, &set);
  pthread_setaffinity_np(pthread_self(), sizeof(set), &set);
}

void ordinary(float *a, const float *b, const float *c, float s, int64_t n) {
  for (int64_t i = 0; i < n; ++i)
    a[i] = b[i] + s * c[i];
}

/// n is a multiple of 16 and the pointers are aligned to 64 bytes.
void streaming(float *a, const float *b, const float *c, float s, int64_t n) {
#if defined(__AVX512F__)
  __m512 scale = _mm512_set1_ps(s);
  for (int64_t i = 0; i < n; i += 16) {
    __m512 product = _mm512_mul_ps(scale, _mm512_load_ps(c + i));
    _mm512_stream_ps(a + i, _mm512_add_ps(_mm512_load_ps(b + i), product));
  }
#elif defined(__AVX__)
  __m256 scale = _mm256_set1_ps(s);
  for (int64_t i = 0; i < n; i += 8) {
    __m256 product = _mm256_mul_ps(scale, _mm256_load_ps(c + i));
    _mm256_stream_ps(a + i, _mm256_add_ps(_mm256_load_ps(b + i), product));
  }
#else
  __m128 scale = _mm_set1_ps(s);
  for (int64_t i = 0; i < n; i += 4) {
    __m128 product = _mm_mul_ps(scale, _mm_load_ps(c + i));
    _mm_stream_ps(a + i, _mm_add_ps(_mm_load_ps(b + i), product));
  }
#endif
  _mm_sfence();
}

const char *const EmptyKernel = R"(.version 7.0
.target sm_75
.address_size 64
.visible .entry empty(.param .align 8 .b8 p[248]) { ret; }
)";

} // namespace

/// Bytes per second, in the fastest of `passes`, of a triad that moves about
/// `bytes`; `count` threads, 0 for one per processor.
extern "C" double triad(int64_t bytes, int count, int passes, int stream) {
  std::vector<int> processors = allowedProcessors();
  if (count <= 0)
    count = static_cast<int>(processors.size());
  int64_t part = bytes / 12 / count / 16 * 16;
  if (part == 0)
    return 0.0;
  auto allocate = [&] {
    return static_cast<float *>(std::aligned_alloc(64, part * count * 4));
  };
  float *a = allocate(), *b = allocate(), *c = allocate();
  Barrier barrier(count);
  std::vector<double> times(passes);
  auto work = [&](int t) {
    pinTo(processors[t % processors.size()]);
    int64_t at = t * part;
    std::fill_n(a + at, part, 0.0f);
    std::fill_n(b + at, part, 1.0f);
    std::fill_n(c + at, part, 2.0f);
    for (int pass = -2; pass < passes; ++pass) {
      barrier.wait();
      Clock::time_point begin = Clock::now();
      (stream ? streaming : ordinary)(a + at, b + at, c + at, 3.0f, part);
      barrier.wait();
      if (t == 0 && pass >= 0)
        times[pass] = seconds(Clock::now() - begin);
    }
  };
  std::vector<std::thread> threads;
  for (int t = 0; t < count; ++t)
    threads.emplace_back(work, t);
  for (std::thread &thread : threads)
    thread.join();
  std::free(a);
  std::free(b);
  std::free(c);
  return part * count * 12.0 / *std::min_element(times.begin(), times.end());
}

/// Host seconds per launch of an empty kernel, or -1 without a CUDA device.
extern "C" double bare_launch(int device, int repeats) {
  void *driver = dlopen("libcuda.so.1", RTLD_NOW);
  if (!driver)
    return -1.0;
  auto call = [&](const char *name, auto... arguments) {
    auto function =
        reinterpret_cast<int (*)(decltype(arguments)...)>(dlsym(driver, name));
    return function ? function(arguments...) : -1;
  };
  int handle = 0;
  void *context = nullptr, *module = nullptr, *kernel = nullptr;
  if (call("cuInit", 0u) || call("cuDeviceGet", &handle, device) ||
      call("cuDevicePrimaryCtxRetain", &context, handle) ||
      call("cuCtxSetCurrent", context) ||
      call("cuModuleLoadData", &module,
           static_cast<const void *>(EmptyKernel)) ||
      call("cuModuleGetFunction", &kernel, module, "empty"))
    return -1.0;
  using Launch = int (*)(void *, unsigned, unsigned, unsigned, unsigned,
                         unsigned, unsigned, unsigned, void *, void **,
                         void **);
  auto launch = reinterpret_cast<Launch>(dlsym(driver, "cuLaunchKernel"));
  alignas(8) char block[248] = {};
  void *parameters[] = {block};
  std::vector<double> times;
  // Short batches: a full queue would make the host wait for the device.
  for (int batch = 0; batch < repeats; ++batch) {
    Clock::time_point begin = Clock::now();
    for (int i = 0; i < 100; ++i)
      launch(kernel, 1, 1, 1, 256, 1, 1, 0, nullptr, parameters, nullptr);
    times.push_back(seconds(Clock::now() - begin) / 100);
    call("cuCtxSynchronize");
  }
  call("cuModuleUnload", module);
  std::nth_element(times.begin(), times.begin() + repeats / 2, times.end());
  return times[repeats / 2];
}
