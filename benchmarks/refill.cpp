// Lanes that leave a loop at different times, by hand: two vectors in turn, as
// kernels run them, against one vector whose idle lanes take the next threads
// (refill) once that many are idle. The escape times of 2^18 points, scattered
// or in the order of a picture, on one thread:
//
//   clang++ -O3 -march=native benchmarks/refill.cpp -o refill && ./refill
//
// Needs AVX-512. Both have the same results.

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <immintrin.h>
#include <random>
#include <vector>

namespace {

constexpr int width = 512, count = width * width, most = 256, lanes = 16;
using Floats = std::vector<float>;
using Vector = __m512;

struct Points {
  Floats x, y;
};

/// Escape times of 16 points in flight.
struct State {
  Vector x, y, zx = _mm512_setzero_ps(), zy = _mm512_setzero_ps();
  __m512i steps = _mm512_setzero_si512();
  __mmask16 live = 0xffff;

  void advance() {
    Vector xx = _mm512_mul_ps(zx, zx), yy = _mm512_mul_ps(zy, zy);
    live = _mm512_mask_cmp_ps_mask(live, _mm512_add_ps(xx, yy),
                                   _mm512_set1_ps(4), _CMP_LT_OQ);
    live = _mm512_mask_cmplt_epi32_mask(live, steps, _mm512_set1_epi32(most));
    steps = _mm512_mask_add_epi32(steps, live, steps, _mm512_set1_epi32(1));
    zy = _mm512_fmadd_ps(_mm512_add_ps(zx, zx), zy, y);
    zx = _mm512_add_ps(_mm512_sub_ps(xx, yy), x);
  }
};

void inTurn(const Points &points, Floats &times) {
  for (int i = 0; i < count; i += 2 * lanes) {
    State a{_mm512_loadu_ps(&points.x[i]), _mm512_loadu_ps(&points.y[i])};
    State b{_mm512_loadu_ps(&points.x[i + lanes]),
            _mm512_loadu_ps(&points.y[i + lanes])};
    while (a.live | b.live) {
      a.advance();
      b.advance();
    }
    _mm512_storeu_ps(&times[i], _mm512_cvtepi32_ps(a.steps));
    _mm512_storeu_ps(&times[i + lanes], _mm512_cvtepi32_ps(b.steps));
  }
}

/// Lanes of `empty` get the points that follow, as long as there are some.
__mmask16 refill(State &state, __m512i &places, __mmask16 empty, int next,
                 const Points &points) {
  int left = std::min(std::popcount(empty), count - next);
  auto taken = __mmask16(_pdep_u32((1u << left) - 1, empty));
  __m512i order = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12,
                                    13, 14, 15);
  places = _mm512_mask_expand_epi32(
      places, taken, _mm512_add_epi32(_mm512_set1_epi32(next), order));
  state.x = _mm512_mask_expandloadu_ps(state.x, taken, points.x.data() + next);
  state.y = _mm512_mask_expandloadu_ps(state.y, taken, points.y.data() + next);
  state.zx = _mm512_maskz_mov_ps(__mmask16(~taken), state.zx);
  state.zy = _mm512_maskz_mov_ps(__mmask16(~taken), state.zy);
  state.steps = _mm512_maskz_mov_epi32(__mmask16(~taken), state.steps);
  state.live |= taken;
  return taken;
}

void refilled(const Points &points, Floats &times, int idle) {
  State state{_mm512_setzero_ps(), _mm512_setzero_ps()};
  state.live = 0;
  __m512i places = _mm512_setzero_si512();
  __mmask16 used = 0;
  for (int next = 0; next < count || used;) {
    if (lanes - std::popcount(state.live) >= idle || !state.live) {
      __mmask16 done = used & __mmask16(~state.live);
      _mm512_mask_i32scatter_ps(times.data(), done, places,
                                _mm512_cvtepi32_ps(state.steps), 4);
      used &= state.live;
      __mmask16 taken =
          refill(state, places, __mmask16(~used), next, points);
      next += std::popcount(taken);
      used |= taken;
    }
    state.advance();
  }
}

template <class Work> double pointsPerSecond(Work work) {
  double best = 1e9;
  for (int i = 0; i < 9; ++i) {
    auto begin = std::chrono::steady_clock::now();
    work();
    std::chrono::duration<double> took =
        std::chrono::steady_clock::now() - begin;
    best = std::min(best, took.count());
  }
  return count / best;
}

void compare(const char *name, const Points &points) {
  Floats expected(count);
  double base = pointsPerSecond([&] { inTurn(points, expected); });
  std::printf("%-10s two in turn %6.1f M/s", name, base / 1e6);
  for (int idle : {4, 8, 12}) {
    Floats times(count);
    double rate = pointsPerSecond([&] { refilled(points, times, idle); });
    std::printf("  refill at %2d idle %5.2fx", idle, rate / base);
    if (times != expected)
      std::exit((std::puts("  other results"), 1));
  }
  std::puts("");
}

} // namespace

int main() {
  Points scattered{Floats(count), Floats(count)}, picture = scattered;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> x(-2, 1), y(-1, 1);
  for (int i = 0; i < count; ++i) {
    scattered.x[i] = x(random);
    scattered.y[i] = y(random);
    picture.x[i] = float(i % width) * 3 / width - 2;
    picture.y[i] = float(i / width) * 2 / width - 1;
  }
  compare("scattered", scattered);
  compare("picture", picture);
}
