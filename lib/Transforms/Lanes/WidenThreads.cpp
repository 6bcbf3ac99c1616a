//===- WidenThreads.cpp - Vectorisation: threads as lanes -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The threads of a range on a CPU become the lanes of vectors: the body is
// written again with a vector where values differ from thread to thread, with a
// mask where control flow does, and as it was where they agree. An operation is
// performed for all lanes before the next one, so that every thread keeps the
// order of its own accesses, whatever overlaps.
//
//     for i in range:                     for i in range by 16:
//       x = a[i]                            x = a[i : i + 16]
//       if x > 0:                    =>     m = x > 0
//         y = sqrt(x)                       y = sqrt(x)
//       b[i] = y                            b[i : i + 16] = select(m, y, 0)
//
// Lanes outside of the mask compute with whatever they hold: they touch no
// memory, divide by 1, and nobody looks at their results.
//
// Elementwise operations have the same bits in any number of lanes.
//
//===----------------------------------------------------------------------===//

#include "Widening.h"

#include "Analysis/Effects.h"
#include "CarryElements.h"
#include "Choices.h"
#include "InStep.h"
#include "JoinFields.h"
#include "KernelFunction.h"
#include "LanePlan.h"
#include "ShareRuns.h"
#include "Updates/Atomics.h"
#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TilePasses.h"

#include "warp/Schedule.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/IR/Matchers.h"

