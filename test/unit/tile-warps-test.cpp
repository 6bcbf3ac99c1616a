//===- tile-warps-test.cpp - Factors and solves of warps ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The functions that GPU blocks of full warps call, with threads of the host,
// which exchange by memory what lanes shuffle.
//
//===----------------------------------------------------------------------===//

#include <gtest/gtest.h>

#include <barrier>
#include <cmath>
#include <memory>
#include <random>
#include <thread>
#include <vector>

// In place of lib/DeviceLib/nvidia/TileInstructions.h.
#define WARP_DEVICELIB_NVIDIA_TILEINSTRUCTIONS_H
#define WARP_INLINE __attribute__((always_inline)) inline

namespace {

constexpr int warpSize = 32;

struct HostWarp {
  std::barrier<> point{warpSize};
  double values[warpSize];
};
struct HostBlock {
  explicit HostBlock(int threads) : point(threads), warps(threads / warpSize) {}
  std::barrier<> point;
  std::vector<HostWarp> warps;
};
thread_local HostBlock *block;
thread_local int number;

int threadNumber() { return number; }
HostWarp &ownWarp() { return block->warps[number / warpSize]; }
void syncThreads() { block->point.arrive_and_wait(); }
void syncWarp() { ownWarp().point.arrive_and_wait(); }

template <class T> T exchange(T value, int lane) {
  HostWarp &warp = ownWarp();
  warp.values[number % warpSize] = value;
  syncWarp();
  T given = T(warp.values[lane]);
  syncWarp();
  return given;
}
float shuffle(float value, int lane) { return exchange(value, lane); }
double shuffle(double value, int lane) { return exchange(value, lane); }

float flushed(float x) { return std::abs(x) < 1.17549435e-38f ? 0 * x : x; }
float reciprocal(float x) { return 1 / x; }
float flushedReciprocal(float x) { return 1 / flushed(x); }
float flushedReciprocalRoot(float x) { return 1 / std::sqrt(flushed(x)); }

} // namespace

#include "DeviceLib/gpu/TileColumnSolves.cpp"
#include "DeviceLib/gpu/TileFactors.cpp"
#include "DeviceLib/gpu/TileSubstitutions.cpp"

namespace {

template <class Work> void byBlock(int threads, const Work &work) {
  HostBlock shared(threads);
  std::vector<std::thread> team;
  for (int t = 0; t < threads; ++t)
    team.emplace_back([&, t] {
      block = &shared;
      number = t;
      work();
    });
  for (std::thread &thread : team)
    thread.join();
}

/// Memory at a multiple of what a vector of four needs.
template <class T> class Tile {
public:
  explicit Tile(int count)
      : values(new (std::align_val_t(64)) T[count]()), count(count) {}
  ~Tile() { operator delete[](values, std::align_val_t(64)); }
  Tile(const Tile &) = delete;
  T &operator[](int i) {
    EXPECT_TRUE(i >= 0 && i < count);
    return values[i];
  }
  u64 place() const { return u64(values); }

private:
  T *values;
  int count;
};

struct Case {
  int n, columns, threads;
  /// The triangle is read as columns, as of a transposed tile.
  bool across;
  /// Between rows, or columns.
  int room;
};

template <class T> T errorBound(int n) {
  return 8 * n * std::numeric_limits<T>::epsilon();
}

/// Symmetric and positive definite: A = R R^T / n + I of random R.
std::vector<double> makeSystem(int n) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::vector<double> root(n * n), system(n * n);
  for (double &value : root)
    value = normal(random);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      double sum = 0;
      for (int k = 0; k < n; ++k)
        sum += root[i * n + k] * root[j * n + k];
      system[i * n + j] = sum / n + (i == j);
    }
  return system;
}

class TileWarps : public testing::TestWithParam<Case> {
protected:
  int pitch() const { return GetParam().n + GetParam().room; }
  int row() const { return GetParam().across ? 1 : pitch(); }
  int column() const { return GetParam().across ? pitch() : 1; }
  int at(int i, int j) const { return i * row() + j * column(); }

  template <class T> void factorInPlace(Tile<T> &matrix) const {
    auto [n, columns, threads, across, room] = GetParam();
    Tile<T> scratch(16 * 17);
    byBlock(threads, [&] {
      if constexpr (sizeof(T) == 4)
        (n <= 8 ? warp_tile_factor_f32_8 : warp_tile_factor_f32_16)(
            matrix.place(), row(), column(), matrix.place(), row(), column(),
            scratch.place(), n, threads, nullptr);
      else
        (n <= 8 ? warp_tile_factor_f64_8 : warp_tile_factor_f64_16)(
            matrix.place(), row(), column(), matrix.place(), row(), column(),
            scratch.place(), n, threads, nullptr);
    });
  }

