//===- RowRuns.cpp - Elements that lanes take several of at once ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes that go along rows of their own gather a number from as many rows in
// each iteration, and a gather takes as long as that many loads. Four or eight
// iterations together load as many neighbours from each row, which vectors of
// them are transposed into:
//
//     for k in range(n):              for k in range(0, n, 4):
//       a = x[row, k]                   a0, a1, a2, a3 = x[row, k : k + 4]
//       s = s + a              =>       s = s + a0;  ...;  s = s + a3
//                                     for what is left:  as before
//
// The iterations are one after the other, so a thread does the same as before.
// All elements that are read early are read anyway, and nobody writes to them.
//
//===----------------------------------------------------------------------===//

#include "RowRuns.h"

#include "Analysis/Ranges.h"
#include "LanePlan.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;

/// Iterations together, and the operations up to which there are as many.
static constexpr int64_t longRun = 8, shortRun = 4, mostInLong = 16,
                         mostInShort = 48;
/// Vectors that runs may keep in registers at a time.
static constexpr int64_t mostVectors = 16;

bool warp::isRowLoad(LoadComponentsOp load, const ThreadVariance &variance) {
  auto loop = dyn_cast<scf::ForOp>(load->getParentOp());
  ValueRange indices = load.getIndices();
  if (!loop || variance.isDivergent(loop) || indices.empty() ||
      load.getComponents().size() != 1 ||
      getConstantInteger(loop.getStep()) != 1)
    return false;
  mlir::Type type = cast<ArrayType>(load.getArray().getType()).getElementType();
  int64_t size = getByteSize(type);
  if ((size != 4 && size != 8) || isa<ArrayType>(type) ||
      !hasDenseElements(load.getArray()) ||
      variance.isWritten(load.getArray()) ||
      !isNonNegative(indices.back(), load->getBlock()))
    return false;
  // Neighbours side by side are vectors already.
  auto differs = [&](mlir::Value index) {
    return !variance.isUniform(index, Scope::Lanes);
  };
  bool areSideBySide = llvm::none_of(indices.drop_back(), differs) &&
                       variance.step(indices.back()).value_or(0) <= 4 &&
                       variance.step(indices.back()).has_value();
  if (llvm::none_of(indices, differs) || areSideBySide)
    return false;
  Symbol trip = Symbol::trip(loop);
  const Form &last = variance.form(indices.back());
  std::optional<Form> pace = last.coefficientOf(trip);
  return pace && pace->getConstant() == 1 &&
         last.without(trip).isDefinedOutside(loop) &&
         llvm::all_of(indices.drop_back(), [&](mlir::Value index) {
           return variance.form(index).isDefinedOutside(loop);
         });
}

int64_t warp::iterationsInRun(scf::ForOp loop, const ThreadVariance &variance,
                              int64_t lanes) {
  int64_t loads = 0, operations = 0;
  for (auto load : loop.getBody()->getOps<LoadComponentsOp>())
    loads += isRowLoad(load, variance);
  if (loads == 0 || lanes % 4 != 0)
    return 1;
  loop->walk([&](Operation *) { ++operations; });
  int64_t run = operations <= mostInLong    ? longRun
                : operations <= mostInShort ? shortRun
                                            : 1;
  if (run * loads > mostVectors)
    run = shortRun;
  std::optional<APInt> trips = loop.getStaticTripCount();
  if (run * loads > mostVectors || (trips && trips->ult(run)))
    return 1;
  return run;
}
