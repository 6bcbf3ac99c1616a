//===- Accumulators.cpp - Products in register accumulators ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Calls of the device library. A loop that loads ahead (TileProducts.cpp) has a
// multi-buffer for each factor: before the loop, all stages but one are being
// loaded; each iteration waits for its own, and fills the one that the
// iteration before has read.
//
//===----------------------------------------------------------------------===//

#include "Accumulators.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Sums
//===----------------------------------------------------------------------===//

/// The type in which products of elements are summed.
static Type sumOf(TileType type) {
  Type element = type.getElementType();
  return element.isF64() ? element : Float32Type::get(type.getContext());
}

static Value makeSums(OpBuilder &entry, Location loc, TileType type,
                      int64_t slots) {
  return ScratchOp::create(
      entry, loc, ScratchType::get(type.getContext(), slots, sumOf(type)));
}

Value AccumulatorLowering::accumulatorsOf(Value tile, int64_t slots) {
  Value &sums = state.registers[buffers.rootOf(tile)];
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
  llvm_unreachable("accumulators belong to a product");
}

/// Calls a function for sums by the threads that have some.
void AccumulatorLowering::callForSums(const Twine &name,
                                      const ProductForm &form, TileType type,
                                      ValueRange arguments) {
  int64_t holders = type.getNumElements() / form.slots;
  if (holders == threads)
    return callLibrary("warp_tile_" + name, {}, arguments);
  std::string symbol = ("warp_tile_" + name).str();
  ifHolds(less(thread, number(holders)),
          [&] { callLibrary(symbol, {}, arguments); });
}

void AccumulatorLowering::call(StringRef verb, Value tile, Values arguments) {
  ProductForm form = formOf(tile, buffers);
  arguments.insert(arguments.begin(), accumulatorsOf(tile, form.slots));
  callForSums(verb + "_" + form.layout, form, tileType(tile), arguments);
}

void AccumulatorLowering::set(Operation *op) {
  Value operand = op->getOperand(0);
  if (isTile(operand))
    operand = operand.getDefiningOp()->getOperand(0);
  call("set", op->getResult(0), {operand});
}

void AccumulatorLowering::take(TileMapOp op) {
  ArrayRef<int64_t> shape = tileType(op.getResult(0)).getShape();
  call("take", op.getResult(0),
       {addressOf(memoryOf(getStrided(op.getInputs()[0])->memory)),
        number(shape[0]), number(shape[1])});
}

void AccumulatorLowering::give(TileMapOp op) {
  Value tile = op.getInputs()[0];
  ArrayRef<int64_t> shape = tileType(tile).getShape();
  call("give", tile,
       {addressOf(memoryOf(op.getResult(0))), number(shape[0]),
        number(shape[1])});
}

void AccumulatorLowering::storeTile(TileStoreOp op) {
  call("store", op.getTile(), windowOf(op, op.getArray(), op.getOffsets()));
}

void AccumulatorLowering::addTile(TileAtomicOp op) {
  call("add", op.getTile(), windowOf(op, op.getArray(), op.getOffsets()));
}

//===----------------------------------------------------------------------===//
// Products
//===----------------------------------------------------------------------===//

int64_t pitchOf(const Factor &factor) {
  return getLayout(factor.memory).getSwizzled() ? 0 : factor.pitch;
}

/// Adds a product to sums; factors are `stage` stages behind their first one.
void AccumulatorLowering::multiply(TileMatmulOp op, Value sums, Value stage) {
  ProductForm form = *getProductForm(op);
  Factor a = *getFactor(op.getA(), op.getTransposeA());
  Factor b = *getFactor(op.getB(), !op.getTransposeB());
  TileType type = tileType(op.getResult());
  callForSums("multiply_" + form.product, form, type,
              {sums, addressOfStage(a.memory, stage),
               addressOfStage(b.memory, stage), number(type.getShape()[0]),
               number(type.getShape()[1]), number(depthOf(op)),
               number(pitchOf(a)), number(pitchOf(b)), number(subtracts(op))});
}

