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
// warp-plan-updates says which updates these are.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "Schedule.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_COMBINEOVERWARPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::AtomicComponentsOp;

/// Whether threads of a warp update the same element if they agree on what is
/// added to `compared`.
static bool updatesOneElement(AtomicComponentsOp op,
                              const warp::ThreadVariance &variance,
                              llvm::SetVector<Value> &compared) {
  auto isKnown = [&](Value value) {
    return variance.isUniformIfEqual(value, compared);
  };
  return isKnown(op.getArray()) && llvm::all_of(op.getIndices(), isKnown) &&
         !compared.empty();
}

static void combineOverWarp(AtomicComponentsOp op, ArrayRef<Value> compared) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  Value together = warp::isWarpTogether(b, loc, compared);
  auto branch = scf::IfOp::create(b, loc, together, /*withElseRegion=*/true);
  op->moveBefore(branch.elseBlock()->getTerminator());

  b.setInsertionPointToStart(branch.thenBlock());
  SmallVector<Value> totals;
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  for (auto [leaf, value] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents()))
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
    FunctionOpInterface entry = warp::findEntry(getOperation());
    if (!entry)
      return signalPassFailure();
    if (!warp::isGpu(entry))
      return;
    SmallVector<AtomicComponentsOp> updates;
    entry->walk([&](AtomicComponentsOp op) {
      if (warp::getUpdate(op).getScope() == warp::UpdateScope::lanes)
        updates.push_back(op);
    });
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
