//===- Factors.cpp - Models of Cholesky factors and their adjoints --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions of the device library: one body for blocks of any number of
// threads, and faster ones for a CPU, where a block is one thread, and for
// matrices that warps of a GPU can have in registers.
//
//===----------------------------------------------------------------------===//

#include "Matrices.h"
#include "Models.h"

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

/// By panels of 8 or 16 columns. A thread has a row of the panel, or columns of
/// both matrices, in registers.
static TileFunction getPanelFunction(Value matrix, int64_t registers) {
  if (!fitsWarp(matrix))
    return {};
  int64_t n = tileType(matrix).getShape()[0];
  int64_t words = getByteSize(tileType(matrix).getElementType()) / 4;
  constexpr int64_t fewest = 72, most = 128;
  TileFunction function;
  function.variant = n <= 8 ? 8 : 16;
  function.matrix = 0;
  function.rows = n;
  function.registers =
      std::min(n > 16 ? registers * words : fewest * words, most);
  return function;
}

static int64_t getPanelBytes(Operation *op) {
  return getByteSize(tileType(op->getOperand(0)).getElementType()) *
         getDeviceVariant(op) * (getDeviceVariant(op) + 1);
}

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

namespace {

struct FactorLowering : TileLowering {
  using TileLowering::TileLowering;
  void factorByBlock(TileCholeskyOp op);
  void factorByWarps(TileCholeskyOp op);
  void factorByOne(TileCholeskyOp op);
  void adjointByBlock(TileCholeskyAdjointOp op);
  void adjointByWarps(TileCholeskyAdjointOp op);
  void adjointByOne(TileCholeskyAdjointOp op);
  /// Asserts in debug kernels that the matrix had a factor.
  void check(TileCholeskyOp op);

private:
  Values triangleOf(const Strided &matrix, bool isUpper);
  Values trianglesOf(Value result, const Strided &from, bool isUpper);
  Value panelOf(Operation *op);
};

} // namespace

/// Address and steps of a lower triangle: an upper one is transposed.
Values FactorLowering::triangleOf(const Strided &matrix, bool isUpper) {
  return {addressOf(matrix.memory), number(matrix.steps[isUpper]),
          number(matrix.steps[!isUpper])};
}

/// Arguments for a triangle that is made from another one.
Values FactorLowering::trianglesOf(Value result, const Strided &from,
                                   bool isUpper) {
  Strided to = *getStrided(result);
  Values arguments = triangleOf({memoryOf(to.memory), to.steps}, isUpper);
  arguments.append(triangleOf(from, isUpper));
  return arguments;
}

/// A panel of columns in scratch memory.
Value FactorLowering::panelOf(Operation *op) {
  Type element = tileType(op->getOperand(0)).getElementType();
  return addressOf(arrayAt(scratchOf(op),
                           getPanelBytes(op) / getByteSize(element), element));
}

//===----------------------------------------------------------------------===//
// By blocks: any shape (lib/DeviceLib/tiles/Factors.h)
//===----------------------------------------------------------------------===//

void FactorLowering::factorByBlock(TileCholeskyOp op) {
  TileType type = tileType(op.getTile());
  Value result = op.getResult();
  Strided from{memoryOf(result), getStrided(result)->steps};
  if (std::optional<Strided> found = getStrided(op.getTile())) {
    from = {memoryOf(found->memory), found->steps};
  } else {
    share(type.getShape(),
          [&](ValueRange ij) { store(result, ij, element(op.getTile(), ij)); });
    barrier();
  }
  Values arguments = trianglesOf(result, from, op.getUpper());
  arguments.append({number(type.getShape()[0]), number(threads)});
  callLibrary("warp_tile_block_factor", type.getElementType(), arguments);
}

void FactorLowering::adjointByBlock(TileCholeskyAdjointOp op) {
  TileType type = tileType(op.getFactor());
  Values arguments = trianglesOf(
      op.getResult(), matrixFor(op, op.getFactor(), 0), op.getUpper());
  arguments.append({number(type.getShape()[0]), number(threads)});
  callLibrary("warp_tile_block_factor_adjoint", type.getElementType(),
              arguments);
}

