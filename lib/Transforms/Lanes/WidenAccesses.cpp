//===- WidenAccesses.cpp - Memory accesses of lanes -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes whose elements follow each other in a packed array access them as
// vectors; other elements are gathered and scattered. An update of one element
// by all lanes is one update by what they have together, an update of
// neighbours in code that runs alone is a load and a store. An access without a
// form for lanes is done lane by lane, in their order.
//
//===----------------------------------------------------------------------===//

#include "Widening.h"

#include "Analysis/Ranges.h"
#include "KernelFunction.h"
#include "LanePlan.h"
#include "Neighbours.h"
#include "RowRuns.h"
#include "Updates/Atomics.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::Widening;

/// Components of an element that are worth taking apart in registers.
constexpr size_t mostComponents = 16;
/// Elements of which one is taken.
constexpr int64_t largestStride = 4;

/// True if the elements of the last dimension follow each other.
static bool isPacked(Value array) {
  while (Operation *op = array.getDefiningOp()) {
    if (!isa<warp::ViewOp, warp::GradOp>(op))
      return false;
    array = op->getOperand(0);
  }
  auto argument = cast<BlockArgument>(array);
  auto function =
      dyn_cast<FunctionOpInterface>(argument.getOwner()->getParentOp());
  return function &&
         function.getArgAttr(argument.getArgNumber(), warp::attr::packed);
}

/// True if an element is a few numbers of one size without gaps.
static bool isDense(Type element) {
  SmallVector<warp::Leaf> leaves;
  warp::collectLeaves(element, 0, leaves);
  int64_t size = warp::getByteSize(leaves[0].type);
  for (auto [i, leaf] : llvm::enumerate(leaves))
    if (isa<warp::ArrayType>(leaf.type) ||
        warp::getByteSize(leaf.type) != size ||
        leaf.offset != int64_t(i) * size)
      return false;
  return leaves.size() <= mostComponents &&
         warp::getByteSize(element) == int64_t(leaves.size()) * size;
}

bool warp::hasDenseElements(Value array) {
  return isPacked(array) &&
         isDense(cast<warp::ArrayType>(array.getType()).getElementType());
}

bool warp::isPartOfPacked(Value array) {
  if (hasDenseElements(array))
    return false;
  while (auto part = array.getDefiningOp<warp::ComponentViewOp>())
    array = part.getArray();
  return isPacked(array);
}

/// By how many elements of a packed last dimension lanes are apart; 0 if that
/// is not known or not worth whole vectors.
int64_t Widening::unitStride(Value array, ValueRange indices, Block *where) {
  int64_t stride =
      indices.empty() ? 0 : variance.step(indices.back()).value_or(0);
  bool fits = stride >= 1 && stride <= largestStride &&
              warp::hasDenseElements(array) &&
              llvm::none_of(indices.drop_back(),
                            [&](Value index) { return isVarying(index); }) &&
              warp::isNonNegative(indices.back(), where);
  return fits ? stride : 0;
}

Widening::Values Widening::accessIndices(ValueRange indices,
                                         warp::LaneForm form) {
  Values made;
  for (Value index : indices) {
    bool isOne = form == warp::LaneForm::unit || !isVarying(index);
    made.push_back(isOne ? scalar(index) : vector(index));
  }
  return made;
}

SmallVector<bool> Widening::nonNegative(ValueRange indices, Block *where) {
  return llvm::map_to_vector(
      indices, [&](Value index) { return warp::isNonNegative(index, where); });
}

/// Has lanes ask whether their elements follow each other, if they mostly do.
void Widening::markNeighbours(Operation *access, Value array,
                              ValueRange indices) {
  if (warp::hasDenseElements(array) &&
      warp::areMostlyNeighbours(indices, variance))
    access->setAttr(warp::attr::neighbours, b.getUnitAttr());
}

