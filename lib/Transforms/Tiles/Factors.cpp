//===- Factors.cpp - Models of Cholesky factors and triangular solves ---===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// On a CPU, where a block is one thread, and for matrices of f32 that warps of
// a GPU can have in registers, the device library has functions for whole tiles
// (lib/DeviceLib/{cpu,gpu}/TileFactors.cpp, gpu/TileSubstitutions.cpp). Other
// blocks share loops over elements.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Scratch memory and functions of the device library
//===----------------------------------------------------------------------===//

/// Bytes of a square matrix in rows, and columns, of whole vectors of a CPU.
static int64_t getRowsBytes(TileType matrix) {
  constexpr int64_t vector = 64;
  int64_t row = llvm::alignTo(
      matrix.getShape()[0] * getByteSize(matrix.getElementType()), vector);
  return row * row / getByteSize(matrix.getElementType());
}

/// Of a matrix that is copied first if the function cannot read it.
static int64_t getCopyBytes(Value matrix) {
  return getStrided(matrix) ? 0 : getTileBytes(tileType(matrix));
}

/// Rows of a matrix that lanes of one warp have, four each.
constexpr int64_t mostRows = 128;

static bool fitsWarp(Value matrix) {
  return tileType(matrix).getElementType().isF32() &&
         tileType(matrix).getShape()[0] <= mostRows && getStrided(matrix);
}

/// By panels of 8 or 16 columns. A thread has a row of the panel, or columns of
/// both matrices, in registers.
static TileFunction getPanelFunction(Value matrix, int64_t registers) {
  if (!fitsWarp(matrix))
    return {};
  int64_t n = tileType(matrix).getShape()[0];
  constexpr int64_t fewest = 72;
  TileFunction function;
  function.variant = n <= 8 ? 8 : 16;
  function.matrix = 0;
  function.rows = n;
  function.registers = n > 16 ? registers : fewest;
  return function;
}

static int64_t getPanelBytes(Operation *op) {
  return 4 * getDeviceVariant(op) * (getDeviceVariant(op) + 1);
}

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

namespace {

struct FactorLowering : TileLowering {
  using TileLowering::TileLowering;
  void factor(TileCholeskyOp op);
  void factorByWarps(TileCholeskyOp op);
  void check(TileCholeskyOp op);
  void adjoint(TileCholeskyAdjointOp op);
  void adjointByWarps(TileCholeskyAdjointOp op);
  void solve(TileSolveOp op);
  void solveByWarps(TileSolveOp op);

private:
  Strided matrixFor(Operation *op, Value tile, int64_t behind);
  void callFactor(TileCholeskyOp op);
  void callAdjoint(TileCholeskyAdjointOp op);
  void callSolve(TileSolveOp op);
};

} // namespace

/// A square matrix where it lies, with its steps, or a copy `behind` bytes into
/// the scratch memory of an operation.
Strided FactorLowering::matrixFor(Operation *op, Value tile, int64_t behind) {
  if (std::optional<Strided> found = getStrided(tile))
    return {memoryOf(found->memory), found->steps};
  TileType type = tileType(tile);
  Value copy = copyTo(scratchOf(op) + behind, tile, type.getElementType(),
                      /*transposed=*/false);
  return {copy, {type.getShape()[0], 1}};
}

void FactorLowering::callFactor(TileCholeskyOp op) {
  TileType type = tileType(op.getTile());
  Value result = op.getResult(), from = op.getTile();
  if (getStrided(from) && getStrided(from)->memory == from) {
    from = memoryOf(from);
  } else {
    share(type.getShape(),
          [&](ValueRange ij) { store(result, ij, element(op.getTile(), ij)); });
    from = memoryOf(result);
  }
  Value scratch =
      arrayAt(scratchOf(op), type.getNumElements(), type.getElementType());
  callLibrary("warp_tile_cholesky", type.getElementType(),
              {addressOf(memoryOf(result)), addressOf(from), addressOf(scratch),
               number(type.getShape()[0]), number(op.getUpper())});
}

