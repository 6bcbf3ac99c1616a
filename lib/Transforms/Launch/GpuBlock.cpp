//===- GpuBlock.cpp - Threads and memory of a GPU block -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Helpers of passes that let the threads of a block work together, so that none
// of them names an operation of the `gpu` dialect, whose header is costly. The
// target builds operations that the dialect lacks.
//
//===----------------------------------------------------------------------===//

#include "GpuBlock.h"

#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/DataLayoutInterfaces.h"

using namespace mlir;

void warp::registerGpuDialect(DialectRegistry &registry) {
  registry.insert<gpu::GPUDialect, math::MathDialect>();
}

const warp::TargetInfo &warp::targetAt(OpBuilder &b) {
  Operation *op = b.getInsertionBlock()->getParentOp();
  while (!op->hasAttr(attr::variant) && op->getParentOp())
    op = op->getParentOp();
  return getTarget(op);
}

static Value constant(OpBuilder &b, Location loc, int32_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

//===----------------------------------------------------------------------===//
// The grid
//===----------------------------------------------------------------------===//

static gpu::Dimension toDimension(warp::Axis axis) {
  switch (axis) {
  case warp::Axis::x:
    return gpu::Dimension::x;
  case warp::Axis::y:
    return gpu::Dimension::y;
  case warp::Axis::z:
    return gpu::Dimension::z;
  }
  llvm_unreachable("no such axis");
}

static Value readIndex(OpBuilder &b, Location loc, warp::GridValue value,
                       gpu::Dimension dimension) {
  switch (value) {
  case warp::GridValue::threadId:
    return gpu::ThreadIdOp::create(b, loc, dimension);
  case warp::GridValue::blockId:
    return gpu::BlockIdOp::create(b, loc, dimension);
  case warp::GridValue::blockDim:
    return gpu::BlockDimOp::create(b, loc, dimension);
  case warp::GridValue::gridDim:
    return gpu::GridDimOp::create(b, loc, dimension);
  case warp::GridValue::laneId:
    return gpu::LaneIdOp::create(b, loc, /*upper_bound=*/nullptr);
  }
  llvm_unreachable("no such value");
}

Value warp::readGrid(OpBuilder &b, Location loc, GridValue value, Axis axis) {
  return arith::IndexCastOp::create(
      b, loc, b.getI32Type(), readIndex(b, loc, value, toDimension(axis)));
}

Value warp::threadInBlock(OpBuilder &b, Location loc) {
  auto thread = [&](Axis axis) {
    return readGrid(b, loc, GridValue::threadId, axis);
  };
  auto extent = [&](Axis axis) {
    return readGrid(b, loc, GridValue::blockDim, axis);
  };
  auto mul = [&](Value x, Value y) -> Value {
    return arith::MulIOp::create(b, loc, x, y);
  };
  auto add = [&](Value x, Value y) -> Value {
    return arith::AddIOp::create(b, loc, x, y);
  };
  Value row = add(thread(Axis::y), mul(extent(Axis::y), thread(Axis::z)));
  return add(thread(Axis::x), mul(extent(Axis::x), row));
}

Value warp::subgroupOf(OpBuilder &b, Location loc, Value thread) {
  return arith::ShRUIOp::create(
      b, loc, thread, constant(b, loc, llvm::Log2_64(subgroupSizeAt(b))));
}

//===----------------------------------------------------------------------===//
// Lanes and threads together
//===----------------------------------------------------------------------===//

static gpu::ShuffleMode toGpu(warp::ShuffleMode mode) {
  switch (mode) {
  case warp::ShuffleMode::index:
    return gpu::ShuffleMode::IDX;
  case warp::ShuffleMode::down:
    return gpu::ShuffleMode::DOWN;
  case warp::ShuffleMode::exclusiveOr:
    return gpu::ShuffleMode::XOR;
  }
  llvm_unreachable("no such mode");
}

/// 64 bits travel in two halves.
Value warp::shuffle(OpBuilder &b, Location loc, ShuffleMode mode, Value value,
                    Value lane) {
  Type type = value.getType(), i32 = b.getI32Type(), i64 = b.getI64Type();
  Value width = constant(b, loc, subgroupSizeAt(b));
  auto move = [&](Value word) -> Value {
    return gpu::ShuffleOp::create(b, loc, word, lane, width, toGpu(mode))
        .getShuffleResult();
  };
  if (type.getIntOrFloatBitWidth() == 32)
    return move(value);
  Value bits = value;
  if (type != i64)
    bits = arith::BitcastOp::create(b, loc, i64, value);
  Value half = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(32));
  Value high = arith::ShRUIOp::create(b, loc, bits, half);
  high = move(arith::TruncIOp::create(b, loc, i32, high));
  Value low = move(arith::TruncIOp::create(b, loc, i32, bits));
  high = arith::ExtUIOp::create(b, loc, i64, high);
  low = arith::ExtUIOp::create(b, loc, i64, low);
  high = arith::ShLIOp::create(b, loc, high, half);
  bits = arith::OrIOp::create(b, loc, high, low);
  if (type == i64)
    return bits;
  return arith::BitcastOp::create(b, loc, type, bits);
}