  template <class T> void fill(Tile<T> &matrix) const {
    int n = GetParam().n;
    std::vector<double> system = makeSystem(n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        matrix[at(i, j)] = T(system[i * n + j]);
  }

  /// L L^T is the matrix within its rounding, with zeros above.
  template <class T> void testFactor() const {
    int n = GetParam().n;
    Tile<T> matrix(n * pitch());
    fill(matrix);
    factorInPlace(matrix);
    std::vector<double> system = makeSystem(n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        double sum = 0;
        for (int k = 0; k < n; ++k)
          sum += double(matrix[at(i, k)]) * double(matrix[at(j, k)]);
        EXPECT_NEAR(sum, system[i * n + j], 8 * errorBound<T>(n));
        if (j > i)
          EXPECT_EQ(matrix[at(i, j)], 0);
      }
  }

  /// The factor is NaN from a pivot of -1 on, and as ever before.
  template <class T> void testPivots() const {
    int n = GetParam().n, bad = n / 2;
    Tile<T> matrix(n * pitch()), good(n * pitch());
    fill(matrix);
    fill(good);
    matrix[at(bad, bad)] = -1;
    factorInPlace(matrix);
    factorInPlace(good);
    for (int j = 0; j < n; ++j) {
      if (j < bad)
        EXPECT_EQ(matrix[at(j, j)], good[at(j, j)]);
      else
        EXPECT_TRUE(std::isnan(matrix[at(j, j)]));
    }
  }

  /// The triangle times the solution is the right side.
  template <class T> void testSolve(bool byColumns, bool backwards) const {
    auto [n, columns, threads, across, room] = GetParam();
    Tile<T> matrix(n * pitch()), sides(n * columns);
    fill(matrix);
    factorInPlace(matrix);
    // Backwards the matrix is the transposed factor.
    int rowStep = backwards ? column() : row();
    int columnStep = backwards ? row() : column();
    for (int e = 0; e < n * columns; ++e)
      sides[e] = T(std::sin(e + 1.0));
    int size = n, count = columns, team = threads;
    byBlock(team, [&] {
      auto solve = [&](auto *function) {
        function(sides.place(), matrix.place(), rowStep, columnStep, size,
                 count, backwards, team, nullptr);
      };
      bool isSmall = size <= 8;
      if constexpr (sizeof(T) == 4)
        solve(byColumns     ? isSmall ? warp_tile_solve_columns_f32_8
                                      : warp_tile_solve_columns_f32_16
              : size <= 32  ? warp_tile_substitute_f32_1
              : size <= 64  ? warp_tile_substitute_f32_2
                            : warp_tile_substitute_f32_4);
      else
        solve(byColumns     ? isSmall ? warp_tile_solve_columns_f64_8
                                      : warp_tile_solve_columns_f64_16
              : size <= 32  ? warp_tile_substitute_f64_1
              : size <= 64  ? warp_tile_substitute_f64_2
                            : warp_tile_substitute_f64_4);
    });
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < columns; ++c) {
        double sum = 0;
        for (int k = 0; k < n; ++k)
          sum += double(matrix[backwards ? at(k, i) : at(i, k)]) *
                 double(sides[k * columns + c]);
        EXPECT_NEAR(sum, std::sin(i * columns + c + 1.0),
                    32 * errorBound<T>(n));
      }
  }
};

TEST_P(TileWarps, FactorsSystems) {
  testFactor<float>();
  testFactor<double>();
}

TEST_P(TileWarps, GivesNanFromABadPivotOn) {
  testPivots<float>();
  testPivots<double>();
}

TEST_P(TileWarps, SolvesColumnsByThreads) {
  for (bool backwards : {false, true}) {
    testSolve<float>(true, backwards);
    testSolve<double>(true, backwards);
  }
}

TEST_P(TileWarps, SolvesColumnsByWarps) {
  for (bool backwards : {false, true}) {
    testSolve<float>(false, backwards);
    testSolve<double>(false, backwards);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Shapes, TileWarps,
    testing::Values(Case{1, 1, 32, false, 0}, Case{5, 2, 32, true, 0},
                    Case{8, 3, 32, false, 4}, Case{10, 3, 32, true, 1},
                    Case{16, 16, 32, true, 0}, Case{16, 16, 32, false, 4},
                    Case{20, 5, 64, true, 4}, Case{33, 2, 64, false, 0},
                    Case{40, 34, 64, true, 4}));

} // namespace
