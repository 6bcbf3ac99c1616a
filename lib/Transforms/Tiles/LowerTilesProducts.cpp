//===- LowerTilesProducts.cpp - Products whose sums threads hold ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of the device library. A loop that loads ahead (TileProducts.cpp)
// has a ring of places for each factor: before it, all but one are on their
// way; each iteration waits for its own, and fills the one that the iteration
// before has read.
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"
#include "TileProducts.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Sums
//===----------------------------------------------------------------------===//

/// What products with elements of a type are summed in.
static Type sumOf(TileType type) {
  Type element = type.getElementType();
  return element.isF64() ? element : Float32Type::get(type.getContext());
}

static Value makeSums(OpBuilder &entry, Location loc, TileType type,
                      int64_t slots) {
  return ScratchOp::create(
      entry, loc, ScratchType::get(type.getContext(), slots, sumOf(type)));
}

Value TileLowering::sumsOf(Value tile, int64_t slots) {
  Value &sums = heldSums[buffers.rootOf(tile)];
  if (!sums)
    sums = makeSums(entry, loc, tileType(tile), slots);
  return sums;
}

/// The form of the products that add to a tile.
static ProductForm formOf(Value tile, const TileBuffers &buffers) {
  Value root = buffers.rootOf(tile);
  for (Value member : buffers.getTiles())
    if (auto product = member.getDefiningOp<TileMatmulOp>())
      if (buffers.rootOf(member) == root)
        return *getProductForm(product);
  llvm_unreachable("held tiles belong to a product");
}

/// Of a small tile, not all threads of the block have sums.
void TileLowering::callForSums(const Twine &name, const ProductForm &form,
                               TileType type, ValueRange arguments) {
  int64_t holders = type.getNumElements() / form.slots;
  if (holders == threads)
    return callLibrary("warp_tile_" + name, {}, arguments);
  std::string symbol = ("warp_tile_" + name).str();
  ifHolds(less(thread, number(holders)),
          [&] { callLibrary(symbol, {}, arguments); });
}

void TileLowering::callHeld(StringRef verb, Value tile, Values arguments) {
  ProductForm form = formOf(tile, buffers);
  arguments.insert(arguments.begin(), sumsOf(tile, form.slots));
  callForSums(verb + "_" + form.layout, form, tileType(tile), arguments);
}

void TileLowering::setHeld(Operation *op) {
  Value operand = op->getOperand(0);
  if (isTile(operand))
    operand = operand.getDefiningOp()->getOperand(0);
  callHeld("set", op->getResult(0), {operand});
}

void TileLowering::giveHeld(TileMapOp op) {
  Value tile = op.getInputs()[0];
  ArrayRef<int64_t> shape = tileType(tile).getShape();
  callHeld("give", tile,
           {addressOf(memoryOf(op.getResult(0))), number(shape[0]),
            number(shape[1])});
}

/// Data, offsets, extents, steps and shape of a tile in an array, and whether
/// it is tested.
template <typename Op>
Values TileLowering::windowOf(Op op, Value array, TileType tile,
                              ValueRange offsets) {
  Values window{addressOf(array)};
  for (Value offset : offsets)
    window.push_back(toIndex(offset));
  Type integer = b.getIntegerType(32, true);
  for (int64_t d = 0; d < 2; ++d)
    window.push_back(
        DimOp::create(b, loc, integer, array, b.getI64IntegerAttr(d)));
  for (int64_t d = 0; d < 2; ++d)
    window.push_back(
        StrideOp::create(b, loc, integer, array, b.getI64IntegerAttr(d)));
  for (int64_t extent : tile.getShape())
    window.push_back(number(extent));
  window.push_back(number(op.getChecked()));
  return window;
}

// For matrices, in LowerTilesForms.cpp.
template Values TileLowering::windowOf(TileLoadOp, Value, TileType, ValueRange);

void TileLowering::storeHeld(TileStoreOp op) {
  callHeld(
      "store", op.getTile(),
      windowOf(op, op.getArray(), tileType(op.getTile()), op.getOffsets()));
}

void TileLowering::addHeld(TileAtomicOp op) {
  callHeld(
      "add", op.getTile(),
      windowOf(op, op.getArray(), tileType(op.getTile()), op.getOffsets()));
}

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

int64_t pitchOf(const Factor &factor) {
  Operation *def = factor.memory.getDefiningOp();
  return def && def->hasAttr(attr::swizzled) ? 0 : factor.pitch;
}

/// Adds a product to sums; factors are `turn` places behind their first one.
void TileLowering::multiply(TileMatmulOp op, Value sums, Value turn) {
  ProductForm form = *getProductForm(op);
  Factor a = *getFactor(op.getA(), op.getTransposeA());
  Factor b = *getFactor(op.getB(), !op.getTransposeB());
  TileType type = tileType(op.getResult());
  callForSums("multiply_" + form.product, form, type,
              {sums, placeOf(a.memory, turn), placeOf(b.memory, turn),
               number(type.getShape()[0]), number(type.getShape()[1]),
               number(depthOf(op)), number(pitchOf(a)), number(pitchOf(b))});
}

