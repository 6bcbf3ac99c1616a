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
// shuffles, and the first lane makes the only update. For an element with many
// components, each lane combines some, and updates one: 64 numbers of a matrix
// take two atomic instructions, which reach memory as whole lines, and a fifth
// of the shuffles.
//
// warp-plan-updates says which updates these are.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Atomics.h"
#include "Choices.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_COMBINEOVERWARPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::AtomicComponentsOp;

/// True if threads of a warp update the same element if they agree on what is
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

static Type elementOf(AtomicComponentsOp op) {
  return cast<warp::ArrayType>(op.getArray().getType()).getElementType();
}

static Value compare(OpBuilder &b, Location loc, arith::CmpIPredicate predicate,
                     Value value, int64_t number) {
  Value other = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(number));
  return arith::CmpIOp::create(b, loc, predicate, value, other);
}

static Value combineTwo(OpBuilder &b, AtomicComponentsOp op, Value x, Value y,
                        Type type) {
  return warp::combine(b, op.getLoc(), warp::combiningKind(op.getKind()), x, y,
                       type, /*anyOrder=*/true);
}

/// The first lane updates the element.
static void updateOnce(OpBuilder &b, AtomicComponentsOp op) {
  Location loc = op.getLoc();
  SmallVector<Value> totals;
  for (auto [leaf, value] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents()))
    totals.push_back(
        warp::overLanes(b, loc, value, [&, type = leaf.type](Value x, Value y) {
          return combineTwo(b, op, x, y, type);
        }));
  Value lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  Value isFirst = compare(b, loc, arith::CmpIPredicate::eq, lane, 0);
  auto once = scf::IfOp::create(b, loc, isFirst, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(once.thenBlock());
  AtomicComponentsOp::create(b, loc, op.getResultTypes(), op.getKind(), totals,
                             op.getArray(), op.getIndices());
}

/// The array of component `number` of each element.
static Value viewComponent(OpBuilder &b, AtomicComponentsOp op, Value number) {
  Location loc = op.getLoc();
  Type element = elementOf(op);
  SmallVector<Value> place{number};
  if (auto matrix = dyn_cast<warp::MatType>(element)) {
    Value columns = arith::ConstantOp::create(
        b, loc, b.getI32IntegerAttr(matrix.getCols()));
    place = {arith::DivUIOp::create(b, loc, number, columns),
             arith::RemUIOp::create(b, loc, number, columns)};
  }
  auto type = warp::ArrayType::get(b.getContext(), op.getIndices().size(),
                                   warp::getElementScalar(element));
  return warp::ComponentViewOp::create(b, loc, type, op.getArray(), place,
                                       StringAttr());
}

/// Each lane updates a component of the element, a warp of them at a time.
static void updateByLanes(OpBuilder &b, AtomicComponentsOp op) {
  Location loc = op.getLoc();
  Value lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  Type type = warp::leavesOf(op).front().type;
  int64_t count = op.getNumResults(), warpSize = warp::subgroupSizeAt(b);
  for (int64_t begin = 0; begin < count; begin += warpSize) {
    SmallVector<Value> values(
        op.getComponents().drop_front(begin).take_front(warpSize));
    int64_t size = values.size();
    Value total =
        warp::shareOverLanes(b, loc, lane, values, [&](Value x, Value y) {
          return combineTwo(b, op, x, y, type);
        });
    int64_t lanes = warpSize / llvm::PowerOf2Ceil(size);
    auto constant = [&](int64_t value) {
      return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
    };
    Value number = arith::DivUIOp::create(b, loc, lane, constant(lanes));
    Value rest = arith::RemUIOp::create(b, loc, lane, constant(lanes));
    Value isOwn = arith::AndIOp::create(
        b, loc, compare(b, loc, arith::CmpIPredicate::eq, rest, 0),
        compare(b, loc, arith::CmpIPredicate::ult, number, size));
    auto own = scf::IfOp::create(b, loc, isOwn, /*withElseRegion=*/false);
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(own.thenBlock());
    number = arith::AddIOp::create(b, loc, number, constant(begin));
    AtomicComponentsOp::create(b, loc, total.getType(), op.getKind(), total,
                               viewComponent(b, op, number), op.getIndices());
  }
}

static void combineOverWarp(AtomicComponentsOp op, ArrayRef<Value> compared) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  Value together = warp::isWarpTogether(b, loc, compared);
  auto branch = scf::IfOp::create(b, loc, together, /*withElseRegion=*/true);
  op->moveBefore(branch.elseBlock()->getTerminator());

  b.setInsertionPointToStart(branch.thenBlock());
  if (op.getNumResults() > 1 && warp::isComposite(elementOf(op)))
    updateByLanes(b, op);
  else
    updateOnce(b, op);
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
    if (!warp::getTarget(entry).isSimt())
      return;
    SmallVector<AtomicComponentsOp> updates;
    entry->walk([&](AtomicComponentsOp op) {
      // Iterations that are in no tile of a ring, too.
      warp::UpdateScope scope = warp::getUpdate(op).getScope();
      if (scope == warp::UpdateScope::lanes || scope == warp::UpdateScope::ring)
        updates.push_back(op);
    });
    if (updates.empty())
      return;
    // New operations leave the values that the analysis knows as they are.
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