bool warp::isShuffle(Operation *op) { return isa<gpu::ShuffleOp>(op); }

Value warp::overLanes(OpBuilder &b, Location loc, Value value,
                      function_ref<Value(Value, Value)> combine, int64_t size) {
  if (size == 0)
    size = subgroupSizeAt(b);
  for (int64_t distance = 1; distance < size; distance *= 2)
    value = combine(value, shuffle(b, loc, ShuffleMode::exclusiveOr, value,
                                   constant(b, loc, distance)));
  return value;
}

/// Lanes exchange what the other one combines: at the first distance the lower
/// half of a warp takes the first half of the values, the upper half the
/// others, and so on. So 32 values take 31 shuffles in place of 160.
Value warp::shareOverLanes(OpBuilder &b, Location loc, Value lane,
                           SmallVector<Value> values,
                           function_ref<Value(Value, Value)> combine,
                           int64_t size) {
  if (size == 0)
    size = subgroupSizeAt(b);
  size_t half = llvm::PowerOf2Ceil(values.size());
  for (int64_t distance = size / 2; distance > 0; distance /= 2) {
    half = std::max<size_t>(half / 2, 1);
    Value bit = arith::AndIOp::create(b, loc, lane, constant(b, loc, distance));
    Value isUpper = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, bit,
                                          constant(b, loc, 0));
    size_t left = std::min(half, values.size());
    for (size_t i = 0; i < left; ++i) {
      Value kept = values[i], sent = values[i];
      if (i + half < values.size()) {
        Value upper = values[i + half];
        sent = arith::SelectOp::create(b, loc, isUpper, kept, upper);
        kept = arith::SelectOp::create(b, loc, isUpper, upper, kept);
      }
      values[i] = combine(kept, shuffle(b, loc, ShuffleMode::exclusiveOr, sent,
                                        constant(b, loc, distance)));
    }
    values.truncate(left);
  }
  return values.front();
}

void warp::synchronizeBlock(OpBuilder &b, Location loc) {
  gpu::BarrierOp::create(b, loc);
}

//===----------------------------------------------------------------------===//
// Votes and barriers of the target
//===----------------------------------------------------------------------===//

Value warp::isFullWarp(OpBuilder &b, Location loc) {
  return targetAt(b).emitIsFull(b, loc);
}

Value warp::holdsInWarp(OpBuilder &b, Location loc, Value condition) {
  return targetAt(b).emitVoteAll(b, loc, condition);
}

Value warp::isWarpTogether(OpBuilder &b, Location loc,
                           ArrayRef<Value> compared) {
  auto equal = [&](Value x, Value y) {
    return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, x, y);
  };
  auto constant = [&](Type type, int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  };
  Type i1 = b.getI1Type(), i32 = b.getI32Type();
  Value whole = isFullWarp(b, loc);
  if (compared.empty())
    return whole;
  auto agree = scf::IfOp::create(b, loc, i1, whole, /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(agree.elseBlock());
  scf::YieldOp::create(b, loc, Value(constant(i1, 0)));
  b.setInsertionPointToStart(agree.thenBlock());
  Value same = constant(i1, 1);
  for (Value value : compared) {
    Value first = shuffle(b, loc, ShuffleMode::index, value, constant(i32, 0));
    same = arith::AndIOp::create(b, loc, same, equal(value, first));
  }
  scf::YieldOp::create(b, loc, holdsInWarp(b, loc, same));
  return agree.getResult(0);
}

warp::WarpVote warp::voteInWarp(OpBuilder &b, Location loc, Value doesIt,
                                ValueRange values, int64_t size,
                                int64_t least) {
  int64_t warpSize = subgroupSizeAt(b);
  Value no = arith::ConstantOp::create(b, loc, b.getBoolAttr(false));
  Value yes = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  SmallVector<Value> alone{no, no};
  llvm::append_range(alone, values);
  OpBuilder::InsertionGuard guard(b);
  auto enter = [&](Value condition) {
    auto branch = scf::IfOp::create(b, loc, TypeRange(ValueRange(alone)),
                                    condition, /*withElseRegion=*/true);
    b.setInsertionPointToStart(branch.elseBlock());
    scf::YieldOp::create(b, loc, alone);
    b.setInsertionPointToStart(branch.thenBlock());
    return branch;
  };
  auto full = enter(isFullWarp(b, loc));
  Value lanes = targetAt(b).emitBallot(b, loc, doesIt);
  auto number = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc,
                                     b.getIntegerAttr(lanes.getType(), value));
  };
  Value count = math::CtPopOp::create(b, loc, lanes);
  auto many = enter(arith::CmpIOp::create(b, loc, arith::CmpIPredicate::uge,
                                          count, number(least)));
  // The first lane of the group that does it; with none, some lane.
  Value base;
  if (size < warpSize) {
    Value lane = readGrid(b, loc, GridValue::laneId);
    base = arith::AndIOp::create(b, loc, lane, constant(b, loc, -size));
    Value shift = base;
    if (lanes.getType() != shift.getType())
      shift = arith::ExtUIOp::create(b, loc, lanes.getType(), shift);
    lanes = arith::ShRUIOp::create(b, loc, lanes, shift);
    lanes =
        arith::AndIOp::create(b, loc, lanes, number((int64_t(1) << size) - 1));
  }
  Value any =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, lanes, number(0));
  Value first = math::CountTrailingZerosOp::create(b, loc, lanes);
  if (!first.getType().isInteger(32))
    first = arith::TruncIOp::create(b, loc, b.getI32Type(), first);
  if (base)
    first = arith::AddIOp::create(b, loc, first, base);
  first = arith::AndIOp::create(b, loc, first, constant(b, loc, warpSize - 1));
  SmallVector<Value> agreed;
  Value same = yes;
  for (Value value : values) {
    agreed.push_back(shuffle(b, loc, ShuffleMode::index, value, first));
    Value equal = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, value,
                                        agreed.back());
    same = arith::AndIOp::create(b, loc, same, equal);
  }
  Value others = arith::XOrIOp::create(b, loc, doesIt, yes);
  Value agree = holdsInWarp(b, loc, arith::OrIOp::create(b, loc, same, others));
  SmallVector<Value> found{agree, any};
  llvm::append_range(found, agreed);
  scf::YieldOp::create(b, loc, found);
  b.setInsertionPointToEnd(full.thenBlock());
  scf::YieldOp::create(b, loc, many.getResults());
  return {full.getResult(0), full.getResult(1),
          SmallVector<Value>(full.getResults().drop_front(2))};
}