namespace warp {
#define GEN_PASS_DEF_WIDENTHREADS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using warp::Widening;

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

Value Widening::splat(TypedAttr value) {
  auto type = lanesOf(value.getType());
  return arith::ConstantOp::create(
      b, loc, DenseElementsAttr::get(type, Attribute(value)));
}

Value Widening::broadcast(Value value) {
  TypedAttr constant;
  if (matchPattern(value, m_Constant(&constant)) &&
      isa<IntegerAttr, FloatAttr>(constant))
    return splat(constant);
  return warp::BroadcastOp::create(b, loc, lanesOf(value.getType()), value);
}

Value Widening::any(Value mask) {
  return warp::AnyOp::create(b, loc, b.getI1Type(), mask);
}

Value Widening::both(Value x, Value y) {
  return arith::AndIOp::create(b, loc, x, y);
}

Value Widening::without(Value x, Value y) {
  Value all = splat(b.getBoolAttr(true));
  return both(x, arith::XOrIOp::create(b, loc, y, all));
}

Value Widening::choose(Value mask, Value x, Value y) {
  return x == y ? x : arith::SelectOp::create(b, loc, mask, x, y).getResult();
}

bool Widening::hasBase(Value value) const {
  return isVarying(value) && variance.step(value).has_value() &&
         isa<IntegerType, IndexType>(value.getType()) &&
         !value.getType().isInteger(1);
}

/// A scalar is broadcast right after its definition, but among the threads.
Value Widening::vector(Value value) {
  if (Value known = vectors.lookup(value))
    return known;
  Value one = scalar(value);
  assert(one && "a value has no form yet");
  OpBuilder::InsertionGuard guard(b);
  if (!body->getParent()->isAncestor(one.getParentRegion()))
    b.setInsertionPointToStart(body);
  else
    b.setInsertionPointAfterValue(one);
  return vectors[value] = broadcast(one);
}

void Widening::appendForms(Value like, Value value, Values &forms) {
  if (isVarying(like))
    forms.push_back(vector(value));
  if (!isVarying(like) || hasBase(like))
    forms.push_back(scalar(value));
}

SmallVector<Type> Widening::formTypes(ValueRange values) {
  SmallVector<Type> types;
  for (Value value : values) {
    if (isVarying(value))
      types.push_back(lanesOf(value.getType()));
    if (!isVarying(value) || hasBase(value))
      types.push_back(value.getType());
  }
  return types;
}

void Widening::takeForms(ValueRange values, ValueRange forms) {
  for (Value value : values) {
    vectors.erase(value);
    scalars.erase(value);
    if (isVarying(value)) {
      setVector(value, forms.front());
      forms = forms.drop_front();
    }
    if (!isVarying(value) || hasBase(value)) {
      setScalar(value, forms.front());
      forms = forms.drop_front();
    }
  }
}

//===----------------------------------------------------------------------===//
// Straight-line code
//===----------------------------------------------------------------------===//

void Widening::widen(Block &block) {
  for (Operation &op : block.without_terminator())
    widen(&op);
}

static bool isIntegerDivision(Operation *op) {
  return isa<arith::DivSIOp, arith::DivUIOp, arith::RemSIOp, arith::RemUIOp>(
      op);
}

void Widening::widen(Operation *op) {
  loc = op->getLoc();
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return widenIf(branch);
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return widenFor(loop);
  if (auto loop = dyn_cast<scf::WhileOp>(op))
    return widenWhile(loop);
  if (isa<warp::ScratchOp, warp::ScratchLoadOp, warp::ScratchStoreOp>(op))
    return widenScratch(op);
  if (auto load = dyn_cast<warp::LoadComponentsOp>(op))
    return widenLoad(load);
  if (auto store = dyn_cast<warp::StoreComponentsOp>(op))
    return widenStore(store);
  if (auto update = dyn_cast<warp::AtomicComponentsOp>(op))
    return widenUpdate(update);
  if (auto agree = dyn_cast<warp::AgreeOp>(op))
    return widenAgree(agree);
  if (auto trips = dyn_cast<warp::MostTripsOp>(op))
    return widenMostTrips(trips);
  if (auto call = dyn_cast<func::CallOp>(op))
    return widenCall(call);
  bool isConversion = warp::isConversion(op);
  if (!isConversion && !isMemoryEffectFree(op))
    return eachLane(op);
  if (llvm::none_of(op->getResults(), [&](Value v) { return isVarying(v); }))
    return cloneScalar(op);
  if (auto call = dyn_cast<warp::LibraryCallOp>(op))
    return widenLibraryCall(call);
  if (isIntegerDivision(op))
    return widenDivision(op);
  if (isConversion)
    return widenConversion(op);
  widenElementwise(op);
}

/// An operation whose operands all lanes share.
void Widening::cloneScalar(Operation *op) {
  IRMapping map;
  for (Value operand : op->getOperands())
    map.map(operand, scalar(operand) ? scalar(operand) : operand);
  Operation *copy = b.clone(*op, map);
  for (auto [result, made] : llvm::zip(op->getResults(), copy->getResults()))
    setScalar(result, made);
}

/// The same operation on vectors.
void Widening::widenElementwise(Operation *op) {
  SmallVector<Value> operands;
  for (Value operand : op->getOperands()) {
    // A condition that all lanes share chooses whole vectors.
    bool isChoice = isa<arith::SelectOp>(op) && operands.empty();
    operands.push_back(isChoice && !isVarying(operand) ? scalar(operand)
                                                       : vector(operand));
  }
  OperationState state(loc, op->getName());
  state.addOperands(operands);
  state.addAttributes(op->getDiscardableAttrDictionary().getValue());
  state.propertiesAttr = op->getPropertiesAsAttribute();
  for (Type type : op->getResultTypes())
    state.addTypes(lanesOf(type));
  Operation *made = b.create(state);
  for (auto [result, value] : llvm::zip(op->getResults(), made->getResults()))
    setVector(result, value);
  cloneBase(op);
}

/// The first lane's scalar, if the result may be an index.
void Widening::cloneBase(Operation *op) {
  if (op->getNumResults() != 1 || !hasBase(op->getResult(0)))
    return;
  IRMapping map;
  for (Value operand : op->getOperands())
    map.map(operand, scalar(operand));
  setScalar(op->getResult(0), b.clone(*op, map)->getResult(0));
}

/// One call for all lanes, where the library has a form for them.
void Widening::widenLibraryCall(warp::LibraryCallOp op) {
  const warp::LibraryFunction *function =
      warp::findLibraryFunction(op.getCallee());
  if (!function || function->shared < 0 ||
      llvm::any_of(
          op.getArgs().take_front(function->shared),
          [&](Value v) { return isVarying(v); }))
    return eachLane(op);
  Values args;
  for (auto [i, arg] : llvm::enumerate(op.getArgs()))
    args.push_back(int(i) < function->shared ? scalar(arg) : vector(arg));
  SmallVector<Type> types;
  for (Type type : op.getResultTypes())
    types.push_back(lanesOf(type));
  auto call = warp::LibraryCallOp::create(
      b, loc, types, (op.getCallee() + warp::lanesSuffix).str(), args);
  for (auto [result, made] : llvm::zip(op.getResults(), call.getResults()))
    setVector(result, made);
}

/// One call of a function for all lanes.
void Widening::widenCall(func::CallOp op) {
  const LaneFunction *function = calls ? calls->find(op) : nullptr;
  if (!function)
    return cloneScalar(op);
  func::FuncOp wide = function->wide;
  Values args{mask};
  for (auto [operand, type] :
       llvm::zip_equal(op.getOperands(), wide.getArgumentTypes().drop_front()))
    args.push_back(isa<VectorType>(type) ? vector(operand) : scalar(operand));
  auto call = func::CallOp::create(b, loc, wide, args);
  for (auto [result, made] :
       llvm::zip_equal(op.getResults(), call.getResults()))
    setVector(result, made);
}

void Widening::widenAgree(warp::AgreeOp op) {
  Type type = op.getType();
  Value own = vector(op.getOwn()), hint = scalar(op.getHint());
  Value expected = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, own,
                                         broadcast(hint));
  auto branch = scf::IfOp::create(b, loc, type, any(both(mask, expected)),
                                  /*withElseRegion=*/true);
  setScalar(op.getResult(), branch.getResult(0));
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, hint);
  b.setInsertionPointToStart(branch.elseBlock());
  Value most = broadcast(warp::identity(b, loc, warp::AtomicKind::min, type));
  Value least =
      warp::CombineLanesOp::create(b, loc, type, int32_t(warp::AtomicKind::min),
                                   type, choose(mask, own, most));
  scf::YieldOp::create(b, loc, least);
}