/// Left-looking: column j from those before it. Every thread computes the
/// diagonal; the rest of a column is shared.
void FactorLowering::factor(TileCholeskyOp op) {
  if (callsForTiles(kernel, threads))
    return callFactor(op);
  TileType type = tileType(op.getTile());
  int64_t n = type.getShape()[0];
  Type real = type.getElementType();
  Value result = op.getResult();
  bool upper = op.getUpper();
  auto at = [&](Value i, Value j) {
    return upper ? Values{j, i} : Values{i, j};
  };
  auto rest = [&](Value i, Value j) {
    Value first = element(op.getTile(), at(i, j));
    return loop(number(0), j, number(1), first,
                [&](Value k, ValueRange sums) -> Values {
                  Value product = builtin(
                      "mul", {load(result, at(i, k)), load(result, at(j, k))});
                  return {builtin("sub", {sums[0], product})};
                })[0];
  };
  loop(n, [&](Value j) {
    Value square = rest(j, j);
    // The root of what is not positive is NaN, and so is what follows.
    Value isPositive = builtin("gt", {square, constant(real, 0)});
    Value none = constant(real, std::numeric_limits<double>::quiet_NaN());
    Value diagonal =
        builtin("sqrt", builtin("where", {isPositive, square, none}));
    // In place, all have to have read it.
    barrier();
    byFirstThread([&] { store(result, at(j, j), diagonal); });
    Value begin = add(j, number(1));
    if (threads > 1)
      begin = add(begin, thread);
    loop(begin, number(n), number(threads), {}, [&](Value i, ValueRange) {
      store(result, at(i, j), builtin("div", {rest(i, j), diagonal}));
      store(result, at(j, i), constant(real, 0));
      return Values();
    });
    barrier();
  });
}

void FactorLowering::factorByWarps(TileCholeskyOp op) {
  Strided to = *getStrided(op.getResult()), from = *getStrided(op.getTile());
  if (op.getUpper()) {
    std::swap(to.steps[0], to.steps[1]);
    std::swap(from.steps[0], from.steps[1]);
  }
  int64_t n = tileType(op.getTile()).getShape()[0];
  Value scratch = arrayAt(scratchOf(op), getPanelBytes(op) / 4, b.getF32Type());
  callVariant("factor", op,
              {addressOf(memoryOf(op.getResult())), number(to.steps[0]),
               number(to.steps[1]), addressOf(memoryOf(from.memory)),
               number(from.steps[0]), number(from.steps[1]), addressOf(scratch),
               number(n)});
}

/// What follows a pivot that is not positive is NaN, the last one in any case.
void FactorLowering::check(TileCholeskyOp op) {
  Value last = number(tileType(op.getResult()).getShape()[0] - 1);
  Value pivot = load(op.getResult(), {last, last});
  AssertOp::create(b, loc, builtin("eq", {pivot, pivot}),
                   "tile_cholesky() of a matrix that is not positive definite");
}

void FactorLowering::callAdjoint(TileCholeskyAdjointOp op) {
  TileType type = tileType(op.getFactor());
  int64_t n = type.getShape()[0];
  auto [memory, steps] = matrixFor(op, op.getFactor(), 2 * getRowsBytes(type));
  Value scratch =
      arrayAt(scratchOf(op),
              2 * getRowsBytes(type) / getByteSize(type.getElementType()),
              type.getElementType());
  callLibrary("warp_tile_cholesky_adjoint", type.getElementType(),
              {addressOf(memoryOf(op.getResult())), addressOf(memory),
               addressOf(scratch), number(steps[0]), number(steps[1]),
               number(n), number(op.getUpper())});
}

/// In place of the cotangent, columns from the last to the first: what a column
/// of the factor was computed from gets its part. Iain Murray, Differentiation
/// of the Cholesky decomposition, 2016.
void FactorLowering::adjoint(TileCholeskyAdjointOp op) {
  begin(op, op.getCotangent());
  if (callsForTiles(kernel, threads))
    return callAdjoint(op);
  TileType type = tileType(op.getFactor());
  int64_t n = type.getShape()[0];
  Type real = type.getElementType();
  Value bar = op.getResult();
  bool upper = op.getUpper();
  auto at = [&](Value i, Value j) {
    return upper ? Values{j, i} : Values{i, j};
  };
  auto factor = [&](Value i, Value j) {
    return element(op.getFactor(), at(i, j));
  };
  loop(n, [&](Value step) {
    Value j = sub(number(n - 1), step), below = add(j, number(1));
    Value over = builtin("div", {constant(real, 1), factor(j, j)});
    // What column k has in common with column j.
    auto common = [&](Value k) {
      return loop(below, number(n), number(1), constant(real, 0),
                  [&](Value i, ValueRange sums) -> Values {
                    Value product =
                        builtin("mul", {load(bar, at(i, j)), factor(i, k)});
                    return {builtin("add", {sums[0], product})};
                  })[0];
    };
    Value rest = builtin("mul", {common(j), over});
    Value diagonal =
        builtin("mul", {builtin("sub", {load(bar, at(j, j)), rest}), over});
    Value first = thread ? thread : number(0);
    loop(first, j, number(threads), {}, [&](Value k, ValueRange) {
      Value own = factor(j, k), ratio = builtin("mul", {own, over});
      Value change = builtin("add", {builtin("mul", {common(k), over}),
                                     builtin("mul", {diagonal, own})});
      auto subtract = [&](Value i, Value part) {
        store(bar, at(i, k), builtin("sub", {load(bar, at(i, k)), part}));
      };
      subtract(j, change);
      loop(below, number(n), number(1), {}, [&](Value i, ValueRange) {
        subtract(i, builtin("mul", {load(bar, at(i, j)), ratio}));
        return Values();
      });
      store(bar, at(k, j), constant(real, 0));
      return Values();
    });
    // All have read the column.
    barrier();
    byFirstThread([&] {
      Value half = builtin("mul", {diagonal, constant(real, 0.5)});
      store(bar, at(j, j), half);
    });
    loop(add(below, first), number(n), number(threads), {},
         [&](Value i, ValueRange) {
           store(bar, at(i, j), builtin("mul", {load(bar, at(i, j)), over}));
           return Values();
         });
  });
}