/// The upper half first, then the lower one among the lanes that have the
/// largest.
Value warp::mostInWarp(OpBuilder &b, Location loc, Value trips) {
  const TargetInfo &target = targetAt(b);
  if (trips.getType().isInteger(32))
    return target.emitActiveMax(b, loc, trips);
  Type i32 = b.getI32Type(), i64 = trips.getType();
  Value bits = arith::ConstantOp::create(b, loc, b.getIntegerAttr(i64, 32));
  Value upper = arith::TruncIOp::create(
      b, loc, i32, arith::ShRUIOp::create(b, loc, trips, bits));
  Value lower = arith::TruncIOp::create(b, loc, i32, trips);
  Value most = target.emitActiveMax(b, loc, upper);
  Value isMost =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, upper, most);
  lower = target.emitActiveMax(
      b, loc,
      arith::SelectOp::create(b, loc, isMost, lower, constant(b, loc, 0)));
  Value high = arith::ShLIOp::create(
      b, loc, arith::ExtUIOp::create(b, loc, i64, most), bits);
  return arith::OrIOp::create(b, loc, high,
                              arith::ExtUIOp::create(b, loc, i64, lower));
}

Value warp::holdsAnywhere(OpBuilder &b, Location loc, Value condition) {
  return targetAt(b).emitBlockAny(b, loc, condition);
}

Value warp::activeLanes(OpBuilder &b, Location loc) {
  return targetAt(b).emitActiveLanes(b, loc);
}

Value warp::agreesInLanes(OpBuilder &b, Location loc, Value value,
                          Value lanes) {
  return targetAt(b).emitAgree(b, loc, value, lanes);
}

void warp::synchronizeWarp(OpBuilder &b, Location loc, Value lanes) {
  targetAt(b).emitSubgroupBarrier(b, loc, lanes);
}

//===----------------------------------------------------------------------===//
// Memory of a block
//===----------------------------------------------------------------------===//

Value warp::makeShared(OpBuilder &b, Location loc, ModuleOp module, Type type,
                       StringRef name, int64_t alignment) {
  std::string unused;
  for (unsigned i = 0; unused.empty() || module.lookupSymbol(unused); ++i)
    unused = (name + "_" + Twine(i)).str();
  OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
  auto global = LLVM::GlobalOp::create(
      inModule, loc, type, /*isConstant=*/false, LLVM::Linkage::Internal,
      unused, /*value=*/Attribute(), alignment, sharedSpace);
  inModule.createBlock(&global.getInitializerRegion());
  Value undefined = LLVM::UndefOp::create(inModule, loc, type);
  LLVM::ReturnOp::create(inModule, loc, undefined);
  return LLVM::AddressOfOp::create(b, loc, global);
}

int64_t warp::sharedBytes(ModuleOp module) {
  DataLayout layout(module);
  int64_t bytes = 0;
  for (auto global : module.getOps<LLVM::GlobalOp>())
    if (global.getAddrSpace() == sharedSpace)
      bytes += llvm::alignTo(layout.getTypeSize(global.getType()), 8);
  return bytes;
}

Value warp::nameDynamicShared(OpBuilder &b, Location loc, ModuleOp module,
                              StringRef name) {
  OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
  Type type = LLVM::LLVMArrayType::get(b.getI8Type(), 0);
  auto global = LLVM::GlobalOp::create(
      inModule, loc, type, /*isConstant=*/false, LLVM::Linkage::External, name,
      /*value=*/Attribute(), /*alignment=*/1024, sharedSpace);
  return LLVM::AddressOfOp::create(b, loc, global);
}
