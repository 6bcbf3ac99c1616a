//===- decompositions-test.cpp - Small matrices beside Eigen's ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Eigen computes the same in long double. Values whose error a backward stable
// method bounds by rounding of the matrix are compared; vectors, which have
// no such bound where values are close, have to be orthogonal and to give the
// matrix again.
//
//===----------------------------------------------------------------------===//

#include "warp/Runtime.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

using namespace warp;

static const char *const factorsText = R"(
!m = !warp.mat<3x3 x f64>
!v = !warp.vec<3 x f64>
module @factors {
  func.func @factors(
      %a: !warp.array<1 x !m>, %u: !warp.array<1 x !m>,
      %s: !warp.array<1 x !v>, %v: !warp.array<1 x !m>,
      %q: !warp.array<1 x !m>, %r: !warp.array<1 x !m>,
      %w: !warp.array<1 x !m>, %d: !warp.array<1 x !v>,
      %inv: !warp.array<1 x !m>, %det: !warp.array<1 x f64>)
      attributes {warp.arg_names = ["a", "u", "s", "v", "q", "r", "w", "d",
                                    "inv", "det"], warp.kernel} {
    %i = warp.tid : si32
    %m = warp.load %a[%i] : !warp.array<1 x !m>, si32 -> !m
    %svd:3 = warp.svd3(%m) : (!m) -> (!m, !v, !m)
    warp.store %svd#0, %u[%i] : !m, !warp.array<1 x !m>, si32
    warp.store %svd#1, %s[%i] : !v, !warp.array<1 x !v>, si32
    warp.store %svd#2, %v[%i] : !m, !warp.array<1 x !m>, si32
    %qr:2 = warp.qr3(%m) : (!m) -> (!m, !m)
    warp.store %qr#0, %q[%i] : !m, !warp.array<1 x !m>, si32
    warp.store %qr#1, %r[%i] : !m, !warp.array<1 x !m>, si32
    %t = warp.transpose(%m) : (!m) -> !m
    %sum = warp.add(%t, %m) : (!m, !m) -> !m
    %eig:2 = warp.eig3(%sum) : (!m) -> (!m, !v)
    warp.store %eig#0, %w[%i] : !m, !warp.array<1 x !m>, si32
    warp.store %eig#1, %d[%i] : !v, !warp.array<1 x !v>, si32
    %j = warp.inverse(%m) : (!m) -> !m
    warp.store %j, %inv[%i] : !m, !warp.array<1 x !m>, si32
    %e = warp.determinant(%m) : (!m) -> f64
    warp.store %e, %det[%i] : f64, !warp.array<1 x f64>, si32
    return
  }
})";

namespace {

// As kernels store them.
using Matrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Vector = Eigen::Vector3d;
using Wide = Eigen::Matrix<long double, 3, 3>;
using WideVector = Eigen::Matrix<long double, 3, 1>;

constexpr int count = 2000;
// A few times the unit roundoff for each of some tens of operations.
constexpr long double rounding = 1e-14L;

struct Params {
  LaunchHeader header;
  ArrayDescriptor arrays[10];
};

template <typename T> ArrayDescriptor arrayOf(std::vector<T> &values) {
  ArrayDescriptor array;
  array.data = values.data();
  array.ndim = 1;
  array.shape[0] = count;
  array.strides[0] = sizeof(T);
  return array;
}

Wide rotation(std::mt19937 &random) {
  std::normal_distribution<long double> normal;
  Eigen::Quaternion<long double> q(normal(random), normal(random),
                                   normal(random), normal(random));
  return q.normalized().toRotationMatrix();
}

class Decompositions : public testing::Test {
protected:
  static void SetUpTestSuite() {
    KernelCache::get().setEnabled(false);
    std::mt19937 random(11);
    std::uniform_real_distribution<long double> decades(-12, 0), sign(-1, 1);
    for (Matrix &one : a) {
      // From well conditioned to singular but for rounding, equal values too.
      WideVector values(1, std::pow(10.0L, decades(random)), 0);
      values[1] = random() % 4 ? values[1] : 1;
      values[2] = values[1] * std::pow(10.0L, decades(random) / 12);
      values[2] *= std::copysign(1.0L, sign(random));
      one = (rotation(random) * values.asDiagonal() * rotation(random))
                .cast<double>();
    }
    Params params{{},
                  {arrayOf(a), arrayOf(u), arrayOf(s), arrayOf(v), arrayOf(q),
                   arrayOf(r), arrayOf(w), arrayOf(d), arrayOf(inverse),
                   arrayOf(determinant)}};
    Kernel kernel(Module::fromText(factorsText), "factors");
    LaunchDim dim;
    dim.rank = 1;
    dim.extent[0] = count;
    kernel.launch(cpuDevice, dim, &params);
  }

