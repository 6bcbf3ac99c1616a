//===- SystemCalls.cpp - Factorisations followed by solves ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "SystemCalls.h"

#include "Analysis/Forms.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;
using warp::getConstantInteger;
using warp::SystemCalls;

/// Rows of a matrix: with more, a launch of few blocks would take longer for
/// lanes that are idle.
constexpr int64_t mostRows = 32;
/// Bytes of a vector that has an element of each block.
constexpr int64_t lineBytes = 64;

bool SystemCalls::append(const SystemCalls &next) {
  constexpr int64_t solves = forwards | backwards;
  bool isSame = next.real == real && next.n == n && next.in == out &&
                (next.steps & isUpper) == (steps & isUpper);
  bool isLater =
      !((steps | next.steps) & differentiates) && !(next.steps & factors) &&
      (steps & solves) < (next.steps & solves) && !(steps & backwards);
  if (!isSame || !isLater ||
      ((steps & solves) && (next.sides != sides || next.columns != columns)))
    return false;
  steps |= next.steps;
  sides = next.sides;
  columns = next.columns;
  last = next.last;
  return true;
}

int64_t SystemCalls::getScratchBytes() const {
  int64_t rows = llvm::alignTo(n, 4);
  int64_t triangle = rows * (rows + 1) / 2;
  int64_t others =
      steps & differentiates
          ? triangle
          : llvm::alignTo(rows * std::max<int64_t>(columns, 1), 16);
  int64_t vectors = triangle + rows + others;
  return lineBytes * (vectors + 16);
}

/// The offset of an address in the scratch space of the block.
static std::optional<int64_t> getPlace(Value address) {
  auto pointer = address.getDefiningOp<warp::PointerOp>();
  auto array =
      pointer ? pointer.getArray().getDefiningOp<warp::ArrayAtOp>() : nullptr;
  auto memory =
      array ? array.getAddress().getDefiningOp<warp::BlockMemoryOp>() : nullptr;
  if (!memory)
    return std::nullopt;
  return memory.getOffset();
}

static std::optional<SystemCalls> matchFactor(warp::LibraryCallOp op) {
  auto args = op.getArgs();
  auto out = getPlace(args[0]), in = getPlace(args[1]);
  auto n = getConstantInteger(args[3]), upper = getConstantInteger(args[4]);
  if (!out || !in || !n || !upper)
    return std::nullopt;
  SystemCalls calls;
  calls.out = *out;
  calls.in = *in;
  calls.n = *n;
  calls.steps = SystemCalls::factors | (*upper ? SystemCalls::isUpper : 0);
  return calls;
}

static std::optional<SystemCalls> matchSolve(warp::LibraryCallOp op) {
  auto args = op.getArgs();
  auto sides = getPlace(args[0]), in = getPlace(args[1]);
  std::optional<int64_t> numbers[5];
  for (auto [i, number] : llvm::enumerate(numbers))
    if (!(number = getConstantInteger(args[2 + i])))
      return std::nullopt;
  if (!sides || !in)
    return std::nullopt;
  int64_t n = *numbers[0], row = *numbers[2], column = *numbers[3];
  bool backwards = *numbers[4];
  // Steps of a lower matrix, or of the transpose of an upper one, in memory.
  bool inRows = row == n && column == 1, inColumns = row == 1 && column == n;
  if (!inRows && !inColumns)
    return std::nullopt;
  SystemCalls calls;
  calls.in = calls.out = *in;
  calls.sides = *sides;
  calls.n = n;
  calls.columns = *numbers[1];
  calls.steps = (backwards ? SystemCalls::backwards : SystemCalls::forwards) |
                (inRows == backwards && n > 1 ? SystemCalls::isUpper : 0);
  return calls;
}

static std::optional<SystemCalls> matchAdjoint(warp::LibraryCallOp op) {
  auto args = op.getArgs();
  auto bar = getPlace(args[0]), factor = getPlace(args[1]);
  auto row = getConstantInteger(args[3]), column = getConstantInteger(args[4]);
  auto n = getConstantInteger(args[5]), upper = getConstantInteger(args[6]);
  if (!bar || !factor || !n || !upper || row != n || column != 1)
    return std::nullopt;
  SystemCalls calls;
  calls.out = *bar;
  calls.in = *factor;
  calls.n = *n;
  calls.steps =
      SystemCalls::differentiates | (*upper ? SystemCalls::isUpper : 0);
  return calls;
}

std::optional<SystemCalls> warp::findSystemCall(Operation *op) {
  auto call = dyn_cast<warp::LibraryCallOp>(op);
  if (!call)
    return std::nullopt;
  StringRef name = call.getCallee();
  bool isSingle = name.consume_back("_f32");
  if (!isSingle && !name.consume_back("_f64"))
    return std::nullopt;
  std::optional<SystemCalls> calls;
  if (name == "warp_tile_cholesky")
    calls = matchFactor(call);
  else if (name == "warp_tile_solve")
    calls = matchSolve(call);
  else if (name == "warp_tile_cholesky_adjoint")
    calls = matchAdjoint(call);
  if (!calls || calls->n > mostRows)
    return std::nullopt;
  Builder b(op->getContext());
  calls->real = isSingle ? b.getF32Type() : b.getF64Type();
  calls->first = calls->last = op;
  return calls;
}
