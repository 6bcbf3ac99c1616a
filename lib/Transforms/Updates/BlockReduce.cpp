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
#include "Launch/GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

warp::BlockReduce::BlockReduce(OpBuilder &b, Location loc, ModuleOp module,
                               int64_t blockDim)
    : b(b), loc(loc), module(module), warps(blockDim / warpSize) {
  thread = threadInBlock(b, loc);
  lane = arith::AndIOp::create(b, loc, thread, constant(warpSize - 1));
}

Value warp::BlockReduce::constant(int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

Value warp::BlockReduce::any(Value condition) {
  return holdsAnywhere(b, loc, condition);
}

Value warp::BlockReduce::overWarp(AtomicKind kind, Value value, Type type) {
  for (int64_t distance = warpSize / 2; distance > 0; distance /= 2)
    value = combine(b, loc, kind, value,
                    shuffle(b, loc, ShuffleMode::down, value,
                            constant(distance)),
                    type);
  return value;
}

Value warp::BlockReduce::reduce(AtomicKind kind, Value value, Value identity,
                                Type type) {
  value = overWarp(kind, value, type);
  if (warps == 1)
    return value;
  Type element = value.getType();
  auto pointer = LLVM::LLVMPointerType::get(b.getContext(), sharedSpace);
  Value shared =
      makeShared(b, loc, module, LLVM::LLVMArrayType::get(element, warpSize),
                 "block_reduce");
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
  synchronizeBlock(b, loc);
  // Threads outside the first warp compute along; nobody looks.
  Value inside = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult, lane,
                                       constant(warps));
  Value partial = LLVM::LoadOp::create(b, loc, element, slot(lane));
  partial = arith::SelectOp::create(b, loc, inside, partial, identity);
  return overWarp(kind, partial, type);
}
