//===- DirectSolver.cpp - Sparse direct solvers: factors of a matrix ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A C interface to Eigen's sparse factorisations in double precision. One
// factorisation serves many right-hand sides; the pattern is analysed once.
// A factor that cannot be trusted is refused: by a pivot that cancellation
// has used up, by an estimate of the condition number (N. J. Higham, FORTRAN
// codes for estimating the one-norm, ACM TOMS 14(4), 1988), or by the
// backward error of a system whose solution is known.
//
//===----------------------------------------------------------------------===//

#include <Eigen/Sparse>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <string>

namespace {

using Matrix = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
using Rows = Eigen::SparseMatrix<double, Eigen::RowMajor, int>;
using Vector = Eigen::VectorXd;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// A reason to refuse a matrix, and the row or column that shows it.
struct Breakdown {
  std::string message;
  std::int64_t index = -1;
  double pivot = 0;
};

/// A matrix and its factors.
class Factor {
public:
  virtual ~Factor() = default;
  virtual void analyze(const Matrix &matrix) = 0;
  virtual void factorize(const Matrix &matrix) = 0;
  virtual Vector solve(const Vector &b) const = 0;
  virtual Vector solveTransposed(const Vector &b) const = 0;
  /// Solves with the matrix transposed times the matrix.
  virtual Vector solveNormal(const Vector &b) const {
    return solve(solveTransposed(b));
  }
  virtual std::int64_t nonZeros() const = 0;
};

class Symmetric : public Factor {
public:
  explicit Symmetric(bool definite) : definite(definite) {}

  void analyze(const Matrix &matrix) override { solver.analyzePattern(matrix); }

  void factorize(const Matrix &matrix) override {
    solver.factorize(matrix);
    const Vector diagonal = solver.vectorD();
    const auto &order = solver.permutationPinv().indices();
    Vector sizes = Vector::Zero(matrix.rows());
    for (int column = 0; column < matrix.outerSize(); ++column)
      for (Matrix::InnerIterator it(matrix, column); it; ++it)
        sizes[column] = std::max(sizes[column], std::abs(it.value()));
    bool stopped = solver.info() != Eigen::Success;
    for (int k = 0; k < diagonal.size(); ++k) {
      int row = order.size() ? order[k] : k;
      double pivot = diagonal[k];
      bool lost = !(std::abs(pivot) > 8 * kEpsilon * sizes[row]);
      if (definite && !lost && pivot < 0)
        throw Breakdown{"the matrix is not positive definite", row, pivot};
      if (lost)
        throw Breakdown{"the factorisation meets a pivot that is zero up to "
                        "rounding",
                        row, pivot};
    }
    if (stopped)
      throw Breakdown{"the factorisation fails", -1, 0};
  }

  Vector solve(const Vector &b) const override { return solver.solve(b); }
  Vector solveTransposed(const Vector &b) const override { return solve(b); }
  std::int64_t nonZeros() const override {
    return solver.matrixL().nestedExpression().nonZeros();
  }

private:
  Eigen::SimplicialLDLT<Matrix, Eigen::Lower, Eigen::AMDOrdering<int>> solver;
  bool definite;
};

class General : public Factor {
public:
  void analyze(const Matrix &matrix) override { solver.analyzePattern(matrix); }

  void factorize(const Matrix &matrix) override {
    solver.factorize(matrix);
    if (solver.info() == Eigen::Success)
      return;
    // Eigen tells the column only in its message, in the order of the factor.
    std::string text = solver.lastErrorMessage();
    std::size_t at = text.find_last_not_of("0123456789");
    std::int64_t column = -1;
    if (text.find("COLUMN AT") != std::string::npos && at + 1 < text.size()) {
      int number = std::stoi(text.substr(at + 1)) - 1;
      const auto &order = solver.colsPermutation().indices();
      for (int k = 0; k < order.size(); ++k)
        if (order[k] == number)
          column = k;
    }
    throw Breakdown{"the matrix is singular: its column depends on others",
                    column, 0};
  }

  Vector solve(const Vector &b) const override { return solver.solve(b); }
  Vector solveTransposed(const Vector &b) const override {
    return const_cast<Solver &>(solver).transpose().solve(b);
  }
  std::int64_t nonZeros() const override {
    return solver.nnzL() + solver.nnzU();
  }

private:
  using Solver = Eigen::SparseLU<Matrix, Eigen::COLAMDOrdering<int>>;
  Solver solver;
};

class LeastSquares : public Factor {
public:
  void analyze(const Matrix &matrix) override { solver.analyzePattern(matrix); }

