//===- LowerTilesMemory.cpp - Accesses of tiles, and library calls --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile in memory is a packed array of rank one at its offset in shared
// memory; one in registers has an array per thread. A function of the device
// library gets addresses in shared memory. An operand that does not lie there
// as the function needs it is copied first.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;

namespace warp::tiles {

Value TileLowering::arrayAt(int64_t offset, int64_t count, Type element) {
  Value &array = state.arrays[{offset, count, element.getAsOpaquePointer()}];
  if (array)
    return array;
  Location place = kernel.getLoc();
  Type type = ArrayType::get(b.getContext(), 1, element);
  Value address =
      BlockMemoryOp::create(entry, place, b.getIntegerType(64, false), offset);
  Value extent =
      arith::ConstantOp::create(entry, place, b.getI32IntegerAttr(count));
  array = ArrayAtOp::create(entry, place, type, address, extent);
  return array;
}

Value TileLowering::memoryOf(Value tile) {
  TileType type = tileType(tile);
  return arrayAt(buffers.getOffset(tile),
                 getStagedBytes(tile) / getByteSize(type.getElementType()),
                 type.getElementType());
}

Value TileLowering::linear(ArrayRef<int64_t> shape, ValueRange indices) {
  Value index = indices[0];
  for (size_t d = 1; d < shape.size(); ++d)
    index =
        add(shape[d] == 1 ? index : mul(index, number(shape[d])), indices[d]);
  return index;
}

Values TileLowering::unravel(Value index, ArrayRef<int64_t> shape) {
  Values indices(shape.size());
  for (size_t d = shape.size(); d-- > 1;) {
    Value extent = number(shape[d]);
    indices[d] = arith::RemUIOp::create(b, loc, index, extent);
    index = arith::DivUIOp::create(b, loc, index, extent);
  }
  indices[0] = index;
  return indices;
}

/// The address of an element.
Value TileLowering::placeIn(Value tile, ValueRange indices) {
  if (std::optional<int64_t> pitch = getPitch(tile))
    return add(mul(indices[0], number(*pitch)), indices[1]);
  return linear(tileType(tile).getShape(), indices);
}

/// The registers of a thread for a tile.
Value TileLowering::registersOf(Value tile) {
  Value &registers = state.registers[buffers.rootOf(tile)];
  TileType type = tileType(tile);
  if (!registers)
    registers = ScratchOp::create(
        entry, loc,
        ScratchType::get(b.getContext(),
                         isReplicated(tile) ? 1
                                            : type.getNumElements() / threads,
                         type.getElementType()));
  return registers;
}

Value TileLowering::indexInRegisters(Value tile) {
  return isReplicated(tile) ? number(0) : state.round;
}

Value TileLowering::load(Value tile, ValueRange indices) {
  if (tiles::isDistributed(tile))
    return ScratchLoadOp::create(b, loc, tileType(tile).getElementType(),
                                 registersOf(tile), indexInRegisters(tile));
  return LoadOp::create(b, loc, tileType(tile).getElementType(), memoryOf(tile),
                        placeIn(tile, indices));
}

void TileLowering::store(Value tile, ValueRange indices, Value value) {
  if (tiles::isDistributed(tile)) {
    ScratchStoreOp::create(b, loc, value, registersOf(tile),
                           indexInRegisters(tile));
    return;
  }
  StoreOp::create(b, loc, value, memoryOf(tile), placeIn(tile, indices));
}

//===----------------------------------------------------------------------===//
// Elements
//===----------------------------------------------------------------------===//

Value TileLowering::element(Value tile, ValueRange indices) {
  Operation *def = tile.getDefiningOp();
  return def && isInline(def)
             ? mlir::cast<TileOpInterface>(def).element(*this, indices)
             : load(tile, indices);
}

void TileLowering::keep(Operation *op) {
  Value result = op->getResult(0);
  elements(op, tileType(result).getShape(), [&](ValueRange indices) {
    store(result, indices,
          mlir::cast<TileOpInterface>(op).element(*this, indices));
  });
}

void TileLowering::begin(Operation *op, Value tile) {
  if (op->hasAttr(attr::inPlace))
    return;
  Value result = op->getResult(0);
  share(tileType(tile).getShape(), [&](ValueRange indices) {
    store(result, indices, element(tile, indices));
  });
  barrier();
}

//===----------------------------------------------------------------------===//
// The device library
//===----------------------------------------------------------------------===//

Value TileLowering::addressOf(Value memory) {
  return PointerOp::create(b, loc, b.getIntegerType(64, false), memory);
}

void TileLowering::callLibrary(const Twine &name, Type real, ValueRange args) {
  std::string symbol = name.str();
  if (real)
    symbol += real.isF32() ? "_f32" : "_f64";
  LibraryCallOp::create(b, loc, TypeRange(), b.getStringAttr(symbol), args);
}

int64_t TileLowering::scratchOf(Operation *op) {
  return op->getAttrOfType<IntegerAttr>(attr::scratch).getInt();
}

/// Elements of a matrix in the order of its rows, or columns if it is
/// transposed, as another type, from `offset` of shared memory on.
Value TileLowering::copyTo(int64_t offset, Value tile, Type type,
                           bool transposed) {
  TileType from = tileType(tile);
  SmallVector<int64_t> shape(from.getShape());
  if (transposed)
    std::swap(shape[0], shape[1]);
  Value memory = arrayAt(offset, from.getNumElements(), type);
  // Rows that are columns of what lies in memory.
  std::optional<Strided> strided = getStrided(tile);
  if (strided && from.getElementType() == type && from.getRank() == 2) {
    ArrayRef<int64_t> steps = strided->steps;
    int64_t across = transposed ? steps[1] : steps[0];
    if (across == 1 && shape[1] > 1) {
      callLibrary("warp_tile_transpose", type,
                  {addressOf(memory), addressOf(memoryOf(strided->memory)),
                   number(shape[1]), number(shape[0]),
                   number(transposed ? steps[0] : steps[1])});
      return memory;
    }
  }
  share(shape, [&](ValueRange ij) {
    Value value = element(tile, transposed ? Values{ij[1], ij[0]} : Values(ij));
    StoreOp::create(b, loc, cast(value, type), memory, linear(shape, ij));
  });
  return memory;
}

Strided TileLowering::matrixFor(Operation *op, Value tile, int64_t behind) {
  if (std::optional<Strided> found = getStrided(tile))
    return {memoryOf(found->memory), found->steps};
  TileType type = tileType(tile);
  Value copy = copyTo(scratchOf(op) + behind, tile, type.getElementType(),
                      /*transposed=*/false);
  barrier();
  return {copy, {type.getShape()[0], 1}};
}

void TileLowering::callVariant(StringRef name, Operation *op,
                               Values arguments) {
  arguments.push_back(number(threads));
  callLibrary("warp_tile_" + name + "_" + Twine(getDeviceVariant(op)), {},
              arguments);
}

} // namespace warp::tiles