/// Unsigned; lanes that are not here have made no trips.
void Widening::widenMostTrips(warp::MostTripsOp op) {
  if (!isVarying(op.getOwn()))
    return setScalar(op.getResult(), scalar(op.getOwn()));
  Type type = op.getType();
  Value none = arith::ConstantOp::create(b, loc, b.getZeroAttr(lanesOf(type)));
  Value most = warp::CombineLanesOp::create(
      b, loc, type, int32_t(warp::AtomicKind::max), type,
      choose(mask, vector(op.getOwn()), none));
  setScalar(op.getResult(), most);
}

/// Floats to integers, saturated and NaN to zero. LLVM has the intrinsics for
/// scalars of x86 alone and would take vectors apart.
void Widening::widenConversion(Operation *op) {
  Value x = vector(op->getOperand(0));
  Type to = op->getResult(0).getType(), type = lanesOf(to);
  auto from = cast<FloatType>(op->getOperand(0).getType());
  bool isSigned =
      cast<LLVM::CallIntrinsicOp>(op).getIntrin().starts_with("llvm.fptosi");
  unsigned bits = to.getIntOrFloatBitWidth();
  auto limit = [&](const APInt &value, arith::CmpFPredicate beyond) {
    APFloat bound(from.getFloatSemantics());
    // Upper ones are the powers of two behind, which all formats have.
    APInt exact = value.sext(bits + 2);
    if (beyond == arith::CmpFPredicate::OGE)
      exact = value.zext(bits + 2) + 1;
    bound.convertFromAPInt(exact, /*IsSigned=*/true,
                           APFloat::rmNearestTiesToEven);
    return std::pair<Value, Value>(
        arith::CmpFOp::create(b, loc, beyond, x,
                              splat(b.getFloatAttr(from, bound))),
        splat(b.getIntegerAttr(to, value)));
  };
  auto [isLow, low] =
      limit(isSigned ? APInt::getSignedMinValue(bits) : APInt(bits, 0),
            arith::CmpFPredicate::OLE);
  auto [isHigh, high] = limit(isSigned ? APInt::getSignedMaxValue(bits)
                                       : APInt::getMaxValue(bits),
                              arith::CmpFPredicate::OGE);
  Value isNumber =
      arith::CmpFOp::create(b, loc, arith::CmpFPredicate::ORD, x, x);
  Value zero = splat(b.getFloatAttr(from, 0));
  Value inside = arith::SelectOp::create(b, loc, isNumber, x, zero);
  inside = arith::SelectOp::create(b, loc, isLow, zero, inside);
  inside = arith::SelectOp::create(b, loc, isHigh, zero, inside);
  Value result =
      isSigned ? arith::FPToSIOp::create(b, loc, type, inside).getResult()
               : arith::FPToUIOp::create(b, loc, type, inside).getResult();
  result = arith::SelectOp::create(b, loc, isLow, low, result);
  result = arith::SelectOp::create(b, loc, isHigh, high, result);
  setVector(op->getResult(0), result);
  cloneBase(op);
}