  /// Factors the matrix with columns of norm one, so that the rank does not
  /// depend on units.
  void factorize(const Matrix &matrix) override {
    scale = Vector::Ones(matrix.cols());
    for (int column = 0; column < matrix.outerSize(); ++column)
      if (double norm = matrix.col(column).norm())
        scale[column] = 1 / norm;
    Matrix scaled = matrix * scale.asDiagonal();
    solver.setPivotThreshold(kEpsilon * double(matrix.rows()));
    solver.factorize(scaled);
    if (solver.info() != Eigen::Success)
      throw Breakdown{"the factorisation fails: " + solver.lastErrorMessage(),
                      -1, 0};
    if (solver.rank() < matrix.cols()) {
      int column = solver.colsPermutation().indices()[solver.rank()];
      throw Breakdown{"the matrix has rank " + std::to_string(solver.rank()) +
                          " and " + std::to_string(matrix.cols()) + " columns",
                      column, 0};
    }
    upper = solver.matrixR().topRows(matrix.cols());
  }

  Vector solve(const Vector &b) const override {
    return scale.cwiseProduct(Vector(solver.solve(b)));
  }

  /// For a square matrix only: A^T y = b from A D P = Q R.
  Vector solveTransposed(const Vector &b) const override {
    return solver.matrixQ() * lowerSolve(b);
  }

  Vector solveNormal(const Vector &b) const override {
    Vector y = upper.triangularView<Eigen::Upper>().solve(lowerSolve(b));
    return scale.cwiseProduct(Vector(solver.colsPermutation() * y));
  }

  std::int64_t nonZeros() const override { return upper.nonZeros(); }

private:
  Vector lowerSolve(const Vector &b) const {
    Vector scaled = scale.cwiseProduct(b);
    return upper.transpose().triangularView<Eigen::Lower>().solve(
        Vector(solver.colsPermutation().inverse() * scaled));
  }

  Eigen::SparseQR<Matrix, Eigen::COLAMDOrdering<int>> solver;
  Matrix upper;
  Vector scale;
};

/// A matrix, its factors and the outcome of the last factorisation.
struct Handle {
  std::unique_ptr<Factor> factor;
  Matrix matrix;
  bool symmetric = false;
  bool analyzed = false;
  double condition = 0;
  std::int64_t index = -1;
  double pivot = 0;
  std::string error;
};

double normOf(const Matrix &matrix) {
  double norm = 0;
  for (int column = 0; column < matrix.outerSize(); ++column) {
    double sum = 0;
    for (Matrix::InnerIterator it(matrix, column); it; ++it)
      sum += std::abs(it.value());
    norm = std::max(norm, sum);
  }
  return norm;
}

/// A lower bound of the inverse's one-norm, seldom far below it.
double inverseNorm(const Factor &factor, Eigen::Index n) {
  Vector x = Vector::Constant(n, 1.0 / double(n));
  double estimate = 0;
  for (int turn = 0; turn < 5; ++turn) {
    Vector y = factor.solve(x);
    double norm = y.lpNorm<1>();
    if (!(norm > estimate))
      return std::isfinite(norm) ? estimate
                                 : std::numeric_limits<double>::infinity();
    estimate = norm;
    Vector sign = y.unaryExpr([](double v) { return v < 0 ? -1.0 : 1.0; });
    Vector z = factor.solveTransposed(sign);
    Eigen::Index most;
    if (z.cwiseAbs().maxCoeff(&most) <= z.dot(x))
      break;
    x = Vector::Unit(n, most);
  }
  // Alternating signs find what cancels for the others.
  Vector other(n);
  for (Eigen::Index i = 0; i < n; ++i)
    other[i] = (i % 2 ? -1 : 1) *
               (1 + double(i) / double(std::max<Eigen::Index>(n - 1, 1)));
  return std::max(estimate,
                  2 * factor.solve(other).lpNorm<1>() / (3 * double(n)));
}

Vector solved(const Handle &handle, int mode, const Vector &b) {
  const Factor &factor = *handle.factor;
  if (mode == 2)
    return factor.solveNormal(b);
  Vector x = mode ? factor.solveTransposed(b) : factor.solve(b);
  if (handle.matrix.rows() != handle.matrix.cols())
    return x;
  // A step of refinement makes the backward error small for any pivots.
  Vector rest = mode ? Vector(b - handle.matrix.transpose() * x)
                     : Vector(b - handle.matrix * x);
  Vector step = mode ? factor.solveTransposed(rest) : factor.solve(rest);
  return x + step;
}

void check(Handle &handle) {
  const Matrix &matrix = handle.matrix;
  double norm = normOf(matrix);
  if (matrix.rows() != matrix.cols())
    return;
  handle.condition = norm * inverseNorm(*handle.factor, matrix.cols());
  if (!(handle.condition < 1 / kEpsilon))
    throw Breakdown{"the matrix is singular in double precision: its condition "
                    "number is about " +
                        std::to_string(handle.condition),
                    -1, 0};
  Vector x(matrix.cols());
  for (Eigen::Index i = 0; i < x.size(); ++i)
    x[i] = std::sin(1.0 + 12.9898 * double(i));
  Vector b = matrix * x;
  Vector found = solved(handle, 0, b);
  double left = (b - matrix * found).lpNorm<Eigen::Infinity>();
  double size =
      norm * found.lpNorm<Eigen::Infinity>() + b.lpNorm<Eigen::Infinity>();
  if (!(left <= 1e-10 * size))
    throw Breakdown{"the factors have lost the matrix to rounding", -1, 0};
}

void factorize(Handle &handle) {
  handle.error.clear();
  handle.index = -1;
  handle.condition = 0;
  try {
    if (!handle.analyzed)
      handle.factor->analyze(handle.matrix);
    handle.analyzed = true;
    handle.factor->factorize(handle.matrix);
    check(handle);
  } catch (const Breakdown &breakdown) {
    handle.error = breakdown.message;
    handle.index = breakdown.index;
    handle.pivot = breakdown.pivot;
  } catch (const std::exception &problem) {
    handle.error = problem.what();
  }
}

} // namespace

