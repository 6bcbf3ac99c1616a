//===- CombineOverGroups.cpp - Aggregated atomics of CPU groups -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If all threads of a group update one element, each yields what it would
// have added, and the group publishes the combination once, at its end.
//
// Partial results of a sum may be combined in any order (`reassoc`), which lets
// LLVM keep one per lane. Gradients add up many contributions of similar size,
// so their partial sums have 64 bits.
//
//===----------------------------------------------------------------------===//

#include "Atomics.h"
#include "CarryOut.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

namespace warp {
#define GEN_PASS_DEF_COMBINEOVERGROUPS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

namespace {

/// Gives updates of one kernel their private sums.
class GroupCombiner {
public:
  GroupCombiner(FunctionOpInterface kernel, warp::ThreadsOp threads)
      : threads(threads), first(&kernel.getFunctionBody().front()),
        thread(threads.getThread()), b(kernel->getContext()) {}

  void combine(warp::AtomicComponentsOp op);

private:
  ValueRange yield(ArrayRef<warp::Carried> sums, ArrayRef<int32_t> kinds,
                   ArrayRef<Type> types);
  void publish(warp::AtomicComponentsOp op, ValueRange totals);

  warp::ThreadsOp threads;
  Block *first, *thread;
  OpBuilder b;
};

} // namespace

void GroupCombiner::combine(warp::AtomicComponentsOp op) {
  Location loc = op.getLoc();
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  bool isGradient = op.getArray().getDefiningOp<warp::GradOp>() != nullptr;
  bool negates = op.getKind() == warp::AtomicKind::sub;
  SmallVector<warp::Carried> sums;
  SmallVector<int32_t> kinds;
  SmallVector<Type> types;
  OpBuilder atStart = OpBuilder::atBlockBegin(thread);
  b.setInsertionPoint(op);
  for (auto [leaf, component] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents())) {
    bool widens = isGradient && leaf.type.isF32();
    Type type = widens ? b.getF64Type() : leaf.type;
    Value value = component, identity =
                                 warp::identity(atStart, loc, kind, type);
    if (widens)
      value = arith::ExtFOp::create(b, loc, type, value);
    if (negates)
      value = warp::negate(b, loc, value);
    auto combine = [=](OpBuilder &b, Value x, Value y) {
      return warp::combine(b, loc, kind, x, y, type, /*anyOrder=*/true);
    };
    sums.push_back({value, identity, combine});
    kinds.push_back(int32_t(kind));
    types.push_back(type);
  }
  // A group that never gets here leaves the array alone: it may be null.
  bool isSure = op->getBlock() == thread;
  if (!isSure) {
    auto flag = [&](OpBuilder &b, bool value) -> Value {
      return arith::ConstantOp::create(b, loc, b.getBoolAttr(value));
    };
    auto combine = [=](OpBuilder &b, Value x, Value y) -> Value {
      return arith::OrIOp::create(b, loc, x, y);
    };
    sums.push_back({flag(b, true), flag(atStart, false), combine});
    kinds.push_back(int32_t(warp::AtomicKind::bit_or));
    types.push_back(b.getI1Type());
  }
  warp::carryOut(sums, op->getBlock(), thread);
  ValueRange totals = yield(sums, kinds, types);
  b.setInsertionPointToEnd(threads->getBlock());
  if (!isSure) {
    auto any = scf::IfOp::create(b, loc, totals.back(), /*withElse=*/false);
    b.setInsertionPointToStart(any.thenBlock());
    totals = totals.drop_back();
  }
  publish(op, totals);
  op->erase();
}

/// Has the threads yield values more: their combinations over the group.
ValueRange GroupCombiner::yield(ArrayRef<warp::Carried> sums,
                             ArrayRef<int32_t> kinds, ArrayRef<Type> types) {
  SmallVector<int32_t> allKinds(threads.getKinds());
  llvm::append_range(allKinds, kinds);
  SmallVector<Type> allTypes(threads.getTypes().getAsValueRange<TypeAttr>());
  llvm::append_range(allTypes, types);
  SmallVector<Type> results(threads.getResultTypes());
  Operation *end = threads.getYield();
  for (const warp::Carried &sum : sums) {
    results.push_back(sum.value.getType());
    end->insertOperands(end->getNumOperands(), sum.value);
  }
  unsigned before = threads.getNumResults();
  b.setInsertionPoint(threads);
  auto made = warp::ThreadsOp::create(
      b, threads.getLoc(), results, b.getDenseI32ArrayAttr(allKinds),
      b.getTypeArrayAttr(allTypes), threads.getLanesAttr());
  made.getBody().takeBody(threads.getBody());
  threads->replaceAllUsesWith(made->getResults().take_front(before));
  threads->erase();
  threads = made;
  return made->getResults().drop_front(before);
}

/// One thread adds totals to the array.
void GroupCombiner::publish(warp::AtomicComponentsOp op, ValueRange totals) {
  Location loc = op.getLoc();
  auto once = warp::OnceOp::create(b, loc);
  b.createBlock(&once.getBody());
  IRMapping clones;
  SmallVector<Value> indices;
  for (Value index : op.getIndices())
    indices.push_back(warp::cloneInvariant(b, index, first, clones));
  Value array = warp::cloneInvariant(b, op.getArray(), first, clones);
  SmallVector<Value> components;
  for (auto [total, type] : llvm::zip_equal(totals, op.getResultTypes()))
    components.push_back(
        total.getType() == type
            ? total
            : arith::TruncFOp::create(b, loc, type, total));
  warp::AtomicComponentsOp::create(b, loc, op.getResultTypes(),
                                   warp::combiningKind(op.getKind()),
                                   components, array, indices);
}

namespace {

struct CombineOverGroups
    : warp::impl::CombineOverGroupsBase<CombineOverGroups> {
  void runOnOperation() override {
    warp::ThreadsOp threads = warp::findThreads(getOperation());
    if (!threads)
      return signalPassFailure();
    auto kernel = threads->getParentOfType<FunctionOpInterface>();
    // Exact sums of a group are made in integers, by warp-lower-sums.
    SmallVector<warp::AtomicComponentsOp> found;
    threads.walk([&](warp::AtomicComponentsOp op) {
      warp::UpdateAttr plan = warp::getUpdate(op);
      if (plan.getScope() == warp::UpdateScope::group && !plan.isExact())
        found.push_back(op);
    });
    GroupCombiner combiner(kernel, threads);
    for (warp::AtomicComponentsOp op : found)
      combiner.combine(op);
  }
};

} // namespace