void Widening::widenLoad(warp::LoadComponentsOp op) {
  if (llvm::none_of(op.getComponents(), [&](Value v) { return isVarying(v); }))
    return cloneScalar(op);
  auto run = together.find(op->getParentOp());
  if (run != together.end() && run->second.first > 1 &&
      warp::isRowLoad(op, variance))
    return loadOfRun(op);
  Block *where = op->getBlock();
  int64_t stride = unitStride(op.getArray(), op.getIndices(), where);
  warp::LaneForm form = stride ? warp::LaneForm::unit : warp::LaneForm::gather;
  SmallVector<Type> types;
  for (Type type : op.getResultTypes())
    types.push_back(lanesOf(type));
  auto load = warp::LoadLanesOp::create(
      b, loc, types, scalar(op.getArray()),
      accessIndices(op.getIndices(), form), mask, form,
      nonNegative(op.getIndices(), where), std::max<int64_t>(stride, 1));
  if (!stride)
    markNeighbours(load, op.getArray(), op.getIndices());
  for (auto [result, made] :
       llvm::zip_equal(op.getComponents(), load.getComponents()))
    setVector(result, made);
}

/// Indices of the first element, in memory, of a run; at the first of its
/// iterations.
Widening::Values Widening::indicesOfRun(warp::AccessOp op, int64_t count) {
  Values indices = accessIndices(op.getIndices(), warp::LaneForm::gather);
  if (warp::paceAlongRow(op, variance) == 1)
    return indices;
  Value &last = indices.back();
  Type type = last.getType();
  Attribute back = b.getIntegerAttr(getElementTypeOrSelf(type), count - 1);
  if (auto lanes = dyn_cast<VectorType>(type))
    back = DenseElementsAttr::get(lanes, back);
  last = arith::SubIOp::create(
      b, loc, last, arith::ConstantOp::create(b, loc, cast<TypedAttr>(back)));
  return indices;
}

/// The first of the iterations that are together loads for all of them.
void Widening::loadOfRun(warp::LoadComponentsOp op) {
  auto [count, number] = together.lookup(op->getParentOp());
  auto access = cast<warp::AccessOp>(op.getOperation());
  Values &loaded = runs[op];
  if (number == 0) {
    SmallVector<Type> types(count, lanesOf(op.getResultTypes().front()));
    auto load = warp::LoadLanesOp::create(
        b, loc, types, scalar(op.getArray()), indicesOfRun(access, count), mask,
        warp::LaneForm::gather, nonNegative(op.getIndices(), op->getBlock()),
        /*stride=*/1);
    load->setAttr(warp::attr::run, b.getI64IntegerAttr(count));
    loaded = Values(load.getComponents());
    if (warp::paceAlongRow(access, variance) != 1)
      std::reverse(loaded.begin(), loaded.end());
  }
  setVector(op.getComponents().front(), loaded[number]);
}

/// The last of the iterations that are together stores what all of them have.
void Widening::storeOfRun(warp::StoreComponentsOp op) {
  auto [count, number] = together.lookup(op->getParentOp());
  auto access = cast<warp::AccessOp>(op.getOperation());
  Values &stored = runs[op], &indices = runIndices[op];
  if (number == 0) {
    stored.clear();
    indices = indicesOfRun(access, count);
  }
  stored.push_back(vector(op.getComponents().front()));
  if (number + 1 < count)
    return;
  if (warp::paceAlongRow(access, variance) != 1)
    std::reverse(stored.begin(), stored.end());
  auto store = warp::StoreLanesOp::create(
      b, loc, stored, scalar(op.getArray()), indices, mask,
      warp::LaneForm::gather, nonNegative(op.getIndices(), op->getBlock()),
      /*stride=*/1);
  store->setAttr(warp::attr::run, b.getI64IntegerAttr(count));
}

