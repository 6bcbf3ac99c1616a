//===- Parts.cpp - Models of element and subtile operations ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Code
//===----------------------------------------------------------------------===//

namespace {

struct PartLowering : TileLowering {
  using TileLowering::TileLowering;
  void get(TileGetOp op);
  void set(TileSetOp op);
  void insert(TileInsertOp op);
  void gather(TileGatherOp op);
  void scatter(TileScatterOp op);

private:
  /// An index that counts from the end if it is below zero, as an i32.
  Value toPlace(Value index, int64_t extent);
  void updatePart(TileSetOp op, ValueRange indices);
};

} // namespace

/// True if an index is known not to be below zero.
static bool isFromStart(Value index) {
  if (index.getType().isUnsignedInteger())
    return true;
  APInt number;
  if (matchPattern(index, m_ConstantInt(&number)))
    return number.isNonNegative();
  Operation *def = index.getDefiningOp();
  if (!def) {
    auto loop = dyn_cast<scf::ForOp>(index.getParentBlock()->getParentOp());
    return loop && index == loop.getInductionVar() &&
           isFromStart(loop.getLowerBound());
  }
  if (isa<TidOp, ThreadNumberOp, LaunchExtentOp, DimOp>(def))
    return true;
  StringRef name = def->getName().stripDialect();
  return (isa<CastOp>(def) && isInteger(def->getOperand(0).getType())
              ? getByteSize(def->getOperand(0).getType()) <=
                    getByteSize(index.getType())
              : llvm::is_contained({"add", "mul", "floordiv", "mod", "min"},
                                   name)) &&
         llvm::all_of(def->getOperands(), isFromStart);
}

Value PartLowering::toPlace(Value index, int64_t extent) {
  Value place = toIndex(index);
  if (isFromStart(index))
    return place;
  Value fromEnd = add(place, number(extent));
  APInt known;
  if (matchPattern(index, m_ConstantInt(&known)))
    return fromEnd;
  return arith::SelectOp::create(b, loc, less(place, number(0)), fromEnd,
                                 place);
}

void PartLowering::get(TileGetOp op) {
  Values indices;
  for (auto [index, extent] :
       llvm::zip_equal(op.getIndices(), tileType(op.getTile()).getShape()))
    indices.push_back(toPlace(index, extent));
  state.testing = true;
  op.getResult().replaceAllUsesWith(element(op.getTile(), indices));
}

static constexpr StringLiteral updateNames[] = {
    "", "add", "sub", "bit_and", "bit_or", "bit_xor", "min", "max"};

/// Changes a part of an element in memory, so that threads may change others.
void PartLowering::updatePart(TileSetOp op, ValueRange indices) {
  Value place = placeIn(op.getResult(), indices);
  Value view = memoryOf(op.getResult());
  Type type = tileType(op.getTile()).getElementType();
  ValueRange components = op.getComponents();
  for (Attribute step : op.getPathAttr()) {
    auto field = dyn_cast<StringAttr>(step);
    size_t count = field ? 0 : cast<IntegerAttr>(step).getInt();
    type = field ? getFieldType(type, field) : getIndexedType(type, count);
    view =
        ComponentViewOp::create(b, loc, ArrayType::get(b.getContext(), 1, type),
                                view, components.take_front(count), field);
    components = components.drop_front(count);
  }
  Value value = op.getValue();
  if (op.getKind() == TileUpdate::assign) {
    StoreOp::create(b, loc, value, view, place);
  } else if (threads > 1 || isa<StructType>(value.getType())) {
    update(op.getKind(), value, view, place);
  } else {
    Value old = LoadOp::create(b, loc, value.getType(), view, place);
    Value made = builtin(updateNames[unsigned(op.getKind())], {old, value});
    StoreOp::create(b, loc, made, view, place);
  }
}

void PartLowering::set(TileSetOp op) {
  begin(op, op.getTile());
  TileType type = tileType(op.getTile());
  Value inside = op.getWhere();
  Values indices;
  for (auto [index, extent] :
       llvm::zip_equal(op.getIndices(), type.getShape())) {
    indices.push_back(toPlace(index, extent));
    inside =
        both(inside, arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                           indices.back(), number(extent)));
  }
  ifHolds(inside, [&] {
    Value result = op.getResult();
    if (op.getPath())
      return updatePart(op, indices);
    if (op.getKind() == TileUpdate::assign)
      return store(result, indices, op.getValue());
    if (threads > 1 || isa<StructType>(type.getElementType())) {
      update(op.getKind(), op.getValue(), memoryOf(result),
             placeIn(result, indices));
      return;
    }
    Value old = load(result, indices);
    store(result, indices,
          builtin(updateNames[unsigned(op.getKind())], {old, op.getValue()}));
  });
}