void TileLowering::lowerHeldProduct(TileMatmulOp op) {
  ProductForm form = *getProductForm(op);
  if (buffers.isHeld(op.getResult())) {
    if (!op.getC())
      callHeld("set", op.getResult(),
               {constant(sumOf(tileType(op.getResult())), 0)});
    if (!op->getParentOp()->hasAttr(attr::stages))
      multiply(op, sumsOf(op.getResult(), form.slots), Value());
    return;
  }
  TileType type = tileType(op.getResult());
  Value sums = makeSums(entry, loc, type, form.slots);
  Type element = type.getElementType();
  std::string layout = (element.isF16()    ? "_f16_"
                        : element.isBF16() ? "_bf16_"
                                           : "_") +
                       form.layout;
  auto exchange = [&](StringRef verb) {
    callForSums(verb + layout, form, type,
                {sums, addressOf(memoryOf(op.getResult())),
                 number(type.getShape()[0]), number(type.getShape()[1])});
  };
  if (op.getC()) {
    begin(op, op.getC());
    exchange("take");
  } else {
    callForSums("set_" + form.layout, form, type,
                {sums, constant(sumOf(type), 0)});
  }
  multiply(op, sums, Value());
  exchange("give");
}

//===----------------------------------------------------------------------===//
// Loading ahead
//===----------------------------------------------------------------------===//

/// The address of a tile, or of one of its stages.
Value TileLowering::placeOf(Value tile, Value turn) {
  Value address = addressOf(memoryOf(tile));
  if (!turn)
    return address;
  Value bytes = mul(turn, number(getStageBytes(tile)));
  return builtin("add", {address, cast(bytes, address.getType())});
}

/// Takes no more than so many elements of an array along an axis.
void TileLowering::limitWindow(Values &window, int64_t axis, Value count) {
  constexpr int64_t first = 1, extent = 3;
  Value end = add(window[first + axis], count);
  Value &limit = window[extent + axis];
  limit = arith::MinSIOp::create(b, loc, cast(limit, end.getType()), end);
  window.back() = number(1);
}

/// Where an iteration loads, computed anew with its number.
Values TileLowering::offsetsAt(TileLoadOp load, scf::ForOp loop,
                               Value iteration, Value *array) {
  IRMapping map;
  map.map(loop.getInductionVar(), iteration);
  for (Operation &op : loop.getBody()->without_terminator())
    if (!computesTiles(&op) && op.isBeforeInBlock(load))
      b.clone(op, map);
  if (array)
    *array = map.lookupOrDefault(load.getArray());
  return llvm::map_to_vector<4>(load.getOffsets(), [&](Value offset) {
    return map.lookupOrDefault(offset);
  });
}

/// What an iteration needs.
void TileLowering::fetch(TileLoadOp load, scf::ForOp loop, Value iteration,
                         Value turn) {
  Value array;
  Values offsets = offsetsAt(load, loop, iteration, &array);
  TileType type = tileType(load.getResult());
  Values window = windowOf(load, array, type, offsets);
  if (auto merged = load->getAttrOfType<DenseI64ArrayAttr>(attr::merged))
    limitWindow(window, merged[0],
                mul(sub(loop.getUpperBound(), iteration), number(merged[1])));
  Values arguments{placeOf(load.getResult(), turn)};
  arguments.append(window);
  arguments.push_back(
      number(load->getAttrOfType<IntegerAttr>(attr::pitch).getInt()));
  arguments.push_back(number(threads));
  StringRef layout = load->hasAttr(attr::swizzled) ? "swizzled_b" : "b";
  callLibrary("warp_tile_fetch_" + layout +
                  Twine(8 * getByteSize(type.getElementType())),
              {}, arguments);
}

/// So many steps behind an iteration of a loop.
Value TileLowering::iterationAfter(scf::ForOp loop, Value iteration,
                                   Value steps) {
  Value distance = arith::MulIOp::create(b, loc, steps, loop.getStep());
  return arith::AddIOp::create(b, loc, iteration, distance);
}

Value TileLowering::isIteration(scf::ForOp loop, Value iteration) {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, iteration,
                               loop.getUpperBound());
}

/// How many there have been.
Value TileLowering::stepsBefore(scf::ForOp loop) {
  Value done = arith::SubIOp::create(b, loc, loop.getInductionVar(),
                                     loop.getLowerBound());
  return arith::DivUIOp::create(b, loc, done, loop.getStep());
}

void TileLowering::lowerAhead(scf::ForOp loop) {
  loc = loop.getLoc();
  int64_t stages = loop->getAttrOfType<IntegerAttr>(attr::stages).getInt();
  SmallVector<TileLoadOp> loads(loop.getBody()->getOps<TileLoadOp>());
  auto product = *loop.getBody()->getOps<TileMatmulOp>().begin();
  auto fetchAll = [&](Value iteration, Value turn) {
    ifHolds(isIteration(loop, iteration), [&] {
      for (TileLoadOp load : loads)
        fetch(load, loop, iteration, turn);
    });
    callLibrary("warp_tile_close_group", {}, {});
  };
  b.setInsertionPoint(loop);
  this->loop(stages - 1, [&](Value turn) {
    fetchAll(iterationAfter(loop, loop.getLowerBound(), turn), turn);
  });
  b.setInsertionPoint(product);
  Value done = stepsBefore(loop);
  auto turnOf = [&](Value number) -> Value {
    return arith::RemUIOp::create(b, loc, number, this->number(stages));
  };
  ProductForm form = *getProductForm(product);
  callLibrary("warp_tile_await_groups", {}, {number(stages - 2)});
  if (form.isByWarpgroups())
    callLibrary("warp_tile_publish_copies", {}, {});
  barrier();
  auto fetchNext = [&] {
    fetchAll(iterationAfter(loop, loop.getInductionVar(), number(stages - 1)),
             turnOf(add(done, number(stages - 1))));
  };
  // Warps that have multiplied fetch while others multiply, unless that would
  // be too late.
  bool isInTime = stages > 2;
  if (!isInTime)
    fetchNext();
  multiply(product, sumsOf(product.getResult(), form.slots), turnOf(done));
  if (isInTime)
    fetchNext();
  if (form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {});
}

} // namespace warp::tiles