void Widening::widenStore(warp::StoreComponentsOp op) {
  auto run = together.find(op->getParentOp());
  if (run != together.end() && run->second.first > 1 &&
      warp::isRowStore(op, variance))
    return storeOfRun(op);
  bool isOnePlace = llvm::none_of(
      op.getIndices(), [&](Value index) { return isVarying(index); });
  if (isOnePlace) {
    bool isOneValue = llvm::none_of(op.getComponents(),
                                    [&](Value v) { return isVarying(v); });
    return isOneValue ? cloneScalar(op) : eachLane(op);
  }
  Block *where = op->getBlock();
  int64_t stride = unitStride(op.getArray(), op.getIndices(), where);
  warp::LaneForm form = stride ? warp::LaneForm::unit : warp::LaneForm::gather;
  Values components;
  for (Value component : op.getComponents())
    components.push_back(vector(component));
  warp::StoreLanesOp::create(b, loc, components, scalar(op.getArray()),
                             accessIndices(op.getIndices(), form), mask, form,
                             nonNegative(op.getIndices(), where),
                             std::max<int64_t>(stride, 1));
}

//===----------------------------------------------------------------------===//
// Updates
//===----------------------------------------------------------------------===//

/// One update by what all lanes have together.
void Widening::updateTogether(warp::AtomicComponentsOp op, ValueRange indices) {
  warp::AtomicKind kind = warp::combiningKind(op.getKind());
  Values totals;
  for (auto [leaf, value] :
       llvm::zip_equal(warp::leavesOf(op), op.getComponents())) {
    Value none = broadcast(warp::identity(b, loc, kind, leaf.type));
    Value term = vector(value);
    if (op.getKind() != kind)
      term = warp::negate(b, loc, term);
    totals.push_back(warp::CombineLanesOp::create(b, loc, value.getType(),
                                                  int32_t(kind), leaf.type,
                                                  choose(mask, term, none)));
  }
  warp::AtomicComponentsOp::create(b, loc, op.getResultTypes(), kind, totals,
                                   scalar(op.getArray()), indices);
}

/// Asks first whether all lanes are at one element.
void Widening::updateMaybeTogether(warp::AtomicComponentsOp op) {
  Values first;
  Value isOne;
  for (Value index : op.getIndices()) {
    if (!isVarying(index)) {
      first.push_back(scalar(index));
      continue;
    }
    Type type = index.getType();
    auto end = [&](warp::AtomicKind kind) -> Value {
      Value none = broadcast(warp::identity(b, loc, kind, type));
      return warp::CombineLanesOp::create(b, loc, type, int32_t(kind), type,
                                          choose(mask, vector(index), none));
    };
    Value least = end(warp::AtomicKind::min), most = end(warp::AtomicKind::max);
    first.push_back(least);
    Value agree =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, least, most);
    isOne = isOne ? both(isOne, agree) : agree;
  }
  auto branch = scf::IfOp::create(b, loc, isOne, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  updateTogether(op, first);
  b.setInsertionPointToStart(branch.elseBlock());
  updateOneByOne(op);
}

void Widening::updateOneByOne(warp::AtomicComponentsOp op) {
  Values components;
  for (Value component : op.getComponents())
    components.push_back(vector(component));
  auto update = warp::UpdateLanesOp::create(
      b, loc, op.getKind(), components, scalar(op.getArray()),
      accessIndices(op.getIndices(), warp::LaneForm::gather), mask,
      nonNegative(op.getIndices(), op->getBlock()));
  auto isSimilar = [&](warp::Leaf leaf) {
    return warp::getSignless(leaf.type) == op.getComponents()[0].getType();
  };
  if (llvm::all_of(warp::leavesOf(op), isSimilar))
    markNeighbours(update, op.getArray(), op.getIndices());
}

