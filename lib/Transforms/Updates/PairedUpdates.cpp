//===- PairedUpdates.cpp - Vector atomics of two components ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Some GPUs add two floats at once, where the address of the first is a
// multiple of eight. Elements with an even number of floats begin at one if
// their array does. Elements with an odd number, such as vec3, begin at one in
// turn. There the pairs come first and one float is left over, elsewhere one
// float comes first:
//
//   address      8 k         8 k + 4     8 k + 8     8 k + 12
//   even         [ x           y ]         z
//   odd                        x         [ y           z ]
//
// Its number among the two only selects values and addresses.
//
//===----------------------------------------------------------------------===//

#include "PairedUpdates.h"

#include "Atomics.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

using namespace mlir;

constexpr int64_t floatSize = 4, pairSize = 8;

bool warp::canAddInPairs(Operation *entry, AtomicComponentsOp op,
                         ArrayRef<Leaf> leaves, Value pointer,
                         int64_t alignment) {
  VariantAttr variant = getVariant(entry);
  // There are none for shared memory.
  auto space = cast<LLVM::LLVMPointerType>(pointer.getType()).getAddressSpace();
  if (space == sharedSpace ||
      !getTarget(entry).has(Feature::PairedFloatAtomics) ||
      variant.getDebug() || !op->use_empty() ||
      combiningKind(op.getKind()) != AtomicKind::add)
    return false;
  for (auto [i, leaf] : llvm::enumerate(leaves))
    if (!leaf.type.isF32() || leaf.offset != int64_t(i) * floatSize)
      return false;
  if (leaves.size() % 2 == 0)
    return alignment % pairSize == 0;
  return leaves.size() >= 3;
}

void warp::addInPairs(OpBuilder &b, Location loc, const TargetInfo &target,
                      ValueRange values, Value pointer) {
  Type i64 = b.getI64Type();
  auto constant = [&](int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(value));
  };
  auto advance = [&](LLVM::GEPArg bytes) {
    return LLVM::GEPOp::create(b, loc, pointer.getType(), b.getI8Type(),
                               pointer, ArrayRef<LLVM::GEPArg>(bytes));
  };
  if (values.size() % 2 == 0) {
    for (size_t i = 0; i < values.size(); i += 2)
      target.emitPairedAtomic(b, loc, advance(int32_t(i * floatSize)),
                              values[i], values[i + 1]);
    return;
  }
  int64_t last = values.size() - 1;
  Value address = LLVM::PtrToIntOp::create(b, loc, i64, pointer);
  Value shift = arith::AndIOp::create(b, loc, address, constant(floatSize));
  Value isOdd = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, shift,
                                      constant(0));
  auto choose = [&](Value odd, Value even) -> Value {
    return arith::SelectOp::create(b, loc, isOdd, odd, even);
  };
  Value single = advance(choose(constant(0), constant(last * floatSize)));
  LLVM::AtomicRMWOp::create(
      b, loc, LLVM::AtomicBinOp::fadd, single, choose(values[0], values[last]),
      LLVM::AtomicOrdering::monotonic, target.getLaunchScope(), floatSize);
  pointer = advance(shift);
  for (int64_t i = 0; i < last; i += 2)
    target.emitPairedAtomic(b, loc, advance(int32_t(i * floatSize)),
                            choose(values[i + 1], values[i]),
                            choose(values[i + 2], values[i + 1]));
}
