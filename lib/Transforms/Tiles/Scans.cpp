//===- Scans.cpp - Models of folds and scans ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Models.h"
#include "Reductions.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::tiles {

namespace {

struct ScanLowering : ReductionLowering {
  using ReductionLowering::ReductionLowering;
  void fold(TileFoldOp op);
  void scan(TileScanOp op);
};

} // namespace

void ScanLowering::fold(TileFoldOp op) {
  TileType type = tileType(op.getTile());
  Block &body = op.getBody().front();
  /// Elements along one line, in order.
  auto fold = [&](int64_t extent, function_ref<Values(Value)> place) {
    Value first = element(op.getTile(), place(number(0)));
    if (op.getPartials())
      store(op.getResult(), place(number(0)), first);
    return loop(number(1), number(extent), number(1), first,
                [&](Value i, ValueRange sums) -> Values {
                  Values at = place(i);
                  Value next = element(op.getTile(), at);
                  Values made = inlineBody(body, {sums[0], next});
                  if (op.getPartials())
                    store(op.getResult(), at, made[0]);
                  return made;
                });
  };
  if (!op.getAxis()) {
    byFirstThread([&] {
      Values made = fold(type.getNumElements(),
                         [&](Value i) { return unravel(i, type.getShape()); });
      if (!op.getPartials())
        store(op.getResult(), ValueRange(number(0)), made[0]);
    });
    return;
  }
  int64_t axis = *op.getAxis();
  SmallVector<int64_t> outer(type.getShape());
  int64_t extent = outer[axis];
  outer.erase(outer.begin() + axis);
  if (outer.empty())
    outer.push_back(1);
  share(outer, [&](ValueRange indices) {
    Values made = fold(extent, [&](Value i) {
      Values at(indices.take_front(type.getRank() - 1));
      at.insert(at.begin() + axis, i);
      return at;
    });
    if (!op.getPartials())
      store(op.getResult(), indices, made[0]);
  });
}

/// Each thread has a run of elements: adds them up, learns what is before them,
/// and goes through them again.
void ScanLowering::scan(TileScanOp op) {
  TileType type = tileType(op.getTile());
  int64_t count = type.getNumElements();
  int64_t run = llvm::divideCeil(count, threads);
  Value first = worst(op.getKind(), type.getElementType());
  auto place = [&](Value i) {
    if (op.getReverse())
      i = sub(number(count - 1), i);
    return unravel(i, type.getShape());
  };
  Value begin = number(0), end = number(count), before = first;
  if (threads > 1) {
    begin = mul(thread, number(run));
    end = arith::MinSIOp::create(b, loc, add(begin, number(run)), end);
    Values sums =
        loop(begin, end, number(1), first, [&](Value i, ValueRange sums) {
          Value next = element(op.getTile(), place(i));
          return combine(op.getKind(), sums, next);
        });
    int64_t offset = scratchOf(op);
    Type element = type.getElementType();
    Value memory = arrayAt(offset, threads, element);
    StoreOp::create(b, loc, sums[0], memory, thread);
    barrier();
    before = loop(number(0), thread, number(1), first,
                  [&](Value t, ValueRange sums) {
                    Value next = LoadOp::create(b, loc, element, memory, t);
                    return combine(op.getKind(), sums, next);
                  })[0];
  }
  loop(begin, end, number(1), before, [&](Value i, ValueRange sums) {
    Values at = place(i);
    Value next = element(op.getTile(), at);
    Values sum = combine(op.getKind(), sums, next);
    store(op.getResult(), at, op.getExclusive() ? sums[0] : sum[0]);
    return sum;
  });
}

namespace {

struct FoldModel : TileModel<FoldModel, TileFoldOp> {
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    return getPartialBytes(op, threads);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    ScanLowering(lowering.state).fold(cast<TileFoldOp>(op));
  }
  LogicalResult adjoint(Operation *, autodiff::TileReverse &reverse) const {
    return reverse.refuse();
  }
};

struct ScanModel : TileModel<ScanModel, TileScanOp> {
  /// Threads of a larger block go through their elements twice.
  TileRead getRead(Operation *op, OpOperand &) const {
    auto kernel = op->getParentOfType<FunctionOpInterface>();
    return getBlockThreads(kernel) == 1 ? TileRead::Once : TileRead::Any;
  }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    return getPartialBytes(op, threads);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    ScanLowering(lowering.state).scan(cast<TileScanOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto scan = cast<TileScanOp>(op);
    if (scan.getKind() != TileReduction::add)
      return reverse.refuse();
    if (Value g = reverse.take())
      reverse.give(scan.getTile(),
                   TileScanOp::create(reverse.b, reverse.loc, g.getType(),
                                      TileReduction::add, g,
                                      scan.getExclusive(), !scan.getReverse()));
    return success();
  }
};

} // namespace

void attachScans(MLIRContext &context) {
  TileFoldOp::attachInterface<FoldModel>(context);
  TileScanOp::attachInterface<ScanModel>(context);
}

} // namespace warp::tiles
