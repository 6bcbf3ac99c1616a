//===- CombineOverWarps.cpp - One atomic for the threads of a warp --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In iteration k of a loop, or in row i of a launch over a plane, the threads
// of a warp update the same element:
//
//   for k: atomic_add(w, k, v)          atomic_add(row, i, v)
//
// That is 32 updates one after the other at one address. Where all lanes come
// to the update together and agree on k and i, they combine their values by
// shuffles, and the first lane makes the only update.
//
// The array must not be accessed in other ways, as a thread may not find its
// own update there yet. Partial results of fewer than 32 bits would round.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "Schedule.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_COMBINEOVERWARPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::AtomicComponentsOp;

/// Whether threads of a warp may be expected to update the same element; what
/// they must agree on is added to `compared`.
static bool updatesOneElement(AtomicComponentsOp op,
                              const warp::ThreadVariance &variance,
                              llvm::SetVector<Value> &compared) {
  auto isKnown = [&](Value value) {
    return variance.isUniformIfEqual(value, compared);
  };
  return warp::commutes(op) && isKnown(op.getArray()) &&
         llvm::all_of(op.getIndices(), isKnown) && !compared.empty() &&
         llvm::all_of(op.getResultTypes(), [](Type type) {
           return type.getIntOrFloatBitWidth() >= 32;
         });
}

static void combineOverWarp(AtomicComponentsOp op, ArrayRef<Value> compared) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  Value together = warp::isWarpTogether(b, loc, compared);
  auto branch = scf::IfOp::create(b, loc, together, /*withElseRegion=*/true);
  op->moveBefore(branch.elseBlock()->getTerminator());

  b.setInsertionPointToStart(branch.thenBlock());
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(
      cast<warp::ArrayType>(op.getArray().getType()).getElementType(), 0,
      leaves);
  SmallVector<Value> totals;
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  for (auto [leaf, value] : llvm::zip_equal(leaves, op.getComponents()))
    totals.push_back(
        warp::overLanes(b, loc, value, [&, type = leaf.type](Value x, Value y) {
          return warp::combine(b, loc, kind, x, y, type, /*anyOrder=*/true);
        }));
  Value zero = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  Value lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  Value isFirst = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, lane,
                                        zero);
  auto once = scf::IfOp::create(b, loc, isFirst, /*withElseRegion=*/false);
  b.setInsertionPointToStart(once.thenBlock());
  AtomicComponentsOp::create(b, loc, op.getResultTypes(), op.getKind(), totals,
                             op.getArray(), op.getIndices());
}

namespace {

struct CombineOverWarps : warp::impl::CombineOverWarpsBase<CombineOverWarps> {
  void getDependentDialects(DialectRegistry &registry) const override {
    CombineOverWarpsBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry || entry->hasAttr(warp::attr::blockThreads) ||
        !warp::isGpu(entry) || warp::getVariant(entry).getDebug() ||
        warp::getVariant(entry).isDeterministic())
      return;
    SmallVector<AtomicComponentsOp> updates;
    entry.walk([&](AtomicComponentsOp op) { updates.push_back(op); });
    if (updates.empty())
      return;
    // What is built leaves the values that the analysis knows as they are.
    warp::ThreadVariance variance(entry);
    for (AtomicComponentsOp op : updates) {
      llvm::SetVector<Value> compared;
      if (updatesOneElement(op, variance, compared)) {
        warp::noteChoice(entry, "update", "one for a warp",
                         "its threads update the same element", op);
        combineOverWarp(op, compared.getArrayRef());
      }
    }
  }
};

} // namespace
