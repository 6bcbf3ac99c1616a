//===- GpuBlock.cpp - Threads and memory of a GPU block -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// What passes need that let the threads of a block work together.
//
//===----------------------------------------------------------------------===//

#include "GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

using namespace mlir;

Value warp::callIntrinsic(OpBuilder &b, Location loc, Type type,
                          StringRef name, ValueRange operands) {
  return LLVM::CallIntrinsicOp::create(b, loc, type, b.getStringAttr(name),
                                       operands)
      .getResult(0);
}

/// 64 bits travel in two halves.
Value warp::shuffle(OpBuilder &b, Location loc, StringRef mode, Value value,
                    Value lane) {
  Type type = value.getType(), i32 = b.getI32Type();
  unsigned width = type.getIntOrFloatBitWidth();
  Value all = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(-1));
  Value clamp =
      arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(warpSize - 1));
  auto move = [&](Value word) {
    return callIntrinsic(b, loc, i32,
                         ("llvm.nvvm.shfl.sync." + mode + ".i32").str(),
                         {all, word, lane, clamp});
  };
  Value bits = value;
  Type bitsType = b.getIntegerType(width);
  if (type != bitsType)
    bits = arith::BitcastOp::create(b, loc, bitsType, value);
  if (width == 32) {
    bits = move(bits);
  } else {
    Value half = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(32));
    Value high = arith::ShRUIOp::create(b, loc, bits, half);
    high = move(arith::TruncIOp::create(b, loc, i32, high));
    Value low = move(arith::TruncIOp::create(b, loc, i32, bits));
    high = arith::ExtUIOp::create(b, loc, bitsType, high);
    low = arith::ExtUIOp::create(b, loc, bitsType, low);
    high = arith::ShLIOp::create(b, loc, high, half);
    bits = arith::OrIOp::create(b, loc, high, low);
  }
  if (type == bitsType)
    return bits;
  return arith::BitcastOp::create(b, loc, type, bits);
}

Value warp::overLanes(OpBuilder &b, Location loc, Value value,
                      function_ref<Value(Value, Value)> combine) {
  for (int64_t distance = 1; distance < warpSize; distance *= 2) {
    Value lane =
        arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(distance));
    value = combine(value, shuffle(b, loc, "bfly", value, lane));
  }
  return value;
}

void warp::synchronizeBlock(OpBuilder &b, Location loc) {
  Value barrier = arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(0));
  LLVM::CallIntrinsicOp::create(
      b, loc, b.getStringAttr("llvm.nvvm.barrier.cta.sync.aligned.all"),
      ValueRange(barrier));
}

Value warp::readSpecial(OpBuilder &b, Location loc, StringRef name) {
  return callIntrinsic(b, loc, b.getI32Type(),
                       ("llvm.nvvm.read.ptx.sreg." + name).str(), {});
}

Value warp::threadInBlock(OpBuilder &b, Location loc) {
  auto read = [&](StringRef name) { return readSpecial(b, loc, name); };
  auto mul = [&](Value x, Value y) -> Value {
    return arith::MulIOp::create(b, loc, x, y);
  };
  auto add = [&](Value x, Value y) -> Value {
    return arith::AddIOp::create(b, loc, x, y);
  };
  Value row = add(read("tid.y"), mul(read("ntid.y"), read("tid.z")));
  return add(read("tid.x"), mul(read("ntid.x"), row));
}

Value warp::makeShared(OpBuilder &b, Location loc, ModuleOp module, Type type,
                       StringRef name) {
  std::string unused;
  for (unsigned i = 0; unused.empty() || module.lookupSymbol(unused); ++i)
    unused = (name + "_" + Twine(i)).str();
  OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
  auto global = LLVM::GlobalOp::create(
      inModule, loc, type, /*isConstant=*/false, LLVM::Linkage::Internal,
      unused, /*value=*/Attribute(), /*alignment=*/8, sharedSpace);
  inModule.createBlock(&global.getInitializerRegion());
  Value undefined = LLVM::UndefOp::create(inModule, loc, type);
  LLVM::ReturnOp::create(inModule, loc, undefined);
  return LLVM::AddressOfOp::create(b, loc, global);
}