void FactorLowering::adjointByWarps(TileCholeskyAdjointOp op) {
  begin(op, op.getCotangent());
  Strided to = *getStrided(op.getResult()), from = *getStrided(op.getFactor());
  if (op.getUpper()) {
    std::swap(to.steps[0], to.steps[1]);
    std::swap(from.steps[0], from.steps[1]);
  }
  Value scratch = arrayAt(scratchOf(op), getPanelBytes(op) / 4, b.getF32Type());
  callVariant("differentiate_factor", op,
              {addressOf(memoryOf(op.getResult())), number(to.steps[0]),
               number(to.steps[1]), addressOf(memoryOf(from.memory)),
               number(from.steps[0]), number(from.steps[1]), addressOf(scratch),
               number(tileType(op.getFactor()).getShape()[0])});
}

void FactorLowering::callSolve(TileSolveOp op) {
  TileType rhs = tileType(op.getRhs()), type = tileType(op.getMatrix());
  int64_t n = rhs.getShape()[0];
  auto [memory, steps] = matrixFor(op, op.getMatrix(), 0);
  if (op.getTransposed())
    std::swap(steps[0], steps[1]);
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  callLibrary("warp_tile_solve", type.getElementType(),
              {addressOf(memoryOf(op.getResult())), addressOf(memory),
               number(n), number(rhs.getNumElements() / n), number(steps[0]),
               number(steps[1]), number(backwards)});
}

/// A row of the solution at a time, which is then subtracted from the others.
void FactorLowering::solve(TileSolveOp op) {
  begin(op, op.getRhs());
  if (callsForTiles(kernel, threads))
    return callSolve(op);
  TileType rhs = tileType(op.getRhs());
  int64_t n = rhs.getShape()[0];
  int64_t columns = rhs.getRank() == 2 ? rhs.getShape()[1] : 1;
  Value result = op.getResult();
  auto coefficient = [&](Value i, Value j) {
    return element(op.getMatrix(),
                   op.getTransposed() ? Values{j, i} : Values{i, j});
  };
  auto at = [&](Value i, Value c) {
    return rhs.getRank() == 2 ? Values{i, c} : Values{i};
  };
  // Backwards if the matrix that is solved with is upper.
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  auto row = [&](Value i) { return backwards ? sub(number(n - 1), i) : i; };
  loop(n, [&](Value step) {
    Value j = row(step);
    Value diagonal = coefficient(j, j);
    share(ArrayRef<int64_t>(columns), [&](ValueRange c) {
      Value x = builtin("div", {load(result, at(j, c[0])), diagonal});
      store(result, at(j, c[0]), x);
    });
    barrier();
    auto update = [&](Value i, Value c) {
      Value x = load(result, at(j, c)), old = load(result, at(i, c));
      Value product = builtin("mul", {coefficient(i, j), x});
      store(result, at(i, c), builtin("sub", {old, product}));
    };
    // Rows that are left, each with all columns.
    Value begin = mul(add(step, number(1)), number(columns));
    if (threads > 1)
      begin = add(begin, thread);
    loop(begin, number(n * columns), number(threads), {},
         [&](Value e, ValueRange) {
           Values place = unravel(e, {n, columns});
           update(row(place[0]), place[1]);
           return Values();
         });
    barrier();
  });
}

