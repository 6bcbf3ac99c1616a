//===- BlockReduce.cpp - Combine a value over a GPU block -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two steps of the same kind. Each warp combines its 32 values by shuffles,
// halving the distance; its first lane leaves the result in shared memory, one
// slot per warp. After a barrier the first warp combines the slots.
//
//===----------------------------------------------------------------------===//

#include "BlockReduce.h"

#include "Atomics.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

constexpr int64_t warpSize = 32;
constexpr unsigned sharedSpace = 3;

static Value callIntrinsic(OpBuilder &b, Location loc, Type type,
                           StringRef name, ValueRange operands) {
  return LLVM::CallIntrinsicOp::create(b, loc, type, b.getStringAttr(name),
                                       operands)
      .getResult(0);
}

warp::BlockReduce::BlockReduce(OpBuilder &b, Location loc, ModuleOp module,
                               int64_t blockDim)
    : b(b), loc(loc), module(module), warps(blockDim / warpSize) {
  auto read = [&](StringRef name) {
    return callIntrinsic(b, loc, b.getI32Type(),
                         ("llvm.nvvm.read.ptx.sreg." + name).str(), {});
  };
  auto mul = [&](Value x, Value y) -> Value {
    return arith::MulIOp::create(b, loc, x, y);
  };
  auto add = [&](Value x, Value y) -> Value {
    return arith::AddIOp::create(b, loc, x, y);
  };
  Value row = add(read("tid.y"), mul(read("ntid.y"), read("tid.z")));
  thread = add(read("tid.x"), mul(read("ntid.x"), row));
  lane = arith::AndIOp::create(b, loc, thread, constant(warpSize - 1));
}

Value warp::BlockReduce::constant(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

Value warp::BlockReduce::isFirst() {
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, thread,
                               constant(0));
}

Value warp::BlockReduce::any(Value condition) {
  return callIntrinsic(b, loc, b.getI1Type(),
                       "llvm.nvvm.barrier.cta.red.or.aligned.all",
                       {constant(0), condition});
}

/// The value of the lane `distance` above; 64 bits travel in two halves.
Value warp::BlockReduce::shuffleDown(Value value, int64_t distance) {
  Type type = value.getType(), i32 = b.getI32Type();
  unsigned width = type.getIntOrFloatBitWidth();
  auto shuffle = [&](Value word) {
    return callIntrinsic(
        b, loc, i32, "llvm.nvvm.shfl.sync.down.i32",
        {constant(-1), word, constant(distance), constant(warpSize - 1)});
  };
  Value bits = value;
  Type bitsType = b.getIntegerType(width);
  if (type != bitsType)
    bits = arith::BitcastOp::create(b, loc, bitsType, value);
  if (width == 32) {
    bits = shuffle(bits);
  } else {
    Value half = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(32));
    Value high = arith::ShRUIOp::create(b, loc, bits, half);
    high = shuffle(arith::TruncIOp::create(b, loc, i32, high));
    Value low = shuffle(arith::TruncIOp::create(b, loc, i32, bits));
    high = arith::ExtUIOp::create(b, loc, bitsType, high);
    low = arith::ExtUIOp::create(b, loc, bitsType, low);
    high = arith::ShLIOp::create(b, loc, high, half);
    bits = arith::OrIOp::create(b, loc, high, low);
  }
  if (type == bitsType)
    return bits;
  return arith::BitcastOp::create(b, loc, type, bits);
}

Value warp::BlockReduce::overWarp(AtomicKind kind, Value value, Type type) {
  for (int64_t distance = warpSize / 2; distance > 0; distance /= 2)
    value = combine(b, loc, kind, value, shuffleDown(value, distance), type);
  return value;
}

/// Address of a slot per warp.
Value warp::BlockReduce::makeShared(Type type) {
  auto slots = LLVM::LLVMArrayType::get(type, warpSize);
  std::string name;
  for (unsigned i = 0; name.empty() || module.lookupSymbol(name); ++i)
    name = "block_reduce_" + std::to_string(i);
  OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
  auto global = LLVM::GlobalOp::create(
      inModule, loc, slots, /*isConstant=*/false, LLVM::Linkage::Internal,
      name, /*value=*/Attribute(), /*alignment=*/8, sharedSpace);
  inModule.createBlock(&global.getInitializerRegion());
  Value undefined = LLVM::UndefOp::create(inModule, loc, slots);
  LLVM::ReturnOp::create(inModule, loc, undefined);
  return LLVM::AddressOfOp::create(b, loc, global);
}

Value warp::BlockReduce::reduce(AtomicKind kind, Value value, Value identity,
                                Type type) {
  value = overWarp(kind, value, type);
  if (warps == 1)
    return value;
  Type element = value.getType();
  auto pointer = LLVM::LLVMPointerType::get(b.getContext(), sharedSpace);
  Value shared = makeShared(element);
  auto slot = [&](Value number) -> Value {
    return LLVM::GEPOp::create(b, loc, pointer, element, shared,
                               ValueRange(number));
  };
  Value firstLane = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                                          lane, constant(0));
  auto leave = scf::IfOp::create(b, loc, firstLane, /*withElseRegion=*/false);
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(leave.thenBlock());
    Value warp = arith::ShRUIOp::create(b, loc, thread, constant(5));
    LLVM::StoreOp::create(b, loc, value, slot(warp));
  }
  LLVM::CallIntrinsicOp::create(
      b, loc, b.getStringAttr("llvm.nvvm.barrier.cta.sync.aligned.all"),
      ValueRange(constant(0)));
  // Threads outside the first warp compute along; nobody looks.
  Value inside = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult, lane,
                                       constant(warps));
  Value partial = LLVM::LoadOp::create(b, loc, element, slot(lane));
  partial = arith::SelectOp::create(b, loc, inside, partial, identity);
  return overWarp(kind, partial, type);
}