//===----------------------------------------------------------------------===//
// The whole
//===----------------------------------------------------------------------===//

/// The yields of the lanes: for those that are not live, the neutral element.
Widening::Values Widening::contributions(warp::ThreadsOp threads) {
  Values values;
  for (auto [kind, type, yielded] : llvm::zip_equal(
           threads.getKinds(), threads.getTypes().getAsValueRange<TypeAttr>(),
           threads.getYield()->getOperands())) {
    Value none =
        broadcast(warp::identity(b, loc, warp::AtomicKind(kind), type));
    values.push_back(choose(mask, vector(yielded), none));
  }
  return values;
}

void Widening::run(warp::ThreadsOp threads) {
  b.setInsertionPoint(threads);
  loc = threads.getLoc();
  auto made = warp::ThreadsOp::create(
      b, loc, threads.getResultTypes(), threads.getKindsAttr(),
      threads.getTypesAttr(), b.getI64IntegerAttr(lanes));
  SmallVector<Type> types;
  for (BlockArgument index : threads.getIndices())
    types.push_back(index.getType());
  types.push_back(lanesOf(b.getI1Type()));
  if (Attribute aligned = threads->getAttr(warp::alignedAttr))
    made->setAttr(warp::alignedAttr, aligned);
  body = b.createBlock(&made.getBody(), {}, types,
                       SmallVector<Location>(types.size(), loc));
  mask = body->getArguments().back();
  for (BlockArgument argument : kernel.getArguments())
    setScalar(argument, argument);
  for (auto [index, argument] :
       llvm::zip(threads.getIndices(), body->getArguments()))
    setScalar(index, argument);
  Value last = threads.getIndices().back();
  auto numbers = warp::LaneNumbersOp::create(b, loc, lanesOf(last.getType()));
  setVector(last,
            arith::AddIOp::create(b, loc, broadcast(scalar(last)), numbers));
  widen(*threads.getThread());
  loc = threads.getLoc();
  warp::YieldOp::create(b, loc, contributions(threads));
  threads->replaceAllUsesWith(made);
  threads->erase();
}

void Widening::run(const LaneFunction &function) {
  func::FuncOp scalar = function.scalar, wide = function.wide;
  body = wide.addEntryBlock();
  b.setInsertionPointToStart(body);
  loc = scalar.getLoc();
  mask = body->getArgument(0);
  for (auto [argument, made] : llvm::zip_equal(
           scalar.getArguments(), body->getArguments().drop_front()))
    if (isVarying(argument))
      setVector(argument, made);
    else
      setScalar(argument, made);
  widen(scalar.front());
  Operation *end = scalar.front().getTerminator();
  loc = end->getLoc();
  Values results;
  for (Value value : end->getOperands())
    results.push_back(vector(value));
  func::ReturnOp::create(b, loc, results);
}