void FactorLowering::solveByWarps(TileSolveOp op) {
  begin(op, op.getRhs());
  Strided matrix = *getStrided(op.getMatrix());
  if (op.getTransposed())
    std::swap(matrix.steps[0], matrix.steps[1]);
  TileType rhs = tileType(op.getRhs());
  int64_t n = rhs.getShape()[0];
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  callVariant("substitute", op,
              {addressOf(memoryOf(op.getResult())),
               addressOf(memoryOf(matrix.memory)), number(matrix.steps[0]),
               number(matrix.steps[1]), number(n),
               number(rhs.getNumElements() / n), number(backwards)});
}

//===----------------------------------------------------------------------===//
// Adjoints
//===----------------------------------------------------------------------===//

namespace {

struct FactorAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult factor(TileCholeskyOp factor);
  LogicalResult solve(TileSolveOp solve);

private:
  Value outer(Value x, Value y);
  Value solveWith(Value matrix, Value rhs, bool upper, bool transposed);
  /// What `function` makes of the elements of a triangle; the others are zero.
  Value triangle(Value tile, bool upper,
                 llvm::function_ref<Value(Value)> function);
  void solveSystem(TileCholeskyOp factor, TileSolveOp first, TileSolveOp second,
                   Value g);
};

} // namespace

/// The product with the transpose of the other; of columns elementwise, so that
/// it is computed where it is used.
Value FactorAdjoint::outer(Value x, Value y) {
  int64_t rows = typeOf(x).getShape()[0], columns = typeOf(y).getShape()[0];
  if (typeOf(x).getShape()[1] != 1)
    return multiply(x, y, false, true);
  Value row = reshape(y, {1, columns});
  return map({broadcast(x, {rows, columns}), broadcast(row, {rows, columns})},
             [&](ValueRange e) { return apply("mul", e); });
}

Value FactorAdjoint::solveWith(Value matrix, Value rhs, bool upper,
                               bool transposed) {
  return TileSolveOp::create(b, loc, rhs.getType(), matrix, rhs, unit(upper),
                             unit(transposed));
}

Value FactorAdjoint::triangle(Value tile, bool upper,
                              llvm::function_ref<Value(Value)> function) {
  ArrayRef<int64_t> shape = typeOf(tile).getShape();
  return map({tile, numbers(shape, 0), numbers(shape, 1)}, [&](ValueRange x) {
    Value made = function(x[0]);
    Value inside = apply(upper ? "le" : "ge", {x[1], x[2]});
    return apply("where", {inside, made, zeroOf(made.getType())});
  });
}

LogicalResult FactorAdjoint::factor(TileCholeskyOp factor) {
  Value g = take();
  if (!g)
    return success();
  give(factor.getTile(),
       TileCholeskyAdjointOp::create(b, loc, g.getType(),
                                     reverse.recover(factor.getResult()), g,
                                     factor.getUpperAttr()));
  return success();
}

/// The factor A = L L^T and the first solve, if this is the second one of
/// A x = b and all that the first one is for.
static TileCholeskyOp findSystem(TileSolveOp op, TileSolveOp &first) {
  auto factor = op.getMatrix().getDefiningOp<TileCholeskyOp>();
  first = op.getRhs().getDefiningOp<TileSolveOp>();
  bool upper = op.getUpper();
  // A = U^T U is solved with the transpose first.
  if (!factor || !first || factor->getBlock() != op->getBlock() ||
      first->getBlock() != op->getBlock() || !first->hasOneUse() ||
      first.getMatrix() != op.getMatrix() || factor.getUpper() != upper ||
      first.getUpper() != upper || op.getTransposed() == upper ||
      first.getTransposed() != upper)
    return nullptr;
  return factor;
}

/// Of x = A^-1 b, whatever the factor: b' = A^-1 x', and A' = - b' x^T, of
/// which the triangle that is read gets the other one's part, too.
void FactorAdjoint::solveSystem(TileCholeskyOp factor, TileSolveOp first,
                                TileSolveOp second, Value g) {
  bool upper = factor.getUpper();
  Value matrix = reverse.recover(factor.getResult());
  Value rhs = solveWith(matrix, g, upper, upper);
  rhs = solveWith(matrix, rhs, upper, !upper);
  give(first.getRhs(), rhs);
  TileType type = typeOf(rhs);
  int64_t n = type.getShape()[0];
  int64_t columns = type.getRank() == 2 ? type.getShape()[1] : 1;
  Value bars = reshape(rhs, {n, columns});
  Value xs = reshape(reverse.recover(second.getResult()), {n, columns});
  Value product = outer(bars, xs);
  Value other = columns == 1 ? outer(xs, bars) : transpose(product);
  ArrayRef<int64_t> shape = typeOf(product).getShape();
  Value both = map({product, other, numbers(shape, 0), numbers(shape, 1)},
                   [&](ValueRange x) {
                     Value sum = apply("add", {x[0], x[1]});
                     Value isOnDiagonal = apply("eq", {x[2], x[3]});
                     return apply("where", {isOnDiagonal, x[0], sum});
                   });
  give(factor.getTile(),
       triangle(both, upper, [&](Value x) { return apply("neg", x); }));
}