void PartLowering::insert(TileInsertOp op) {
  begin(op, op.getTile());
  TileType part = tileType(op.getPart()), whole = tileType(op.getTile());
  elements(op, part.getShape(), [&](ValueRange indices) {
    Values at;
    Value inside;
    for (auto [d, index] : llvm::enumerate(indices)) {
      int64_t step = op.getSteps()[d];
      Value offset = op.getOffsets()[d];
      at.push_back(add(toIndex(offset), mul(index, number(step))));
      auto known = offset.getDefiningOp<ConstantOp>();
      auto start =
          known ? dyn_cast<IntegerAttr>(known.getValue()) : IntegerAttr();
      int64_t extent = whole.getShape()[d];
      if (start) {
        int64_t first = start.getValue().getSExtValue();
        int64_t last = first + step * (part.getShape()[d] - 1);
        if (first >= 0 && last >= 0 && first < extent && last < extent)
          continue;
      }
      inside =
          both(inside, arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                             at.back(), number(extent)));
    }
    Value value = element(op.getPart(), indices);
    ifHolds(inside, [&] { store(op.getResult(), at, value); });
  });
}

void PartLowering::gather(TileGatherOp op) {
  TileType type = tileType(op.getResult()), from = tileType(op.getTile());
  share(type.getShape(), [&](ValueRange indices) {
    Value position = toIndex(element(op.getPositions(), indices));
    Value inside =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult, position,
                              number(from.getNumElements()));
    store(op.getResult(), indices,
          ifHolds(inside, type.getElementType(), [&]() -> Value {
            return element(op.getTile(), unravel(position, from.getShape()));
          }));
  });
}

void PartLowering::scatter(TileScatterOp op) {
  begin(op, op.getTile());
  TileType part = tileType(op.getPart()), whole = tileType(op.getTile());
  Type type = whole.getElementType();
  share(part.getShape(), [&](ValueRange indices) {
    Value position = toIndex(element(op.getPositions(), indices));
    Value value = element(op.getPart(), indices);
    Value inside =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult, position,
                              number(whole.getNumElements()));
    Value memory = memoryOf(op.getResult());
    ifHolds(inside, [&] {
      if (threads > 1) {
        AtomicOp::create(b, loc, type, AtomicKind::add, value, memory,
                         position);
        return;
      }
      Value old = LoadOp::create(b, loc, type, memory, position);
      StoreOp::create(b, loc, builtin("add", {old, value}), memory, position);
    });
  });
}

//===----------------------------------------------------------------------===//
// Adjoints
//===----------------------------------------------------------------------===//

namespace {

struct PartAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult set(TileSetOp set);

private:
  Value partOf(Value element, ArrayAttr path, ValueRange components);
};

} // namespace

/// The part of an element that a path leads to, which has no structs left.
Value PartAdjoint::partOf(Value element, ArrayAttr path,
                          ValueRange components) {
  for (Attribute step : path) {
    if (auto field = dyn_cast<StringAttr>(step)) {
      element = apply(field.getValue() == "p" ? "transform_get_translation"
                                              : "transform_get_rotation",
                      {element});
      continue;
    }
    size_t count = cast<IntegerAttr>(step).getInt();
    element =
        ExtractOp::create(b, loc, getIndexedType(element.getType(), count),
                          element, components.take_front(count));
    components = components.drop_front(count);
  }
  return element;
}

