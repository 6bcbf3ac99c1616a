//===- AbsentThreads.cpp - Masking of absent threads ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "AbsentThreads.h"

#include "WarpDialect/Registry.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::tiles {

bool isOfThreads(Value tile) {
  Operation *def = tile.getDefiningOp();
  if (auto from = dyn_cast_or_null<TileFromThreadsOp>(def))
    return tileType(tile).getRank() == 1;
  auto map = dyn_cast_or_null<TileMapOp>(def);
  return map && llvm::any_of(map.getInputs(), [](Value input) {
           return isTile(input) && isOfThreads(input);
         });
}

Type nowhereType(Type index) {
  bool isWide = getByteSize(index) > 4;
  return IntegerType::get(index.getContext(), isWide ? 64 : 32,
                          IntegerType::Signed);
}

Value makeNowhere(OpBuilder &b, Location loc, Type type) {
  unsigned width = type.getIntOrFloatBitWidth();
  return ConstantOp::create(
      b, loc, b.getIntegerAttr(type, APInt::getSignedMinValue(width)));
}

Value pickedOrNowhere(OpBuilder &b, Location loc, Value picked, Value alive) {
  TileType from = tileType(picked);
  Type type = nowhereType(from.getElementType());
  auto map = TileMapOp::create(
      b, loc, TypeRange(TileType::get(b.getContext(), from.getShape(), type)),
      ValueRange{picked, alive});
  OpBuilder::InsertionGuard guard(b);
  Block *body = b.createBlock(
      &map.getBody(), {}, {from.getElementType(), b.getI1Type()}, {loc, loc});
  Value index = body->getArgument(0);
  if (index.getType() != type)
    index = CastOp::create(b, loc, type, index);
  Value place =
      createBuiltin(b, loc, "where",
                    {body->getArgument(1), index, makeNowhere(b, loc, type)})
          ->getResult(0);
  TileYieldOp::create(b, loc, place);
  return map.getResult(0);
}

Value orElse(OpBuilder &b, Location loc, Value condition, Value value,
             function_ref<Value()> other) {
  auto branch = scf::IfOp::create(b, loc, TypeRange(value.getType()), condition,
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, value);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, other());
  return branch.getResult(0);
}

void maskAccess(TileAccessOp op, Value alive,
                function_ref<bool(Value)> differs) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  if (Value picked = op.getPicked(); picked && isOfThreads(picked)) {
    op.getPickedMutable().assign(pickedOrNowhere(b, loc, picked, alive));
    op.setChecked(true);
  }
  if (!differs(op.getArray()) && llvm::none_of(op.getOffsets(), differs))
    return;
  OpOperand &first = op.getOffsetsMutable()[0];
  Value offset = first.get();
  Type type = nowhereType(offset.getType());
  if (offset.getType() != type)
    offset = CastOp::create(b, loc, type, offset);
  first.set(
      orElse(b, loc, alive, offset, [&] { return makeNowhere(b, loc, type); }));
  op.setChecked(true);
}

} // namespace warp::tiles