/// Updates of what lanes have come to together are one. The order of a
/// deterministic launch stays.
static void combineWhereLanesMeet(FunctionOpInterface kernel,
                                  const warp::ThreadVariance &variance) {
  if (warp::getVariant(kernel).isDeterministic())
    return;
  auto isShared = [&](Value value) {
    return variance.isUniform(value, warp::Scope::Lanes);
  };
  kernel->walk([&](warp::AtomicComponentsOp op) {
    warp::UpdateScope scope = warp::getUpdate(op).getScope();
    bool isOpen =
        scope == warp::UpdateScope::thread || scope == warp::UpdateScope::lanes;
    if (isOpen && !warp::getUpdate(op).isExact() && isShared(op.getArray()) &&
        llvm::all_of(op.getIndices(), isShared) && warp::canCombine(op))
      warp::setUpdate(op, warp::UpdateScope::lanes);
  });
}

namespace {

struct WidenThreads : warp::impl::WidenThreadsBase<WidenThreads> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    warp::ThreadsOp threads = warp::findThreads(kernel);
    if (!threads || warp::getVariant(kernel).getDebug())
      return;
    if (warp::getTarget(kernel).isSimt()) {
      if (!warp::updatesInStep(kernel))
        warp::leaveStep(kernel);
      return;
    }
    if (kernel->hasAttr(warp::attr::blockThreads))
      return warp::noteChoice(kernel, "lanes", "1",
                              "loops over elements of tiles have them");
    warp::foldViews(kernel);
    if (kernel->hasAttr(warp::attr::keepsCalls))
      return widenWithCalls(kernel, threads);
    warp::carryElements(kernel);
    warp::joinFields(kernel);
    warp::ThreadVariance variance(kernel);
    warp::LanePlan plan =
        choose(kernel, warp::planLanes(kernel, threads, variance));
    if (plan.lanes == 1)
      return;
    if (plan.isAligned)
      threads->setAttr(warp::alignedAttr, UnitAttr::get(kernel->getContext()));
    if (warp::shareRuns(kernel, variance) || plan.isAligned) {
      warp::ThreadVariance together(kernel, std::nullopt,
                                    plan.isAligned ? plan.lanes : 0);
      combineWhereLanesMeet(kernel, together);
      Widening(kernel, together, plan.lanes).run(threads);
    } else {
      Widening(kernel, variance, plan.lanes).run(threads);
    }
  }

  /// Lanes of a kernel that keeps functions call these together.
  static void widenWithCalls(FunctionOpInterface kernel,
                             warp::ThreadsOp threads) {
    warp::LanePlan plan;
    if (warp::getVariant(kernel).getLanes() == 1) {
      plan.reason = "asked for";
      choose(kernel, plan);
      return;
    }
    warp::LaneCalls calls(kernel);
    plan.reason = calls.find();
    if (plan.reason.empty())
      plan = warp::planLanes(kernel, threads, calls.getVariance(), &calls);
    if (choose(kernel, plan).lanes > 1) {
      calls.declare(plan.lanes);
      for (auto &function : calls.functions())
        Widening(kernel, *function->variance, plan.lanes, &calls)
            .run(*function);
      Widening(kernel, calls.getVariance(), plan.lanes, &calls).run(threads);
    }
    calls.finish();
  }

  /// Tells the launch of a choice.
  static warp::LanePlan choose(FunctionOpInterface kernel,
                               warp::LanePlan plan) {
    warp::noteChoice(kernel, "lanes", Twine(plan.lanes), plan.reason);
    int facts = (plan.dependsOnRows ? warp::innerExtentFact : 0) |
                (plan.dependsOnFarRows ? warp::farRowsFact : 0) |
                (plan.dependsOnFew ? warp::underfilledFact : 0);
    if (facts)
      warp::setSchedule(kernel, warp::getSchedule(kernel).withSizeFacts(facts));
    if (plan.lanes == 1)
      warp::leaveStep(kernel);
    else
      warp::setSchedule(kernel,
                        warp::getSchedule(kernel).withLanes(plan.lanes));
    return plan;
  }
};

} // namespace