LogicalResult PartAdjoint::set(TileSetOp set) {
  Value g = take();
  if (!g)
    return success();
  Type element = typeOf(g).getElementType();
  SmallVector<Value> at = recover(set.getIndices());
  Value where = recoverOptional(set.getWhere());
  bool assigns = set.getKind() == TileUpdate::assign;
  bool subtracts = set.getKind() == TileUpdate::sub;
  if (!assigns && !subtracts && set.getKind() != TileUpdate::add)
    return op->emitError("an update other than a sum has no derivative");
  SmallVector<Value> components = recover(set.getComponents());
  ArrayAttr path = set.getPathAttr();
  Type type = path ? getPartType(element, path) : element;
  if (wants(set.getValue())) {
    Value part = TileGetOp::create(b, loc, element, g, at);
    if (path)
      part = partOf(part, path, components);
    if (where)
      part = apply("where", {where, part, zeroOf(type)});
    give(set.getValue(), subtracts ? apply("neg", part) : part);
  }
  if (assigns)
    g = TileSetOp::create(b, loc, g.getType(), TileUpdate::assign, zeroOf(type),
                          g, at, components, where, path);
  give(set.getTile(), g);
  return success();
}

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

struct GetModel : TileModel<GetModel, TileGetOp> {
  TileRead getRead(Operation *, OpOperand &) const { return TileRead::Once; }
  bool readsElements(Operation *, OpOperand &) const { return true; }
  void lower(Operation *op, TileLowering &lowering) const {
    PartLowering(lowering.state).get(cast<TileGetOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto get = cast<TileGetOp>(op);
    Value g = reverse.take();
    if (!g)
      return success();
    Value none = reverse.zeroOf(reverse.cotangentType(get.getTile()));
    reverse.give(get.getTile(),
                 TileSetOp::create(reverse.b, reverse.loc, none.getType(),
                                   TileUpdate::add, g, none,
                                   reverse.recover(get.getIndices()), Value()));
    return success();
  }
};

struct SetModel : TileModel<SetModel, TileSetOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  void lower(Operation *op, TileLowering &lowering) const {
    PartLowering(lowering.state).set(cast<TileSetOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return PartAdjoint(reverse.reverse, op).set(cast<TileSetOp>(op));
  }
};

struct InsertModel : TileModel<InsertModel, TileInsertOp> {
  TileRead getRead(Operation *, OpOperand &) const { return TileRead::Once; }
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  void lower(Operation *op, TileLowering &lowering) const {
    PartLowering(lowering.state).insert(cast<TileInsertOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto insert = cast<TileInsertOp>(op);
    Value g = reverse.take();
    if (!g)
      return success();
    OpBuilder &b = reverse.b;
    SmallVector<Value> at = reverse.recover(insert.getOffsets());
    TileType part = reverse.cotangentType(insert.getPart());
    reverse.give(insert.getPart(), TileSliceOp::create(b, reverse.loc, part, g,
                                                       at, insert.getSteps()));
    reverse.give(insert.getTile(),
                 TileInsertOp::create(b, reverse.loc, g.getType(),
                                      reverse.zeroOf(part), g, at,
                                      insert.getSteps()));
    return success();
  }
};

struct GatherModel : TileModel<GatherModel, TileGatherOp> {
  void lower(Operation *op, TileLowering &lowering) const {
    PartLowering(lowering.state).gather(cast<TileGatherOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto gather = cast<TileGatherOp>(op);
    Value g = reverse.take();
    if (!g)
      return success();
    Value none = reverse.zeroOf(reverse.cotangentType(gather.getTile()));
    reverse.give(
        gather.getTile(),
        TileScatterOp::create(reverse.b, reverse.loc, none.getType(), g, none,
                              reverse.reverse.recover(gather.getPositions())));
    return success();
  }
};

struct ScatterModel : TileModel<ScatterModel, TileScatterOp> {
  SmallVector<unsigned> getReplaceableOperands(Operation *) const {
    return {1};
  }
  void lower(Operation *op, TileLowering &lowering) const {
    PartLowering(lowering.state).scatter(cast<TileScatterOp>(op));
  }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    auto scatter = cast<TileScatterOp>(op);
    Value g = reverse.take();
    if (!g)
      return success();
    reverse.give(
        scatter.getPart(),
        TileGatherOp::create(reverse.b, reverse.loc,
                             reverse.cotangentType(scatter.getPart()), g,
                             reverse.reverse.recover(scatter.getPositions())));
    reverse.give(scatter.getTile(), g);
    return success();
  }
};

} // namespace

void attachParts(MLIRContext &context) {
  TileGetOp::attachInterface<GetModel>(context);
  TileSetOp::attachInterface<SetModel>(context);
  TileInsertOp::attachInterface<InsertModel>(context);
  TileGatherOp::attachInterface<GatherModel>(context);
  TileScatterOp::attachInterface<ScatterModel>(context);
}

} // namespace warp::tiles
