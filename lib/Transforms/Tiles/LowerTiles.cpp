//===- LowerTiles.cpp - Tiles as loops over elements ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A tile in memory is a packed array of rank one at its place in the block's
// memory. An operation becomes loops over the elements of its result, which the
// threads of the block share: thread t takes elements t, t + B, ... On a CPU a
// block is one thread, and loops run over the dimensions, so that LLVM finds
// them easy to vectorise. What is not kept is computed within the loop of its
// user.
//
// Accesses of arrays are tested against the array's extents. One test of the
// whole tile chooses between a loop without tests and one with them.
//
//   operation                      in file
//   elements, parts, threads       LowerTilesElements.cpp
//   reductions, scans, sorting     LowerTilesReductions.cpp
//   products, factors, transforms  LowerTilesAlgebra.cpp
//
//===----------------------------------------------------------------------===//

#include "LowerTiles.h"

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "llvm/ADT/TypeSwitch.h"

namespace warp {
#define GEN_PASS_DEF_LOWERTILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;

namespace warp::tiles {

constexpr auto noWrap = arith::IntegerOverflowFlags::nsw;

TileLowering::TileLowering(FunctionOpInterface kernel)
    : kernel(kernel), threads(getBlockThreads(kernel)), buffers(kernel),
      b(kernel.getContext()), entry(kernel.getContext()),
      loc(kernel.getLoc()), i32(b.getI32Type()) {
  entry.setInsertionPointToStart(&kernel.getFunctionBody().front());
  if (threads > 1)
    thread = ThreadNumberOp::create(entry, loc, i32);
  kernel->walk([&](Operation *op) {
    auto offsets = op->getAttrOfType<DenseI64ArrayAttr>(attr::offsets);
    if (!offsets)
      return;
    unsigned next = 0;
    for (Value result : op->getResults())
      if (isTile(result))
        offsetOf[buffers.rootOf(result)] = offsets[next++];
  });
}

//===----------------------------------------------------------------------===//
// Scalars
//===----------------------------------------------------------------------===//

Value TileLowering::number(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

bool TileLowering::isConstant(Value value, int64_t number) {
  APInt constant;
  return matchPattern(value, m_ConstantInt(&constant)) &&
         constant.getSExtValue() == number;
}

Value TileLowering::add(Value x, Value y) {
  if (isConstant(x, 0))
    return y;
  if (isConstant(y, 0))
    return x;
  return arith::AddIOp::create(b, loc, x, y, noWrap);
}

Value TileLowering::sub(Value x, Value y) {
  return isConstant(y, 0) ? x : arith::SubIOp::create(b, loc, x, y, noWrap);
}

Value TileLowering::mul(Value x, Value y) {
  if (isConstant(x, 1))
    return y;
  if (isConstant(y, 1))
    return x;
  return arith::MulIOp::create(b, loc, x, y, noWrap);
}

Value TileLowering::less(Value x, Value y) {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, x, y);
}

Value TileLowering::both(Value x, Value y) {
  if (!x || !y)
    return x ? x : y;
  return arith::AndIOp::create(b, loc, x, y);
}

Value TileLowering::toIndex(Value value) { return cast(value, i32); }

Value TileLowering::cast(Value value, Type type) {
  if (value.getType() == type)
    return value;
  return CastOp::create(b, loc, type, value);
}

Value TileLowering::builtin(StringRef name, ValueRange operands) {
  return createBuiltin(b, loc, name, operands)->getResult(0);
}

Value TileLowering::zero(Type type) {
  if (isComposite(type))
    return ConstructOp::create(b, loc, type, ValueRange());
  if (auto record = dyn_cast<StructType>(type)) {
    Values fields;
    for (Type field : record.getFieldTypes())
      fields.push_back(zero(field));
    return StructCreateOp::create(b, loc, type, fields);
  }
  if (auto array = dyn_cast<ArrayType>(type)) {
    Value nothing = ConstantOp::create(
        b, loc, b.getIntegerAttr(b.getIntegerType(64, false), 0));
    Values extents(array.getRank(), number(0));
    return ArrayAtOp::create(b, loc, type, nothing, extents);
  }
  return constant(type, 0);
}

Value TileLowering::constant(Type type, double value) {
  TypedAttr attribute;
  if (auto real = dyn_cast<FloatType>(type))
    attribute = b.getFloatAttr(real, value);
  else
    attribute = b.getIntegerAttr(type, int64_t(value));
  return ConstantOp::create(b, loc, attribute);
}

Values TileLowering::inlineBody(Block &body, ValueRange arguments) {
  IRMapping map;
  map.map(body.getArguments(), arguments);
  for (Operation &op : body.without_terminator())
    b.clone(op, map);
  return llvm::map_to_vector(body.getTerminator()->getOperands(), [&](Value v) {
    return map.lookupOrDefault(v);
  });
}

//===----------------------------------------------------------------------===//
// Loops
//===----------------------------------------------------------------------===//

void TileLowering::barrier() {
  if (threads > 1)
    BarrierOp::create(b, loc);
}

void TileLowering::ifHolds(Value condition, function_ref<void()> make) {
  if (!condition)
    return make();
  auto branch = scf::IfOp::create(b, loc, condition, /*withElse=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  make();
}

Value TileLowering::ifHolds(Value condition, Type type,
                            function_ref<Value()> make) {
  if (!condition)
    return make();
  auto branch = scf::IfOp::create(b, loc, TypeRange(type), condition,
                                  /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(b, loc, make());
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, zero(type));
  return branch.getResult(0);
}

void TileLowering::byFirstThread(function_ref<void()> make) {
  Value first;
  if (threads > 1)
    first = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, thread,
                                  number(0));
  ifHolds(first, make);
}

Values TileLowering::loop(Value begin, Value end, Value step, ValueRange sums,
                          function_ref<Values(Value, ValueRange)> body) {
  auto op = scf::ForOp::create(b, loc, begin, end, step, sums);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(op.getBody());
  Values next = body(op.getInductionVar(), op.getRegionIterArgs());
  if (!sums.empty())
    scf::YieldOp::create(b, loc, next);
  return Values(op.getResults());
}

void TileLowering::loop(int64_t end, function_ref<void(Value)> body) {
  loop(number(0), number(end), number(1), {}, [&](Value i, ValueRange) {
    body(i);
    return Values();
  });
}

Values TileLowering::nest(ArrayRef<int64_t> shape, Values &indices,
                          ValueRange sums, Body body) {
  if (indices.size() == shape.size())
    return body(indices, sums);
  int64_t extent = shape[indices.size()];
  auto inner = [&](Value i, ValueRange sums) {
    indices.push_back(i);
    Values next = nest(shape, indices, sums, body);
    indices.pop_back();
    return next;
  };
  if (extent == 1)
    return inner(number(0), sums);
  return loop(number(0), number(extent), number(1), sums, inner);
}

Values TileLowering::share(ArrayRef<int64_t> shape, ValueRange sums,
                           Body body) {
  Values indices;
  if (threads == 1)
    return nest(shape, indices, sums, body);
  int64_t count = 1;
  for (int64_t extent : shape)
    count *= extent;
  return loop(thread, number(count), number(threads), sums,
              [&](Value e, ValueRange sums) {
                return body(unravel(e, shape), sums);
              });
}

void TileLowering::share(ArrayRef<int64_t> shape,
                         function_ref<void(ValueRange)> body) {
  share(shape, {}, [&](ValueRange indices, ValueRange) {
    body(indices);
    return Values();
  });
}

/// Whether all elements that an operation accesses, by itself or in tiles that
/// are computed in its loop, are inside of their arrays; null without such.
void TileLowering::collectTested(Operation *op, Value &inside) {
  auto test = [&](auto access, TileType tile) {
    if (!access.getChecked())
      return;
    for (int64_t d = 0; d < tile.getRank(); ++d) {
      // What is picked is tested one by one.
      if (access.getPicked() && int64_t(access.getAxis()) == d)
        continue;
      Value offset = access.getOffsets()[d];
      Type wide = getByteSize(offset.getType()) > 4 ? b.getI64Type() : i32;
      Value first = cast(offset, wide);
      Value extent = cast(DimOp::create(b, loc, b.getIntegerType(32, true),
                                        access.getArray(),
                                        b.getI64IntegerAttr(d)),
                          wide);
      Value length = arith::ConstantOp::create(
          b, loc, b.getIntegerAttr(wide, tile.getShape()[d]));
      Value none =
          arith::ConstantOp::create(b, loc, b.getIntegerAttr(wide, 0));
      Value low = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sge,
                                        first, none);
      Value last = arith::SubIOp::create(b, loc, extent, length);
      Value high = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::sle,
                                         first, last);
      inside = both(inside, both(low, high));
    }
  };
  if (auto load = dyn_cast<TileLoadOp>(op))
    test(load, tileType(load.getResult()));
  else if (auto store = dyn_cast<TileStoreOp>(op))
    test(store, tileType(store.getTile()));
  else if (auto atomic = dyn_cast<TileAtomicOp>(op))
    test(atomic, tileType(atomic.getTile()));
  for (Value operand : op->getOperands()) {
    Operation *def = operand.getDefiningOp();
    if (def && isTile(operand) && isInline(def))
      collectTested(def, inside);
  }
}

Values TileLowering::elements(Operation *op, ArrayRef<int64_t> shape,
                              ValueRange sums, Body body) {
  Value inside;
  collectTested(op, inside);
  if (!inside)
    return share(shape, sums, body);
  auto branch = scf::IfOp::create(b, loc, TypeRange(sums), inside,
                                  /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  for (bool tested : {false, true}) {
    Block *block = tested ? branch.elseBlock() : branch.thenBlock();
    if (sums.empty())
      b.setInsertionPoint(block->getTerminator());
    else
      b.setInsertionPointToStart(block);
    testing = tested;
    Values next = share(shape, sums, body);
    if (!sums.empty())
      scf::YieldOp::create(b, loc, next);
  }
  return Values(branch.getResults());
}

void TileLowering::elements(Operation *op, ArrayRef<int64_t> shape,
                            function_ref<void(ValueRange)> body) {
  elements(op, shape, {}, [&](ValueRange indices, ValueRange) {
    body(indices);
    return Values();
  });
}

//===----------------------------------------------------------------------===//
// Operations
//===----------------------------------------------------------------------===//

void TileLowering::lower(Operation *op) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  llvm::TypeSwitch<Operation *>(op)
      .Case([&](TileMapOp map) { lowerMap(map); })
      .Case([&](TileStoreOp store) { lowerStore(store); })
      .Case([&](TileAtomicOp atomic) { lowerAtomic(atomic); })
      .Case([&](TileFromThreadsOp from) { lowerFromThreads(from); })
      .Case([&](TileToThreadsOp to) { lowerToThreads(to); })
      .Case([&](TileGetOp get) { lowerGet(get); })
      .Case([&](TileSetOp set) { lowerSet(set); })
      .Case([&](TileInsertOp insert) { lowerInsert(insert); })
      .Case([&](TileGatherOp gather) { lowerGather(gather); })
      .Case([&](TileScatterOp scatter) { lowerScatter(scatter); })
      .Case([&](TileReduceOp reduce) {
        lowerReduce(reduce, reduce.getKind(), reduce.getTile(),
                    reduce.getAxis(), /*positions=*/false);
      })
      .Case([&](TileArgReduceOp reduce) {
        lowerReduce(reduce, reduce.getKind(), reduce.getTile(),
                    reduce.getAxis(), /*positions=*/true);
      })
      .Case([&](TileFoldOp fold) { lowerFold(fold); })
      .Case([&](TileScanOp scan) { lowerScan(scan); })
      .Case([&](TileSortOp sort) { lowerSort(sort); })
      .Case([&](TileMatmulOp matmul) { lowerMatmul(matmul); })
      .Case([&](TileCholeskyOp factor) { lowerCholesky(factor); })
      .Case([&](TileSolveOp solve) { lowerSolve(solve); })
      .Case([&](TileDiagAddOp add) { lowerDiagAdd(add); })
      .Case([&](TileFftOp fft) { lowerFft(fft); })
      .Case([](TileEmptyOp) {})
      .Default([&](Operation *) { keep(op); });
}