LogicalResult FactorAdjoint::solve(TileSolveOp op) {
  Value g = take();
  if (!g)
    return success();
  TileSolveOp first;
  if (TileCholeskyOp factor = findSystem(op, first);
      factor && wants(factor.getTile())) {
    solveSystem(factor, first, op, g);
    return success();
  }
  bool upper = op.getUpper(), transposed = op.getTransposed();
  Value matrix = reverse.recover(op.getMatrix());
  Value rhs = solveWith(matrix, g, upper, !transposed);
  give(op.getRhs(), rhs);
  if (!wants(op.getMatrix()))
    return success();
  Value x = reverse.recover(op.getResult());
  TileType type = typeOf(rhs);
  int64_t n = type.getShape()[0];
  int64_t columns = type.getRank() == 2 ? type.getShape()[1] : 1;
  Value bars = reshape(rhs, {n, columns}), xs = reshape(x, {n, columns});
  Value product = transposed ? outer(xs, bars) : outer(bars, xs);
  give(op.getMatrix(),
       triangle(product, upper, [&](Value x) { return apply("neg", x); }));
  return success();
}

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

struct CholeskyModel : TileModel<CholeskyModel, TileCholeskyOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {0};
  }
  TileFunction getDeviceFunction(Operation *op, int64_t) const {
    TileFunction function =
        getPanelFunction(cast<TileCholeskyOp>(op).getTile(), 96);
    function.givesMatrix = function.variant != 0;
    return function;
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    if (op->hasAttr(attr::form))
      return getPanelBytes(op);
    Value matrix = cast<TileCholeskyOp>(op).getTile();
    return callsForTiles(op, threads) ? getRowsBytes(tileType(matrix)) : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto factor = cast<TileCholeskyOp>(op);
    FactorLowering own(lowering.state);
    op->hasAttr(attr::form) ? own.factorByWarps(factor) : own.factor(factor);
    if (lowering.state.debug)
      own.check(factor);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return FactorAdjoint(reverse.reverse, op).factor(cast<TileCholeskyOp>(op));
  }
};

struct CholeskyAdjointModel
    : TileModel<CholeskyAdjointModel, TileCholeskyAdjointOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  TileFunction getDeviceFunction(Operation *op, int64_t) const {
    return getPanelFunction(cast<TileCholeskyAdjointOp>(op).getFactor(), 128);
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    if (op->hasAttr(attr::form))
      return getPanelBytes(op);
    Value factor = cast<TileCholeskyAdjointOp>(op).getFactor();
    return callsForTiles(op, threads)
               ? 2 * getRowsBytes(tileType(factor)) + getCopyBytes(factor)
               : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto adjoint = cast<TileCholeskyAdjointOp>(op);
    FactorLowering own(lowering.state);
    op->hasAttr(attr::form) ? own.adjointByWarps(adjoint)
                            : own.adjoint(adjoint);
  }
  LogicalResult adjoint(Operation *, autodiff::TileReverse &reverse) const {
    return reverse.refuse();
  }
};

struct SolveModel : TileModel<SolveModel, TileSolveOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  /// By rows of a lane.
  TileFunction getDeviceFunction(Operation *op, int64_t) const {
    auto solve = cast<TileSolveOp>(op);
    int64_t n = tileType(solve.getRhs()).getShape()[0];
    TileFunction function;
    if (!fitsWarp(solve.getMatrix()))
      return function;
    function.variant = n <= 32 ? 1 : n <= 64 ? 2 : 4;
    function.matrix = 0;
    return function;
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    bool calls = !op->hasAttr(attr::form) && callsForTiles(op, threads);
    return calls ? getCopyBytes(cast<TileSolveOp>(op).getMatrix()) : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto solve = cast<TileSolveOp>(op);
    FactorLowering own(lowering.state);
    op->hasAttr(attr::form) ? own.solveByWarps(solve) : own.solve(solve);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return FactorAdjoint(reverse.reverse, op).solve(cast<TileSolveOp>(op));
  }
};

} // namespace

void attachFactors(MLIRContext &context) {
  TileCholeskyOp::attachInterface<CholeskyModel>(context);
  TileCholeskyAdjointOp::attachInterface<CholeskyAdjointModel>(context);
  TileSolveOp::attachInterface<SolveModel>(context);
}

} // namespace warp::tiles