void Widening::widenUpdate(warp::AtomicComponentsOp op) {
  warp::UpdateAttr plan = warp::getUpdate(op);
  if (plan.getScope() == warp::UpdateScope::lanes && plan.getRun() == 0)
    return updateTogether(
        op, accessIndices(op.getIndices(), warp::LaneForm::gather));
  Block *where = op->getBlock();
  if (plan.isExact() || !op->use_empty())
    return eachLane(op);
  if (plan.getRun() >= lanes)
    return updateMaybeTogether(op);
  int64_t stride = unitStride(op.getArray(), op.getIndices(), where);
  if (!warp::getSchedule(kernel).getExclusive() || stride == 0)
    return updateOneByOne(op);
  // Lanes do not conflict, and there is no other thread.
  SmallVector<Type> types;
  for (Type type : op.getResultTypes())
    types.push_back(lanesOf(type));
  Values indices = accessIndices(op.getIndices(), warp::LaneForm::unit);
  SmallVector<bool> isRight = nonNegative(op.getIndices(), where);
  auto old =
      warp::LoadLanesOp::create(b, loc, types, scalar(op.getArray()), indices,
                                mask, warp::LaneForm::unit, isRight, stride);
  Values sums;
  for (auto [leaf, before, value] : llvm::zip_equal(
           warp::leavesOf(op), old.getComponents(), op.getComponents()))
    sums.push_back(
        warp::combine(b, loc, op.getKind(), before, vector(value), leaf.type));
  warp::StoreLanesOp::create(b, loc, sums, scalar(op.getArray()), indices, mask,
                             warp::LaneForm::unit, isRight, stride);
}

//===----------------------------------------------------------------------===//
// Lane by lane
//===----------------------------------------------------------------------===//

void Widening::eachLane(Operation *op) {
  Values inputs;
  SmallVector<Value> varying;
  for (Value operand : op->getOperands())
    if (isVarying(operand) && !llvm::is_contained(varying, operand)) {
      varying.push_back(operand);
      inputs.push_back(vector(operand));
    }
  SmallVector<Type> types, results;
  for (Value operand : varying)
    types.push_back(operand.getType());
  for (Value result : op->getResults())
    if (!result.use_empty())
      results.push_back(lanesOf(result.getType()));
  auto each = warp::EachLaneOp::create(b, loc, results, mask, inputs);
  OpBuilder::InsertionGuard guard(b);
  Block *body = b.createBlock(&each.getBody(), {}, types,
                              SmallVector<Location>(types.size(), loc));
  IRMapping map;
  for (Value operand : op->getOperands())
    if (Value one = isVarying(operand) ? Value() : scalar(operand))
      map.map(operand, one);
  map.map(ValueRange(varying), body->getArguments());
  Operation *copy = b.clone(*op, map);
  Values yielded;
  unsigned next = 0;
  for (auto [result, made] : llvm::zip(op->getResults(), copy->getResults()))
    if (!result.use_empty()) {
      yielded.push_back(made);
      setVector(result, each.getResult(next++));
    }
  warp::YieldOp::create(b, loc, yielded);
}

//===----------------------------------------------------------------------===//
// Scratch memory
//===----------------------------------------------------------------------===//

Value Widening::slotOf(Value index) {
  if (!isVarying(index))
    return scalar(index);
  return choose(mask, vector(index),
                splat(b.getIntegerAttr(index.getType(), 0)));
}

/// A slot holds a value per lane, or one for all. Lanes may use different
/// slots; one that is not live must not leave the memory.
void Widening::widenScratch(Operation *op) {
  bool isOne =
      llvm::none_of(op->getOperands(), [&](Value v) { return isVarying(v); }) &&
      llvm::none_of(op->getResults(), [&](Value v) { return isVarying(v); });
  if (isOne)
    return cloneScalar(op);
  if (auto scratch = dyn_cast<warp::ScratchOp>(op)) {
    auto type = cast<warp::ScratchType>(scratch.getType());
    auto wide = warp::ScratchType::get(b.getContext(), type.getSlots(),
                                       lanesOf(type.getElementType()));
    setScalar(scratch, warp::ScratchOp::create(b, loc, wide));
    return;
  }
  if (auto load = dyn_cast<warp::ScratchLoadOp>(op)) {
    setVector(load, warp::ScratchLoadOp::create(b, loc, lanesOf(load.getType()),
                                                scalar(load.getScratch()),
                                                slotOf(load.getIndex())));
    return;
  }
  auto store = cast<warp::ScratchStoreOp>(op);
  Value memory = scalar(store.getScratch()), slot = slotOf(store.getIndex());
  Value value = vector(store.getValue());
  Value old =
      warp::ScratchLoadOp::create(b, loc, value.getType(), memory, slot);
  warp::ScratchStoreOp::create(b, loc, choose(mask, value, old), memory, slot);
}