//===----------------------------------------------------------------------===//
// Control flow
//===----------------------------------------------------------------------===//

static llvm::BitVector tilesAmong(ValueRange values) {
  llvm::BitVector found(values.size());
  for (auto [i, value] : llvm::enumerate(values))
    if (isTile(value))
      found.set(i);
  return found;
}

static void dropTiles(Block &block) {
  for (BlockArgument argument : block.getArguments())
    if (isTile(argument))
      argument.dropAllUses();
  block.eraseArguments([](BlockArgument argument) { return isTile(argument); });
  Operation *end = block.getTerminator();
  end->eraseOperands(tilesAmong(end->getOperands()));
}

/// Control flow without the tiles that it carries.
static void dropTiles(Operation *op) {
  for (Region &region : op->getRegions())
    if (!region.empty())
      dropTiles(region.front());
  op->eraseOperands(tilesAmong(op->getOperands()));
  llvm::BitVector results = tilesAmong(op->getResults());
  if (results.none())
    return;
  SmallVector<Type> types;
  for (Value result : op->getResults())
    if (isTile(result))
      result.dropAllUses();
    else
      types.push_back(result.getType());
  OperationState state(op->getLoc(), op->getName(), op->getOperands(), types,
                       op->getAttrs());
  for (Region &region : op->getRegions())
    state.addRegion()->takeBody(region);
  Operation *rebuilt = OpBuilder(op).create(state);
  unsigned next = 0;
  for (Value result : op->getResults())
    if (!isTile(result))
      result.replaceAllUsesWith(rebuilt->getResult(next++));
  op->erase();
}

