//===- LowerLanes.cpp - Joint operations of lanes as vector operations ----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The copy of a body for full vectors has a constant mask, of which
// simplification leaves little. Operations without a vector form go through
// memory:
// operands are stored as vectors, and a loop over the lanes takes them out one
// by one, which keeps the code short whatever the number of lanes. Lanes that
// take numbers from one counter need no turns: sums over the lanes before each
// say what it would have seen.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "LiveLanes.h"
#include "Spread.h"
#include "Updates/Atomics.h"
#include "WarpDialect/CallAttributes.h"
#include "WrongRewrites.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Transforms/GreedyPatternRewriteDriver.h"

#include <numeric>

namespace warp {
#define GEN_PASS_DEF_LOWERLANES
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

static LogicalResult foldAny(warp::AnyOp op, PatternRewriter &b) {
  auto known = warp::getConstantMask(op.getMask());
  if (!known)
    return failure();
  b.replaceOpWithNewOp<arith::ConstantOp>(op, b.getBoolAttr(*known));
  return success();
}

static LogicalResult foldBroadcast(warp::BroadcastOp op, PatternRewriter &b) {
  Attribute value;
  if (!matchPattern(op.getValue(), m_Constant(&value)) ||
      !isa<IntegerAttr, FloatAttr>(value))
    return failure();
  auto type = cast<ShapedType>(op.getType());
  b.replaceOpWithNewOp<arith::ConstantOp>(op,
                                          DenseElementsAttr::get(type, value));
  return success();
}

namespace {

/// Lowers the operations of an entry, or of a function that it calls.
class LaneLowering {
public:
  explicit LaneLowering(FunctionOpInterface entry)
      : entry(entry), b(entry->getContext()), loc(entry->getLoc()) {}

  void run();

private:
  void lower(warp::AnyOp op);
  void lower(warp::BroadcastOp op);
  void lower(warp::LaneNumbersOp op);
  void lower(warp::CombineLanesOp op);
  void lower(warp::EachLaneOp op);
  void count(warp::EachLaneOp op, warp::AtomicComponentsOp update);
  Value makeSlots(VectorType type);
  Value slot(Value slots, Type element, Value lane);
  Value constant(int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
  }
  void replace(Operation *op, Value value) {
    op->getResult(0).replaceAllUsesWith(value);
    op->erase();
  }

  FunctionOpInterface entry;
  OpBuilder b;
  Location loc;
};

} // namespace

//===----------------------------------------------------------------------===//
// Vectors
//===----------------------------------------------------------------------===//

void LaneLowering::lower(warp::AnyOp op) {
  replace(op,
          LLVM::vector_reduce_or::create(b, loc, b.getI1Type(), op.getMask()));
}

void LaneLowering::lower(warp::BroadcastOp op) {
  auto type = cast<VectorType>(op.getType());
  Value value = op.getValue();
  if (!value.getType().isIndex())
    return replace(op, warp::spread(b, loc, value, type.getNumElements()));
  value = arith::IndexCastOp::create(b, loc, b.getI64Type(), value);
  value = warp::spread(b, loc, value, type.getNumElements());
  replace(op, arith::IndexCastOp::create(b, loc, type, value));
}

void LaneLowering::lower(warp::LaneNumbersOp op) {
  auto type = cast<VectorType>(op.getType());
  SmallVector<Attribute> numbers;
  for (int64_t lane = 0; lane < type.getNumElements(); ++lane)
    numbers.push_back(b.getIntegerAttr(type.getElementType(), lane));
  replace(op, arith::ConstantOp::create(b, loc,
                                        DenseElementsAttr::get(type, numbers)));
}

void LaneLowering::lower(warp::CombineLanesOp op) {
  Value value = op.getValue();
  auto kind = warp::AtomicKind(op.getKind());
  for (int64_t lanes = cast<VectorType>(value.getType()).getNumElements();
       lanes > 1; lanes /= 2) {
    auto half = [&](int32_t first) -> Value {
      SmallVector<int32_t> places(lanes / 2);
      std::iota(places.begin(), places.end(), first);
      return LLVM::ShuffleVectorOp::create(b, loc, value, value, places);
    };
    Value low = half(0), high = half(lanes / 2);
    value = warp::combine(b, loc, kind, low, high, op.getType());
  }
  replace(op, LLVM::ExtractElementOp::create(b, loc, value, constant(0)));
}

//===----------------------------------------------------------------------===//
// Lane by lane
//===----------------------------------------------------------------------===//

/// Memory for a vector, in the first block of the entry.
Value LaneLowering::makeSlots(VectorType type) {
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&entry.getFunctionBody().front());
  Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  return LLVM::AllocaOp::create(b, loc, pointer, type, one);
}

