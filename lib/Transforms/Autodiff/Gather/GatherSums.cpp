//===- GatherSums.cpp - Gathers in place of scatter atomics ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The primal of a stencil reads the elements around its thread, so its adjoint
// adds to the gradients around it: one atomic addition per point. Here these
// additions leave the adjoint for a kernel of their own, in which a thread has
// an element of the gradient and collects what others would have sent it:
//
//   thread q:                           thread p:
//     g[q + 1] += 2 v(q)                  s = 0
//     g[q - 1] += 3 w(q)       ==>        if p - 1 is a thread: s += 2 v(p - 1)
//                                         if p + 1 is a thread: s += 3 w(p + 1)
//                                         g[p] += s
//
// "Is a thread" is that it is within the launch and passes the branches around
// the addition. That kernel runs before what is left of the adjoint, so it
// finds all values as they are before the launch; NeighborSums.cpp makes sure
// that those are what they should be. Its launch is larger than that of the
// adjoint, by the largest offset in each dimension, and it has the extents of
// the latter as further parameters.
//
// Values are computed once per neighbour in place of once, which is cheaper
// than an atomic addition unless it is a lot.
//
//===----------------------------------------------------------------------===//

#include "Analysis/CostModel.h"
#include "Analysis/Effects.h"
#include "Autodiff/DeadValues.h"
#include "BorderSums.h"
#include "GatherBuilder.h"
#include "GatherTileSums.h"
#include "KernelFunction.h"
#include "Launch/UnrollLoop.h"

#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_GATHERSUMS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp::autodiff;

/// Loops up to this many trips, and operations, are unrolled.
constexpr int64_t maxTrips = 32;
constexpr int64_t maxUnrolled = 1024;

//===----------------------------------------------------------------------===//
// Cost
//===----------------------------------------------------------------------===//

static int64_t getCost(Operation *op) {
  if (op->hasTrait<OpTrait::ConstantLike>() ||
      op->hasTrait<OpTrait::IsTerminator>() ||
      isa<warp::TidOp, warp::GradOp, warp::DimOp>(op))
    return 0;
  int64_t inside = 0;
  for (Region &region : op->getRegions())
    for (Operation &inner : region.getOps())
      inside += getCost(&inner);
  if (isa<scf::ForOp, scf::WhileOp>(op))
    return warp::cost::loopTrips * inside;
  if (isa<scf::IfOp>(op))
    return 1 + inside;
  int64_t components = 1;
  if (op->getNumResults() == 1 && warp::isComposite(op->getResult(0).getType()))
    components = warp::getComponentCount(op->getResult(0).getType());
  bool isCheap = warp::isPlainRead(op) ||
                 isa<warp::AddOp, warp::SubOp, warp::MulOp, warp::NegOp,
                     warp::EqOp, warp::NeOp, warp::LtOp, warp::LeOp, warp::GtOp,
                     warp::GeOp, warp::BitAndOp, warp::BitOrOp, warp::UNotOp,
                     warp::CastOp, warp::ExtractOp, warp::ConstructOp>(op);
  return components * (isCheap ? 1 : int64_t(warp::cost::function));
}

static SumsByOffset sortByOffset(ArrayRef<NeighborSums> gathers) {
  SumsByOffset result;
  for (auto [i, all] : llvm::enumerate(gathers))
    for (const NeighborSum &sum : all.sums)
      result[sum.offsets].emplace_back(i, sum.op);
  return result;
}

/// True if computing values once per neighbour costs less than the atomic
/// additions that it saves.
static bool isWorthwhile(const SumsByOffset &sums) {
  auto getTotal = [](const llvm::SetVector<Operation *> &slice) {
    int64_t total = 0;
    for (Operation *op : slice)
      total += getCost(op);
    return total;
  };
  llvm::SetVector<Operation *> once;
  int64_t total = 0, saved = 0;
  for (auto &[offsets, group] : sums) {
    llvm::SetVector<Operation *> slice;
    for (auto [number, op] : group) {
      slice.set_union(getSlice(op));
      saved += int64_t(warp::cost::gatheredAtomic);
    }
    total += getTotal(slice);
    once.set_union(slice);
  }
  return total - getTotal(once) <= saved;
}

//===----------------------------------------------------------------------===//
// The pass
//===----------------------------------------------------------------------===//

/// Unrolls short loops in which gradients are added to, inner ones first.
static void unrollLoops(func::FuncOp function) {
  SmallVector<scf::ForOp> loops;
  function.walk([&](scf::ForOp loop) { loops.push_back(loop); });
  for (scf::ForOp loop : loops) {
    int64_t size = 0;
    bool adds = false;
    loop.walk([&](Operation *op) {
      ++size;
      adds |= isa<warp::AccumulateOp>(op);
    });
    std::optional<int64_t> trips = warp::getConstantTrips(loop);
    if (adds && trips && *trips <= maxTrips && *trips * size <= maxUnrolled)
      warp::unroll(loop);
  }
}

namespace {

struct GatherSums : warp::impl::GatherSumsBase<GatherSums> {
  void runOnOperation() override {
    auto adjoint =
        dyn_cast_or_null<func::FuncOp>(warp::findKernel(getOperation()));
    if (!adjoint)
      return signalPassFailure();
    func::FuncOp rest = adjoint.clone();
    OpBuilder b(adjoint);
    b.insert(rest);
    unrollLoops(rest);
    bool isSplit = rest->hasAttr(warp::attr::blockThreads)
                       ? gatherTileSums(rest)
                       : split(rest);
    if (!isSplit) {
      rest.erase();
      return;
    }
    adjoint.erase();
    eraseDead(rest.getBody());
  }

  /// Takes what can be gathered out of the adjoint; false if there is nothing.
  bool split(func::FuncOp adjoint) {
    unsigned rank = 0;
    SmallVector<NeighborSums> gathers =
        findNeighborSums(adjoint, splitBorders(adjoint), rank);
    if (gathers.empty())
      return false;
    SumsByOffset sums = sortByOffset(gathers);
    if (!isWorthwhile(sums))
      return false;
    buildGather(adjoint, gathers, sums, rank);
    for (NeighborSums &all : gathers)
      for (NeighborSum &sum : all.sums)
        sum.op.erase();
    return true;
  }
};

} // namespace