/// Removes what was lowered.
void TileLowering::detach() {
  SmallVector<Operation *> done, carriers;
  kernel->walk([&](Operation *op) {
    if (op->getName().getDialectNamespace() == "warp" && isTileOp(op))
      done.push_back(op);
    else if (isa<scf::ForOp, scf::WhileOp, scf::IfOp>(op))
      carriers.push_back(op);
  });
  for (Operation *op : carriers)
    dropTiles(op);
  for (Operation *op : llvm::reverse(done)) {
    op->dropAllUses();
    op->erase();
  }
}

LogicalResult TileLowering::run() {
  SmallVector<Operation *> ops;
  kernel->walk([&](Operation *op) {
    if (op->getName().getDialectNamespace() == "warp" && isTileOp(op) &&
        !isInline(op))
      ops.push_back(op);
  });
  for (Operation *op : ops)
    lower(op);
  detach();
  return success();
}

} // namespace warp::tiles

namespace {

struct LowerTiles : warp::impl::LowerTilesBase<LowerTiles> {
  void runOnOperation() override {
    FunctionOpInterface kernel = warp::findKernel(getOperation());
    if (!kernel)
      return signalPassFailure();
    if (warp::tiles::getBlockThreads(kernel) &&
        failed(warp::tiles::TileLowering(kernel).run()))
      signalPassFailure();
  }
};

} // namespace
