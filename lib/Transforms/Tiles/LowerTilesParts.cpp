//===- LowerTilesParts.cpp - What threads hold, and parts of tiles --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Threads
//===----------------------------------------------------------------------===//

void TileLowering::lowerFromThreads(TileFromThreadsOp op) {
  TileType type = tileType(op.getResult());
  Value number = thread ? thread : this->number(0);
  bool isWhole = type.getElementType() == op.getValue().getType();
  for (auto &component : componentsOf(type)) {
    Values indices, parts;
    for (int64_t i : component) {
      indices.push_back(this->number(i));
      parts.push_back(constant(b.getIntegerType(32, true), i));
    }
    indices.push_back(number);
    Value value = op.getValue();
    if (!isWhole)
      value = ExtractOp::create(b, loc, type.getElementType(), value, parts);
    store(op.getResult(), indices, value);
  }
}

void TileLowering::lowerToThreads(TileToThreadsOp op) {
  TileType type = tileType(op.getTile());
  int64_t extent = type.getShape().back();
  Value index = thread ? thread : number(0), exists;
  if (thread && extent < threads)
    exists = less(thread, number(extent));
  Type result = op.getType();
  Value value = ifHolds(exists, result, [&]() -> Value {
    Values parts;
    for (auto &component : componentsOf(type)) {
      Values indices;
      for (int64_t i : component)
        indices.push_back(number(i));
      indices.push_back(index);
      parts.push_back(element(op.getTile(), indices));
    }
    if (type.getElementType() == result)
      return parts[0];
    return ConstructOp::create(b, loc, result, parts);
  });
  op.getResult().replaceAllUsesWith(value);
}

//===----------------------------------------------------------------------===//
// Parts
//===----------------------------------------------------------------------===//

void TileLowering::begin(Operation *op, Value tile) {
  if (op->hasAttr(attr::inPlace))
    return;
  Value result = op->getResult(0);
  share(tileType(tile).getShape(), [&](ValueRange indices) {
    store(result, indices, element(tile, indices));
  });
  barrier();
}

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

Value TileLowering::toPlace(Value index, int64_t extent) {
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

void TileLowering::lowerGet(TileGetOp op) {
  Values indices;
  for (auto [index, extent] :
       llvm::zip_equal(op.getIndices(), tileType(op.getTile()).getShape()))
    indices.push_back(toPlace(index, extent));
  testing = true;
  op.getResult().replaceAllUsesWith(element(op.getTile(), indices));
}

static constexpr StringLiteral updateNames[] = {
    "", "add", "sub", "bit_and", "bit_or", "bit_xor", "min", "max"};

/// Changes a part of an element in memory, so that threads may change others.
void TileLowering::updatePart(TileSetOp op, ValueRange indices) {
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

void TileLowering::lowerSet(TileSetOp op) {
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

void TileLowering::lowerInsert(TileInsertOp op) {
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

void TileLowering::lowerGather(TileGatherOp op) {
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

void TileLowering::lowerScatter(TileScatterOp op) {
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

} // namespace warp::tiles
