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
// Four bytes of a row are gathered as words, where single bytes cannot be.
// All elements that are read early are read anyway, and nobody writes to them.
// Stores along a row are put together in the same way and made behind the last
// of the iterations, where nothing in the loop reads what they write but the
// iteration itself, before its store. Rows may be followed back to front.
//
//===----------------------------------------------------------------------===//

#include "RowRuns.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Ranges.h"
#include "KernelFunction.h"
#include "LanePlan.h"
#include "Variant.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;

/// Iterations together, and the operations up to which there are as many.
static constexpr int64_t longRun = 8, shortRun = 4, mostInLong = 16,
                         mostInShort = 96;
/// Vectors that runs may keep in registers at a time.
static constexpr int64_t mostVectors = 32;

std::optional<int64_t> warp::paceAlongRow(AccessOp access,
                                          const ThreadVariance &variance) {
  auto loop = cast<scf::ForOp>(access->getParentOp());
  std::optional<Form> pace = variance.form(access.getIndices().back())
                                 .coefficientOf(Symbol::trip(loop));
  return pace ? pace->getConstant() : std::nullopt;
}

/// True if an access in the body of a loop that lanes run in step is to the
/// next, or the previous, element of a row of each lane's own in every
/// iteration.
static bool goesAlongRows(warp::AccessOp access,
                          const warp::ThreadVariance &variance) {
  auto loop = dyn_cast<scf::ForOp>(access->getParentOp());
  ValueRange indices = access.getIndices();
  if (!loop || variance.isDivergent(loop) || indices.empty() ||
      warp::getConstantInteger(loop.getStep()) != 1)
    return false;
  mlir::Type type =
      cast<warp::ArrayType>(access.getArray().getType()).getElementType();
  if (isa<warp::ArrayType>(type))
    return false;
  int64_t size = warp::getByteSize(type);
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(type, 0, leaves);
  bool isByte = size == 1 && access.mayRead() && !warp::isBool(type);
  if ((size != 4 && size != 8 && !isByte) || leaves.size() != 1 ||
      !warp::hasDenseElements(access.getArray()) ||
      !warp::isNonNegative(indices.back(), access->getBlock()))
    return false;
  // Neighbours side by side are vectors already.
  auto differs = [&](mlir::Value index) {
    return !variance.isUniform(index, warp::Scope::Lanes);
  };
  bool areSideBySide = llvm::none_of(indices.drop_back(), differs) &&
                       variance.step(indices.back()).value_or(0) <= 4 &&
                       variance.step(indices.back()).has_value();
  if (llvm::none_of(indices, differs) || areSideBySide)
    return false;
  warp::Symbol trip = warp::Symbol::trip(loop);
  std::optional<int64_t> pace = warp::paceAlongRow(access, variance);
  return (pace == 1 || pace == -1) &&
         variance.form(indices.back()).without(trip).isDefinedOutside(loop) &&
         llvm::all_of(indices.drop_back(), [&](mlir::Value index) {
           return variance.form(index).isDefinedOutside(loop);
         });
}

/// True if nothing else in the loop is at the array of an access, but for a
/// store behind a load of the same element.
static bool isAloneAtRow(warp::AccessOp access,
                         const warp::ThreadVariance &variance) {
  auto kernel = access->getParentOfType<FunctionOpInterface>();
  if (!warp::getVariant(kernel).getDisjoint())
    return false;
  warp::ArrayOrigins origins(kernel, /*disjoint=*/true);
  auto isSameElement = [&](warp::AccessOp other) {
    auto isEqual = [&](auto pair) {
      auto [one, two] = pair;
      return variance.form(one).equals(variance.form(two));
    };
    return other->getBlock() == access->getBlock() &&
           other.getArray() == access.getArray() &&
           other.getIndices().size() == access.getIndices().size() &&
           llvm::all_of(llvm::zip(other.getIndices(), access.getIndices()),
                        isEqual);
  };
  auto isPair = [&](warp::AccessOp other) {
    auto [load, store] = isa<warp::LoadComponentsOp>(*other)
                             ? std::pair(other, access)
                             : std::pair(access, other);
    return isa<warp::LoadComponentsOp>(*load) &&
           isa<warp::StoreComponentsOp>(*store) && isSameElement(other) &&
           load->isBeforeInBlock(store);
  };
  unsigned others = 0;
  bool isAlone =
      !access->getParentOp()
           ->walk([&](Operation *op) {
             // Scratch memory is the thread's own.
             if (op == access || op->getNumRegions() != 0 ||
                 isMemoryEffectFree(op) ||
                 isa<warp::ScratchLoadOp, warp::ScratchStoreOp>(op))
               return WalkResult::advance();
             auto other = dyn_cast<warp::AccessOp>(op);
             if (!other)
               return WalkResult::interrupt();
             if (!origins.mayAlias(other.getArray(), access.getArray()))
               return WalkResult::advance();
             return ++others == 1 && isPair(other) ? WalkResult::advance()
                                                   : WalkResult::interrupt();
           })
           .wasInterrupted();
  return isAlone;
}

bool warp::isRowLoad(LoadComponentsOp load, const ThreadVariance &variance) {
  auto access = cast<AccessOp>(load.getOperation());
  return goesAlongRows(access, variance) &&
         (!variance.isWritten(load.getArray()) ||
          isAloneAtRow(access, variance));
}

bool warp::isRowStore(StoreComponentsOp store, const ThreadVariance &variance) {
  auto access = cast<AccessOp>(store.getOperation());
  return goesAlongRows(access, variance) && isAloneAtRow(access, variance);
}

int64_t warp::iterationsInRun(scf::ForOp loop, const ThreadVariance &variance,
                              int64_t lanes) {
  if (lanes % 4 != 0)
    return 1;
  int64_t rows = 0, operations = 0;
  bool hasBytes = false;
  for (auto load : loop.getBody()->getOps<LoadComponentsOp>())
    if (isRowLoad(load, variance)) {
      ++rows;
      auto array = cast<ArrayType>(load.getArray().getType());
      hasBytes |= getByteSize(array.getElementType()) == 1;
    }
  for (auto store : loop.getBody()->getOps<StoreComponentsOp>())
    rows += isRowStore(store, variance);
  if (rows == 0)
    return 1;
  loop->walk([&](Operation *) { ++operations; });
  int64_t run = operations <= mostInLong    ? longRun
                : operations <= mostInShort ? shortRun
                                            : 1;
  std::optional<APInt> trips = loop.getStaticTripCount();
  // Iterations behind the last run go one by one.
  bool leavesMany = trips && trips->urem(longRun) >= shortRun;
  // Four bytes are in two words.
  if (run > 1 && (run * rows > mostVectors || leavesMany || hasBytes))
    run = shortRun;
  if (run * rows > mostVectors || (trips && trips->ult(run)))
    return 1;
  return run;
}