#define WARP_C_API extern "C" __attribute__((visibility("default")))

/// Takes a matrix in compressed rows; kinds are 0 LDLT, 1 Cholesky, 2 LU,
/// 3 QR. Gives null without memory.
WARP_C_API void *warp_direct_new(int kind, std::int64_t rows,
                                 std::int64_t columns, std::int64_t count,
                                 const int *offsets, const int *inner,
                                 const double *values) {
  try {
    auto handle = std::make_unique<Handle>();
    if (kind < 2)
      handle->factor = std::make_unique<Symmetric>(kind == 1);
    else if (kind == 2)
      handle->factor = std::make_unique<General>();
    else
      handle->factor = std::make_unique<LeastSquares>();
    handle->matrix =
        Eigen::Map<const Rows>(rows, columns, count, offsets, inner, values);
    handle->matrix.makeCompressed();
    factorize(*handle);
    return handle.release();
  } catch (const std::exception &) {
    return nullptr;
  }
}

/// Factors other values in the same pattern.
WARP_C_API void warp_direct_refactor(void *pointer, std::int64_t count,
                                     const int *offsets, const int *inner,
                                     const double *values) {
  auto &handle = *static_cast<Handle *>(pointer);
  try {
    handle.matrix =
        Eigen::Map<const Rows>(handle.matrix.rows(), handle.matrix.cols(),
                               count, offsets, inner, values);
    factorize(handle);
  } catch (const std::exception &problem) {
    handle.error = problem.what();
  }
}

/// Solves for columns of `count` numbers each, one after the other; modes are
/// 0 A x = b, 1 A^T x = b, 2 A^T A x = b. Gives 0, or 1 without memory.
WARP_C_API int warp_direct_solve(void *pointer, int mode, std::int64_t columns,
                                 const double *b, double *x) {
  auto &handle = *static_cast<Handle *>(pointer);
  Eigen::Index rows = handle.matrix.rows(), width = handle.matrix.cols();
  Eigen::Index in = mode == 0 ? rows : width, out = mode == 1 ? rows : width;
  try {
    for (std::int64_t k = 0; k < columns; ++k)
      Eigen::Map<Vector>(x + k * out, out) =
          solved(handle, mode, Eigen::Map<const Vector>(b + k * in, in));
    return 0;
  } catch (const std::exception &) {
    return 1;
  }
}

/// The reason of the last refusal, empty for none.
WARP_C_API const char *warp_direct_error(void *pointer) {
  return static_cast<Handle *>(pointer)->error.c_str();
}

/// Row or column of the breakdown, its pivot, the estimated condition number,
/// and the number of entries of the factors.
WARP_C_API void warp_direct_info(void *pointer, std::int64_t *index,
                                 double *pivot, double *condition,
                                 std::int64_t *count) {
  auto &handle = *static_cast<Handle *>(pointer);
  *index = handle.index;
  *pivot = handle.pivot;
  *condition = handle.condition;
  *count = handle.error.empty() ? handle.factor->nonZeros() : 0;
}

WARP_C_API void warp_direct_free(void *pointer) {
  delete static_cast<Handle *>(pointer);
}