//===----------------------------------------------------------------------===//
// By warps, in registers (lib/DeviceLib/gpu/TileFactors.cpp and others)
//===----------------------------------------------------------------------===//

void FactorLowering::factorByWarps(TileCholeskyOp op) {
  Strided from = *getStrided(op.getTile());
  Values arguments = trianglesOf(
      op.getResult(), {memoryOf(from.memory), from.steps}, op.getUpper());
  arguments.append({panelOf(op), number(tileType(op.getTile()).getShape()[0])});
  callVariant(("factor_" + realName(op.getTile())).str(), op, arguments);
}

void FactorLowering::adjointByWarps(TileCholeskyAdjointOp op) {
  Strided from = *getStrided(op.getFactor());
  Values arguments = trianglesOf(
      op.getResult(), {memoryOf(from.memory), from.steps}, op.getUpper());
  arguments.append(
      {panelOf(op), number(tileType(op.getFactor()).getShape()[0])});
  callVariant("differentiate_factor", op, arguments);
}

//===----------------------------------------------------------------------===//
// By one thread of a CPU (lib/DeviceLib/cpu/TileFactors.cpp and others)
//===----------------------------------------------------------------------===//

void FactorLowering::factorByOne(TileCholeskyOp op) {
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

void FactorLowering::adjointByOne(TileCholeskyAdjointOp op) {
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

/// All pivots after one that is not positive are NaN.
void FactorLowering::check(TileCholeskyOp op) {
  Value last = number(tileType(op.getResult()).getShape()[0] - 1);
  Value pivot = load(op.getResult(), {last, last});
  AssertOp::create(b, loc, builtin("eq", {pivot, pivot}),
                   "tile_cholesky() of a matrix that is not positive definite");
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
    if (op->hasAttr(warp::attr::function))
      return getPanelBytes(op);
    Value matrix = cast<TileCholeskyOp>(op).getTile();
    return callsForTiles(op, threads) ? getRowsBytes(tileType(matrix)) : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto factor = cast<TileCholeskyOp>(op);
    FactorLowering own(lowering.state);
    if (op->hasAttr(warp::attr::function))
      own.factorByWarps(factor);
    else if (callsForTiles(op, lowering.threads))
      own.factorByOne(factor);
    else
      own.factorByBlock(factor);
    if (lowering.state.debug)
      own.check(factor);
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto factor = cast<TileCholeskyOp>(op);
    if (Value g = reverse.take())
      reverse.give(factor.getTile(),
                   TileCholeskyAdjointOp::create(
                       reverse.b, reverse.loc, g.getType(),
                       reverse.reverse.recover(factor.getResult()), g,
                       factor.getUpperAttr()));
    return success();
  }
};

struct CholeskyAdjointModel
    : TileModel<CholeskyAdjointModel, TileCholeskyAdjointOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  TileFunction getDeviceFunction(Operation *op, int64_t) const {
    Value factor = cast<TileCholeskyAdjointOp>(op).getFactor();
    return tileType(factor).getElementType().isF32()
               ? getPanelFunction(factor, 128)
               : TileFunction();
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    if (op->hasAttr(warp::attr::function))
      return getPanelBytes(op);
    Value factor = cast<TileCholeskyAdjointOp>(op).getFactor();
    return callsForTiles(op, threads)
               ? 2 * getRowsBytes(tileType(factor)) + getCopyBytes(factor)
               : 0;
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto adjoint = cast<TileCholeskyAdjointOp>(op);
    FactorLowering own(lowering.state);
    own.begin(op, adjoint.getCotangent());
    if (op->hasAttr(warp::attr::function))
      own.adjointByWarps(adjoint);
    else if (callsForTiles(op, lowering.threads))
      own.adjointByOne(adjoint);
    else
      own.adjointByBlock(adjoint);
  }
  LogicalResult adjoint(Operation *, autodiff::TileReverse &reverse) const {
    return reverse.refuse();
  }
};

} // namespace

void attachFactors(MLIRContext &context) {
  TileCholeskyOp::attachInterface<CholeskyModel>(context);
  TileCholeskyAdjointOp::attachInterface<CholeskyAdjointModel>(context);
}

} // namespace warp::tiles