Value LaneLowering::slot(Value slots, Type element, Value lane) {
  return LLVM::GEPOp::create(b, loc, slots.getType(), element, slots,
                             ArrayRef<LLVM::GEPArg>(lane));
}

/// The type of a lane's value in memory, where booleans take a byte and an
/// index 64 bits.
static Type storedType(OpBuilder &b, Type type) {
  return type.isInteger(1) ? b.getI8Type()
         : type.isIndex()  ? b.getI64Type()
                           : type;
}

static Value toStored(OpBuilder &b, Location loc, Value value) {
  Type element = getElementTypeOrSelf(value), stored = storedType(b, element);
  if (element == stored)
    return value;
  Type type = stored;
  if (auto lanes = dyn_cast<VectorType>(value.getType()))
    type = VectorType::get(lanes.getShape(), stored);
  if (element.isIndex())
    return arith::IndexCastOp::create(b, loc, type, value);
  return arith::ExtUIOp::create(b, loc, type, value);
}

static Value fromStored(OpBuilder &b, Location loc, Value value, Type type) {
  if (value.getType() == type)
    return value;
  if (getElementTypeOrSelf(type).isIndex())
    return arith::IndexCastOp::create(b, loc, type, value);
  return arith::TruncIOp::create(b, loc, type, value);
}

/// The update that is all of what lanes do, if it adds integers to one element.
static warp::AtomicComponentsOp findCounter(warp::EachLaneOp op) {
  Block &body = op.getBody().front();
  auto update = dyn_cast<warp::AtomicComponentsOp>(body.front());
  auto end =
      dyn_cast_or_null<warp::YieldOp>(update ? update->getNextNode() : nullptr);
  if (!end || update.getComponents().size() != 1 ||
      end->getOperands() != ValueRange(update->getResults()) ||
      warp::combiningKind(update.getKind()) != warp::AtomicKind::add ||
      !isa<IntegerType>(update.getComponents()[0].getType()))
    return {};
  auto isInside = [&](Value value) { return value.getParentBlock() == &body; };
  bool isOnePlace = !isInside(update.getArray()) &&
                    llvm::none_of(update.getIndices(), isInside);
  return isOnePlace ? update : warp::AtomicComponentsOp();
}

/// Lanes that take numbers from a counter: one update by their sum, of which a
/// lane's old value is what was there and what the lanes before it add.
void LaneLowering::count(warp::EachLaneOp op, warp::AtomicComponentsOp update) {
  int64_t lanes = cast<VectorType>(op.getMask().getType()).getNumElements();
  Value step = update.getComponents()[0];
  auto type = VectorType::get(lanes, step.getType());
  if (auto argument = dyn_cast<BlockArgument>(step);
      argument && argument.getOwner() == &op.getBody().front())
    step = op.getInputs()[argument.getArgNumber()];
  else
    step = warp::spread(b, loc, step, lanes);
  Value none = arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
  if (update.getKind() == warp::AtomicKind::sub)
    step = arith::SubIOp::create(b, loc, none, step);
  step = arith::SelectOp::create(b, loc, op.getMask(), step, none);
  Value sums = step;
  for (int64_t distance = 1; distance < lanes; distance *= 2) {
    SmallVector<int32_t> places;
    for (int64_t lane = 0; lane < lanes; ++lane)
      places.push_back(lanes + lane - distance);
    Value moved = LLVM::ShuffleVectorOp::create(b, loc, none, sums, places);
    sums = arith::AddIOp::create(b, loc, sums, moved);
  }
  Value total =
      LLVM::ExtractElementOp::create(b, loc, sums, constant(lanes - 1));
  auto made = warp::AtomicComponentsOp::create(
      b, loc, update.getResultTypes(), warp::AtomicKind::add, total,
      update.getArray(), update.getIndices());
  Value old = warp::spread(b, loc, made->getResult(0), lanes);
  Value before = arith::SubIOp::create(b, loc, sums, step);
  replace(op, arith::AddIOp::create(b, loc, old, before));
}

