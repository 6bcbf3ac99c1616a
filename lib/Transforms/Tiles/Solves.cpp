//===- Solves.cpp - Model of triangular solves ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions of the device library, as those of factors (Factors.cpp).
//
//===----------------------------------------------------------------------===//

#include "Matrices.h"
#include "Models.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

/// Rows that a thread has of each of its right sides at a time; smaller
/// variants are how many rows a lane has.
constexpr int64_t fewestPanelRows = 8;

namespace {

struct SolveLowering : TileLowering {
  using TileLowering::TileLowering;
  void byBlock(TileSolveOp op);
  void byWarps(TileSolveOp op);
  void byOne(TileSolveOp op);

private:
  Values argumentsOf(TileSolveOp op);
};

} // namespace

Values SolveLowering::argumentsOf(TileSolveOp op) {
  Strided matrix = matrixFor(op, op.getMatrix(), 0);
  if (op.getTransposed())
    std::swap(matrix.steps[0], matrix.steps[1]);
  TileType rhs = tileType(op.getRhs());
  int64_t n = rhs.getShape()[0];
  bool backwards = bool(op.getUpper()) != bool(op.getTransposed());
  return {addressOf(memoryOf(op.getResult())),
          addressOf(matrix.memory),
          number(matrix.steps[0]),
          number(matrix.steps[1]),
          number(n),
          number(rhs.getNumElements() / n),
          number(backwards)};
}

void SolveLowering::byOne(TileSolveOp op) {
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

void SolveLowering::byBlock(TileSolveOp op) {
  Values arguments = argumentsOf(op);
  arguments.push_back(number(threads));
  callLibrary("warp_tile_block_solve",
              tileType(op.getMatrix()).getElementType(), arguments);
}

void SolveLowering::byWarps(TileSolveOp op) {
  StringRef verb =
      getDeviceVariant(op) < fewestPanelRows ? "substitute_" : "solve_columns_";
  callVariant((verb + realName(op.getMatrix())).str(), op, argumentsOf(op));
}

//===----------------------------------------------------------------------===//
// Adjoint
//===----------------------------------------------------------------------===//

namespace {

struct SolveAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult solve(TileSolveOp solve);

private:
  Value outer(Value x, Value y);
  Value solveWith(Value matrix, Value rhs, bool upper, bool transposed);
  /// Applies `function` to the elements of a triangle; the others are zero.
  Value triangle(Value tile, bool upper,
                 llvm::function_ref<Value(Value)> function);
  void solveSystem(TileCholeskyOp factor, TileSolveOp first, TileSolveOp second,
                   Value g);
};

} // namespace

/// The product with the transpose of the other; of columns elementwise, so that
/// it is computed where it is used.
Value SolveAdjoint::outer(Value x, Value y) {
  int64_t rows = typeOf(x).getShape()[0], columns = typeOf(y).getShape()[0];
  if (typeOf(x).getShape()[1] != 1)
    return multiply(x, y, false, true);
  Value row = reshape(y, {1, columns});
  return map({broadcast(x, {rows, columns}), broadcast(row, {rows, columns})},
             [&](ValueRange e) { return apply("mul", e); });
}

Value SolveAdjoint::solveWith(Value matrix, Value rhs, bool upper,
                              bool transposed) {
  return TileSolveOp::create(b, loc, rhs.getType(), matrix, rhs, unit(upper),
                             unit(transposed));
}

Value SolveAdjoint::triangle(Value tile, bool upper,
                             llvm::function_ref<Value(Value)> function) {
  ArrayRef<int64_t> shape = typeOf(tile).getShape();
  return map({tile, numbers(shape, 0), numbers(shape, 1)}, [&](ValueRange x) {
    Value made = function(x[0]);
    Value inside = apply(upper ? "le" : "ge", {x[1], x[2]});
    return apply("where", {inside, made, zeroOf(made.getType())});
  });
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

/// For x = A^-1 b, with any factor: b' = A^-1 x', and A' = - b' x^T, of
/// which the triangle that is read gets the other one's part, too.
void SolveAdjoint::solveSystem(TileCholeskyOp factor, TileSolveOp first,
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

LogicalResult SolveAdjoint::solve(TileSolveOp op) {
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
// Model
//===----------------------------------------------------------------------===//

namespace {

struct SolveModel : TileModel<SolveModel, TileSolveOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  /// By right sides of a thread where there are more of them than warps, else
  /// by rows of a lane.
  TileFunction getDeviceFunction(Operation *op, int64_t threads) const {
    auto solve = cast<TileSolveOp>(op);
    TileType rhs = tileType(solve.getRhs());
    int64_t n = rhs.getShape()[0], warps = threads / 32;
    TileFunction function;
    if (rhs.getNumElements() / n > warps && getStrided(solve.getMatrix())) {
      function.variant = n <= fewestPanelRows ? fewestPanelRows : 16;
      function.registers = 128;
    } else if (fitsWarp(solve.getMatrix())) {
      function.variant = n <= 32 ? 1 : n <= 64 ? 2 : 4;
    } else {
      return function;
    }
    function.matrix = 0;
    return function;
  }
  int64_t getScratchBytes(Operation *op, int64_t) const {
    return op->hasAttr(warp::attr::function)
               ? 0
               : getCopyBytes(cast<TileSolveOp>(op).getMatrix());
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto solve = cast<TileSolveOp>(op);
    SolveLowering own(lowering.state);
    own.begin(op, solve.getRhs());
    if (op->hasAttr(warp::attr::function))
      own.byWarps(solve);
    else if (callsForTiles(op, lowering.threads))
      own.byOne(solve);
    else
      own.byBlock(solve);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return SolveAdjoint(reverse.reverse, op).solve(cast<TileSolveOp>(op));
  }
};

} // namespace

void attachSolves(MLIRContext &context) {
  TileSolveOp::attachInterface<SolveModel>(context);
}

} // namespace warp::tiles
