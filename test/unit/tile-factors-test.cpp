//===- tile-factors-test.cpp - Factors by teams of any number of threads --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The body that GPU blocks run, with threads of the host.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/tiles/Factors.h"

#include <gtest/gtest.h>

#include <barrier>
#include <cmath>
#include <functional>
#include <random>
#include <thread>
#include <vector>

namespace {

struct Team {
  int thread, threads;
  std::barrier<> *point;
  void barrier() const { point->arrive_and_wait(); }
};

/// Runs work in each thread of a team.
void byTeam(int threads, const std::function<void(const Team &)> &work) {
  std::barrier<> point(threads);
  std::vector<std::thread> team;
  for (int t = 0; t < threads; ++t)
    team.emplace_back([&, t] { work(Team{t, threads, &point}); });
  for (std::thread &thread : team)
    thread.join();
}

using Values = std::vector<double>;

double dot(const Values &a, int i, const Values &b, int j, int n) {
  double sum = 0;
  for (int k = 0; k < n; ++k)
    sum += a[i * n + k] * b[j * n + k];
  return sum;
}

Values randomMatrix(int n, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Values values(n * n);
  for (double &value : values)
    value = normal(random);
  return values;
}

/// Symmetric and positive definite.
Values makeSystem(int n) {
  Values root = randomMatrix(n, 7), system(n * n);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j)
      system[i * n + j] = dot(root, i, root, j, n) / n + (i == j);
  return system;
}

struct Case {
  int n, threads;
  bool upper;
};

class TileFactors : public testing::TestWithParam<Case> {
protected:
  tiles::Matrix<double *> view(Values &values) const {
    auto [n, threads, upper] = GetParam();
    return upper ? tiles::Matrix<double *>{values.data(), 1, n}
                 : tiles::Matrix<double *>{values.data(), n, 1};
  }
  /// In place, as a lower triangle.
  Values factorOf(Values system) const {
    auto [n, threads, upper] = GetParam();
    byTeam(threads, [&](const Team &team) {
      tiles::factor<double>(team, view(system), view(system), n);
    });
    if (!upper)
      return system;
    Values lower(n * n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j)
        lower[i * n + j] = system[j * n + i];
    return lower;
  }
};

/// L L^T is the matrix, and what is above the diagonal is zero.
TEST_P(TileFactors, FactorsSystems) {
  int n = GetParam().n;
  Values system = makeSystem(n), factor = factorOf(system);
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      EXPECT_NEAR(dot(factor, i, factor, j, n), system[i * n + j], 1e-12);
      if (j > i)
        EXPECT_EQ(factor[i * n + j], 0);
    }
}

/// From the first pivot on that is not positive, a factor is NaN.
TEST_P(TileFactors, GivesNanWithoutAFactor) {
  int n = GetParam().n, last = n * n - 1;
  Values system = makeSystem(n);
  system[last] = -1;
  EXPECT_TRUE(std::isnan(factorOf(system)[last]));
}

/// <A', dA> is <L', dL>, by differences.
TEST_P(TileFactors, DifferentiatesFactors) {
  auto [n, threads, upper] = GetParam();
  Values system = makeSystem(n), factor = factorOf(system);
  Values bar = randomMatrix(n, 3), change = randomMatrix(n, 5);
  // Triangles only, and a symmetric change.
  for (int i = 0; i < n; ++i)
    for (int j = i + 1; j < n; ++j) {
      bar[i * n + j] = 0;
      change[i * n + j] = change[j * n + i];
    }
  constexpr double step = 1e-6;
  auto moved = [&](double sign) {
    Values other = system;
    for (int e = 0; e < n * n; ++e)
      other[e] += sign * step * change[e];
    return factorOf(other);
  };
  Values above = moved(1), below = moved(-1);
  double expected = 0, got = 0;
  for (int e = 0; e < n * n; ++e)
    expected += bar[e] * (above[e] - below[e]) / (2 * step);
  tiles::Matrix<double *> out{bar.data(), n, 1}, in{factor.data(), n, 1};
  byTeam(threads, [&](const Team &team) {
    tiles::factorAdjoint<double>(team, out, in, n);
  });
  for (int e = 0; e < n * n; ++e)
    got += bar[e] * change[e];
  EXPECT_NEAR(got, expected, 1e-6 * std::max(1.0, std::abs(expected)));
}

/// The factor times the solution is the right side, forwards and backwards.
TEST_P(TileFactors, SolvesTriangles) {
  auto [n, threads, upper] = GetParam();
  constexpr int columns = 3;
  Values factor = factorOf(makeSystem(n)), sides(n * columns);
  for (int e = 0; e < n * columns; ++e)
    sides[e] = std::sin(e + 1.0);
  for (bool backwards : {false, true}) {
    tiles::Matrix<double *> m{factor.data(), backwards ? 1 : n,
                              backwards ? n : 1};
    Values x = sides;
    byTeam(threads, [&](const Team &team) {
      tiles::solve<double>(team, tiles::Matrix<double *>{x.data(), columns, 1},
                           m, n, columns, backwards);
    });
    for (int i = 0; i < n; ++i)
      for (int c = 0; c < columns; ++c) {
        double sum = 0;
        for (int j = 0; j < n; ++j)
          sum += m(i, j) * x[j * columns + c];
        EXPECT_NEAR(sum, sides[i * columns + c], 1e-12);
      }
  }
}

INSTANTIATE_TEST_SUITE_P(Teams, TileFactors,
                         testing::Values(Case{1, 1, false}, Case{2, 3, true},
                                         Case{5, 1, true}, Case{7, 4, false},
                                         Case{12, 5, true},
                                         Case{16, 2, false}));

} // namespace