void LaneLowering::lower(warp::EachLaneOp op) {
  if (warp::AtomicComponentsOp update = findCounter(op))
    return count(op, update);
  int64_t lanes = cast<VectorType>(op.getMask().getType()).getNumElements();
  SmallVector<Value> inSlots, outSlots;
  for (Value input : op.getInputs()) {
    Value stored = toStored(b, loc, input);
    inSlots.push_back(makeSlots(cast<VectorType>(stored.getType())));
    LLVM::StoreOp::create(b, loc, stored, inSlots.back());
  }
  auto vectorOf = [&](Type type) {
    return VectorType::get(
        lanes, storedType(b, cast<VectorType>(type).getElementType()));
  };
  for (Type type : op.getResultTypes())
    outSlots.push_back(makeSlots(vectorOf(type)));

  warp::forLiveLanes(b, loc, op.getMask(), [&](Value lane) {
    Block &body = op.getBody().front();
    for (auto [argument, slots] : llvm::zip(body.getArguments(), inSlots)) {
      Type stored = storedType(b, argument.getType());
      Value value =
          LLVM::LoadOp::create(b, loc, stored, slot(slots, stored, lane));
      argument.replaceAllUsesWith(
          fromStored(b, loc, value, argument.getType()));
    }
    Operation *end = body.getTerminator();
    b.getInsertionBlock()->getOperations().splice(
        b.getInsertionPoint(), body.getOperations(), body.begin(),
        end->getIterator());
    for (auto [value, slots] : llvm::zip_equal(end->getOperands(), outSlots)) {
      Value stored = toStored(b, loc, value);
      LLVM::StoreOp::create(b, loc, stored,
                            slot(slots, stored.getType(), lane));
    }
  });
  for (auto [result, slots] : llvm::zip_equal(op.getResults(), outSlots)) {
    Value stored =
        LLVM::LoadOp::create(b, loc, vectorOf(result.getType()), slots);
    result.replaceAllUsesWith(fromStored(b, loc, stored, result.getType()));
  }
  op->erase();
}

void LaneLowering::run() {
  SmallVector<Operation *> found;
  entry->walk([&](Operation *op) {
    if (isa<warp::AnyOp, warp::BroadcastOp, warp::LaneNumbersOp,
            warp::CombineLanesOp, warp::EachLaneOp>(op))
      found.push_back(op);
  });
  for (Operation *op : found) {
    b.setInsertionPoint(op);
    loc = op->getLoc();
    if (auto any = dyn_cast<warp::AnyOp>(op))
      lower(any);
    else if (auto spread = dyn_cast<warp::BroadcastOp>(op))
      lower(spread);
    else if (auto numbers = dyn_cast<warp::LaneNumbersOp>(op))
      lower(numbers);
    else if (auto combine = dyn_cast<warp::CombineLanesOp>(op))
      lower(combine);
    else
      lower(cast<warp::EachLaneOp>(op));
  }
}

namespace {

struct LowerLanes : warp::impl::LowerLanesBase<LowerLanes> {
  LogicalResult initialize(MLIRContext *context) override {
    RewritePatternSet found(context);
    found.add(foldAny);
    found.add(foldBroadcast);
    for (RegisteredOperationName op : context->getRegisteredOperations())
      if (llvm::is_contained({"arith", "scf"}, op.getDialectNamespace()))
        op.getCanonicalizationPatterns(found, context);
    warp::addRightRewrites(found);
    patterns = std::make_shared<FrozenRewritePatternSet>(std::move(found),
                                                         warp::wrongRewrites());
    return success();
  }

  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry || warp::getTarget(entry).isSimt() || !hasLanes(entry))
      return;
    SmallVector<FunctionOpInterface> bodies{found};
    for (auto function : getOperation().getOps<FunctionOpInterface>())
      if (function->hasAttr(warp::attr::kept))
        bodies.push_back(function);
    for (FunctionOpInterface function : bodies) {
      (void)applyPatternsGreedily(function, *patterns);
      LaneLowering(function).run();
    }
  }

  static bool hasLanes(Operation *entry) {
    return entry
        ->walk([](Operation *op) {
          return isa<warp::LaneNumbersOp, warp::AnyOp, warp::BroadcastOp>(op)
                     ? WalkResult::interrupt()
                     : WalkResult::advance();
        })
        .wasInterrupted();
  }

  std::shared_ptr<FrozenRewritePatternSet> patterns;
};

} // namespace
