//===- LowerAtomics.cpp - Atomic updates of array elements ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One `atomicrmw` or `cmpxchg` per component, relaxed. Operations that a
// processor does not have (half precision) LLVM expands to a loop of compare
// and exchange, so every component type is covered here by one table. Minima
// and maxima of floats are such loops here, which end where nothing is to be
// stored. Sums of floats on newer GPUs take two at once (PairedUpdates.cpp).
//
// An entry with an exclusive schedule runs alone; its updates are plain loads
// and stores.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"
#include "Updates/Atomics.h"
#include "Updates/PairedUpdates.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using namespace warp;

/// `type` still has its sign. Limits of floats are no single operation.
static LLVM::AtomicBinOp getBinOp(AtomicKind kind, mlir::Type type) {
  bool isFloating = isFloat(type);
  bool isUnsigned = type.isUnsignedInteger();
  using Op = LLVM::AtomicBinOp;
  switch (kind) {
  case AtomicKind::add:
  case AtomicKind::sub:
    // A float is subtracted by adding its negative.
    if (isFloating)
      return Op::fadd;
    return kind == AtomicKind::add ? Op::add : Op::sub;
  case AtomicKind::min:
    return isUnsigned ? Op::umin : Op::min;
  case AtomicKind::max:
    return isUnsigned ? Op::umax : Op::max;
  case AtomicKind::bit_and:
    return Op::_and;
  case AtomicKind::bit_or:
    return Op::_or;
  case AtomicKind::bit_xor:
    return Op::_xor;
  case AtomicKind::exch:
    return Op::xchg;
  }
  llvm_unreachable("unknown atomic");
}

/// Loads, combines and stores, for an entry that runs alone.
mlir::Value ArrayLowering::plainUpdate(AtomicKind kind, mlir::Value value,
                                       mlir::Type type, mlir::Value at) {
  mlir::Value old =
      LLVM::LoadOp::create(b, loc, value.getType(), at, getByteSize(type));
  LLVM::StoreOp::create(b, loc, combine(b, loc, kind, old, value, type), at,
                        getByteSize(type));
  return old;
}

/// A loop around `cmpxchg`, as LLVM would make of a minimum, but with zeros in
/// order, and without the exchange where the element stays as it is: most
/// updates of a minimum are too late.
static mlir::Value limitUpdate(OpBuilder &b, Location loc, AtomicKind kind,
                               mlir::Value value, mlir::Type type,
                               mlir::Value at, StringRef scope) {
  mlir::Type real = value.getType();
  mlir::Type bits = b.getIntegerType(real.getIntOrFloatBitWidth());
  mlir::Value first = LLVM::LoadOp::create(
      b, loc, bits, at, getByteSize(type), /*isVolatile=*/false,
      /*isNonTemporal=*/false, /*isInvariant=*/false,
      /*isInvariantGroup=*/false, LLVM::AtomicOrdering::monotonic, scope);
  auto attempt = [&](OpBuilder &b, Location loc, ValueRange held) {
    mlir::Value old = LLVM::BitcastOp::create(b, loc, real, held[0]);
    mlir::Value made = LLVM::BitcastOp::create(
        b, loc, bits, combine(b, loc, kind, old, value, type));
    mlir::Value changes =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, made, held[0]);
    auto exchange = [&](OpBuilder &b, Location loc) {
      mlir::Value pair = LLVM::AtomicCmpXchgOp::create(
          b, loc, at, held[0], made, LLVM::AtomicOrdering::monotonic,
          LLVM::AtomicOrdering::monotonic, scope, getByteSize(type));
      mlir::Value seen = LLVM::ExtractValueOp::create(b, loc, pair, 0);
      mlir::Value done = LLVM::ExtractValueOp::create(b, loc, pair, 1);
      mlir::Value yes = arith::ConstantIntOp::create(b, loc, 1, 1);
      mlir::Value again = arith::XOrIOp::create(b, loc, done, yes);
      scf::YieldOp::create(b, loc, ValueRange{seen, again});
    };
    auto keep = [&](OpBuilder &b, Location loc) {
      scf::YieldOp::create(b, loc, ValueRange{held[0], changes});
    };
    auto tried = scf::IfOp::create(b, loc, changes, exchange, keep);
    scf::ConditionOp::create(b, loc, tried.getResult(1), tried.getResult(0));
  };
  auto loop =
      scf::WhileOp::create(b, loc, bits, first, attempt,
                           [](OpBuilder &b, Location loc, ValueRange seen) {
                             scf::YieldOp::create(b, loc, seen);
                           });
  return LLVM::BitcastOp::create(b, loc, real, loop.getResult(0));
}

mlir::Value ArrayLowering::atomicUpdate(AtomicKind kind, mlir::Value value,
                                        mlir::Type type, mlir::Value at) {
  if (exclusive)
    return plainUpdate(kind, value, type, at);
  bool isLimit = kind == AtomicKind::min || kind == AtomicKind::max;
  StringRef scope = target.getLaunchScope();
  if (isLimit && isFloat(type))
    return limitUpdate(b, loc, kind, value, type, at, scope);
  if (kind == AtomicKind::sub && isFloat(type))
    value = arith::NegFOp::create(b, loc, value);
  return LLVM::AtomicRMWOp::create(b, loc, getBinOp(kind, type), at, value,
                                   LLVM::AtomicOrdering::monotonic, scope,
                                   getByteSize(type));
}

void ArrayLowering::lowerAtomic(AtomicComponentsOp op) {
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  Address at = address(op.getArray(), op.getIndices());
  int64_t alignment = getParts(op.getArray()).alignment;
  if (!exclusive && canAddInPairs(entry, op, leaves, at.pointer, alignment)) {
    SmallVector<mlir::Value> terms(op.getComponents());
    if (op.getKind() == AtomicKind::sub)
      for (mlir::Value &term : terms)
        term = arith::NegFOp::create(b, loc, term);
    return addInPairs(b, loc, target, terms, at.pointer);
  }
  auto old = guarded(op, op.getArray(), at, op.getComponents().getTypes(), [&] {
    SmallVector<mlir::Value> results;
    for (auto [leaf, value] : llvm::zip(leaves, op.getComponents()))
      results.push_back(atomicUpdate(op.getKind(), value, leaf.type,
                                     advance(at.pointer, leaf.offset)));
    return results;
  });
  op->replaceAllUsesWith(old);
}

void ArrayLowering::lowerAtomicCas(AtomicCasOp op) {
  Address at = address(op.getArray(), op.getIndices());
  mlir::Type type = op.getValue().getType();
  auto old = guarded(op, op.getArray(), at, type, [&] {
    mlir::Value expected = op.getExpected(), value = op.getValue();
    mlir::Type bits = b.getIntegerType(type.getIntOrFloatBitWidth());
    if (isFloat(type)) {
      expected = arith::BitcastOp::create(b, loc, bits, expected);
      value = arith::BitcastOp::create(b, loc, bits, value);
    }
    mlir::Value pair = LLVM::AtomicCmpXchgOp::create(
        b, loc, at.pointer, expected, value, LLVM::AtomicOrdering::monotonic,
        LLVM::AtomicOrdering::monotonic, target.getLaunchScope());
    mlir::Value result = LLVM::ExtractValueOp::create(b, loc, pair, 0);
    if (isFloat(type))
      result = arith::BitcastOp::create(b, loc, type, result);
    return SmallVector<mlir::Value>{result};
  });
  op->replaceAllUsesWith(old);
}