  static std::vector<Matrix> a, u, v, q, r, w, inverse;
  static std::vector<Vector> s, d;
  static std::vector<double> determinant;
};

std::vector<Matrix> Decompositions::a(count), Decompositions::u(count),
    Decompositions::v(count), Decompositions::q(count),
    Decompositions::r(count), Decompositions::w(count),
    Decompositions::inverse(count);
std::vector<Vector> Decompositions::s(count), Decompositions::d(count);
std::vector<double> Decompositions::determinant(count);

long double largest(const Wide &difference) {
  return difference.cwiseAbs().maxCoeff();
}

void expectRotation(const Matrix &matrix) {
  Wide wide = matrix.cast<long double>();
  EXPECT_LE(largest(wide.transpose() * wide - Wide::Identity()), rounding);
  EXPECT_NEAR(double(wide.determinant()), 1, 1e-13);
}

} // namespace

TEST_F(Decompositions, SingularValuesAreEigens) {
  for (int i = 0; i < count; ++i) {
    Wide matrix = a[i].cast<long double>();
    Eigen::JacobiSVD<Wide> svd(matrix);
    long double scale = svd.singularValues()[0];
    WideVector values = s[i].cast<long double>();
    EXPECT_LE((values.cwiseAbs() - svd.singularValues()).cwiseAbs().maxCoeff(),
              rounding * scale)
        << i;
    expectRotation(u[i]);
    expectRotation(v[i]);
    Wide again = u[i].cast<long double>() * values.asDiagonal() *
                 v[i].cast<long double>().transpose();
    EXPECT_LE(largest(again - matrix), rounding * scale) << i;
  }
}

TEST_F(Decompositions, TrianglesAreEigens) {
  for (int i = 0; i < count; ++i) {
    Wide matrix = a[i].cast<long double>(), found = r[i].cast<long double>();
    long double scale = matrix.norm();
    expectRotation(q[i]);
    EXPECT_LE(largest(q[i].cast<long double>() * found - matrix),
              rounding * scale)
        << i;
    // Householder's triangle has other signs, and errors by the condition.
    Eigen::JacobiSVD<Wide> svd(matrix);
    long double condition = scale / svd.singularValues()[2];
    Wide own = Eigen::HouseholderQR<Wide>(matrix)
                   .matrixQR()
                   .triangularView<Eigen::Upper>();
    EXPECT_LE(largest(found.cwiseAbs() - own.cwiseAbs()),
              rounding * scale * condition)
        << i;
  }
}

TEST_F(Decompositions, EigenvaluesAreEigens) {
  for (int i = 0; i < count; ++i) {
    Matrix rounded = a[i].transpose() + a[i];
    Wide matrix = rounded.cast<long double>();
    Eigen::SelfAdjointEigenSolver<Wide> own(matrix);
    WideVector values = d[i].cast<long double>();
    long double scale = matrix.norm();
    EXPECT_LE((values - own.eigenvalues().reverse()).cwiseAbs().maxCoeff(),
              rounding * scale)
        << i;
    expectRotation(w[i]);
    Wide again = w[i].cast<long double>() * values.asDiagonal() *
                 w[i].cast<long double>().transpose();
    EXPECT_LE(largest(again - matrix), rounding * scale) << i;
  }
}

TEST_F(Decompositions, InversesAndDeterminantsAreEigens) {
  for (int i = 0; i < count; ++i) {
    Wide matrix = a[i].cast<long double>(), own = matrix.inverse();
    long double scale = matrix.norm(), condition = scale * own.norm();
    EXPECT_LE(std::abs(determinant[i] - matrix.determinant()),
              rounding * scale * scale * scale)
        << i;
    // Formulas by cofactors lose the square of the condition at most.
    if (condition < 1e6L)
      EXPECT_LE(largest(inverse[i].cast<long double>() - own),
                rounding * condition * condition * own.norm())
          << i;
  }
}