void AccumulatorLowering::multiply(TileMatmulOp op) {
  ProductForm form = *getProductForm(op);
  if (buffers.isInRegisters(op.getResult())) {
    if (!op.getC())
      call("set", op.getResult(),
           {constant(sumOf(tileType(op.getResult())), 0)});
    if (!op->getParentOp()->hasAttr(attr::stages))
      multiply(op, accumulatorsOf(op.getResult(), form.slots), Value());
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
// Software pipelining
//===----------------------------------------------------------------------===//

/// The address of a tile, or of one of its stages.
Value AccumulatorLowering::addressOfStage(Value tile, Value stage) {
  Value address = addressOf(memoryOf(tile));
  if (!stage)
    return address;
  Value bytes = mul(stage, number(getStageBytes(tile)));
  return builtin("add", {address, cast(bytes, address.getType())});
}

/// Takes no more than so many elements of an array along an axis.
void AccumulatorLowering::limitWindow(Values &window, int64_t axis,
                                      Value count) {
  constexpr int64_t first = 1, extent = 3;
  Value end = add(window[first + axis], count);
  Value &limit = window[extent + axis];
  limit = arith::MinSIOp::create(b, loc, cast(limit, end.getType()), end);
  window.back() = number(1);
}

/// The offsets at which an iteration loads, computed anew with its number.
Values AccumulatorLowering::offsetsAt(TileLoadOp load, scf::ForOp loop,
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

/// Loads the tile of an iteration.
void AccumulatorLowering::fetch(TileLoadOp load, scf::ForOp loop,
                                Value iteration, Value stage) {
  Value array;
  Values offsets = offsetsAt(load, loop, iteration, &array);
  TileType type = tileType(load.getResult());
  Values window = windowOf(load, array, offsets);
  TileLayoutAttr layout = getLayout(load);
  if (int64_t extent = layout.getMergedExtent())
    limitWindow(window, layout.getMergedAxis(),
                mul(sub(loop.getUpperBound(), iteration), number(extent)));
  Values arguments{addressOfStage(load.getResult(), stage)};
  arguments.append(window);
  arguments.push_back(number(layout.getPitch()));
  arguments.push_back(number(threads));
  StringRef form = layout.getSwizzled() ? "swizzled_b" : "b";
  callLibrary("warp_tile_fetch_" + form +
                  Twine(8 * getByteSize(type.getElementType())),
              {}, arguments);
}

/// So many steps behind an iteration of a loop.
Value AccumulatorLowering::iterationAfter(scf::ForOp loop, Value iteration,
                                          Value steps) {
  Value distance = arith::MulIOp::create(b, loc, steps, loop.getStep());
  return arith::AddIOp::create(b, loc, iteration, distance);
}

Value AccumulatorLowering::isIteration(scf::ForOp loop, Value iteration) {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, iteration,
                               loop.getUpperBound());
}

/// How many there have been.
Value AccumulatorLowering::stepsBefore(scf::ForOp loop) {
  Value done = arith::SubIOp::create(b, loc, loop.getInductionVar(),
                                     loop.getLowerBound());
  return arith::DivUIOp::create(b, loc, done, loop.getStep());
}

void AccumulatorLowering::pipelineCopies(scf::ForOp loop) {
  int64_t stages = loop->getAttrOfType<IntegerAttr>(attr::stages).getInt();
  SmallVector<TileLoadOp> loads(loop.getBody()->getOps<TileLoadOp>());
  auto product = *loop.getBody()->getOps<TileMatmulOp>().begin();
  auto fetchAll = [&](Value iteration, Value stage) {
    ifHolds(isIteration(loop, iteration), [&] {
      for (TileLoadOp load : loads)
        fetch(load, loop, iteration, stage);
    });
    callLibrary("warp_tile_close_group", {}, {});
  };
  b.setInsertionPoint(loop);
  this->loop(stages - 1, [&](Value stage) {
    fetchAll(iterationAfter(loop, loop.getLowerBound(), stage), stage);
  });
  b.setInsertionPoint(product);
  Value done = stepsBefore(loop);
  auto stageOf = [&](Value number) -> Value {
    return arith::RemUIOp::create(b, loc, number, this->number(stages));
  };
  ProductForm form = *getProductForm(product);
  callLibrary("warp_tile_await_groups", {}, {number(stages - 2)});
  if (form.isByWarpgroups())
    callLibrary("warp_tile_publish_copies", {}, {});
  barrier();
  auto fetchNext = [&] {
    fetchAll(iterationAfter(loop, loop.getInductionVar(), number(stages - 1)),
             stageOf(add(done, number(stages - 1))));
  };
  // Warps that have multiplied fetch while others multiply, unless that would
  // be too late.
  bool isInTime = stages > 2;
  if (!isInTime)
    fetchNext();
  multiply(product, accumulatorsOf(product.getResult(), form.slots),
           stageOf(done));
  if (isInTime)
    fetchNext();
  if (form.isByWarpgroups())
    callLibrary("warp_tile_await_products", {}, {});
}

void AccumulatorLowering::pipeline(scf::ForOp loop) {
  loc = loop.getLoc();
  bool byTma =
      llvm::any_of(loop.getBody()->getOps<TileLoadOp>(), [](TileLoadOp load) {
        return getLayout(load).getTensorMap() != 0;
      });
  byTma ? pipelineTma(loop) : pipelineCopies(loop);
}

} // namespace warp::tiles
