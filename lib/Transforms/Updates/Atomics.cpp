//===- Atomics.cpp - Values that atomic updates compute -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Atomics.h"

#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Passes.h"
#include "warp/NativeCode.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/TypeUtilities.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;
using warp::AtomicCasOp;
using warp::AtomicComponentsOp;
using warp::AtomicKind;

Value warp::combine(OpBuilder &b, Location loc, AtomicKind kind, Value old,
                    Value value, Type type, bool anyOrder) {
  auto flags =
      anyOrder ? arith::FastMathFlags::reassoc : arith::FastMathFlags::none;
  auto make = [&]<typename Op>(auto... extra) -> Value {
    return Op::create(b, loc, old, value, extra...);
  };
  bool isFloating = isFloat(type);
  bool isUnsigned = type.isUnsignedInteger();
  switch (kind) {
  case AtomicKind::add:
    return isFloating ? make.operator()<arith::AddFOp>(flags)
                      : make.operator()<arith::AddIOp>();
  case AtomicKind::sub:
    return isFloating ? make.operator()<arith::SubFOp>(flags)
                      : make.operator()<arith::SubIOp>();
  case AtomicKind::min:
    return isFloating   ? make.operator()<arith::MinNumFOp>()
           : isUnsigned ? make.operator()<arith::MinUIOp>()
                        : make.operator()<arith::MinSIOp>();
  case AtomicKind::max:
    return isFloating   ? make.operator()<arith::MaxNumFOp>()
           : isUnsigned ? make.operator()<arith::MaxUIOp>()
                        : make.operator()<arith::MaxSIOp>();
  case AtomicKind::bit_and:
    return make.operator()<arith::AndIOp>();
  case AtomicKind::bit_or:
    return make.operator()<arith::OrIOp>();
  case AtomicKind::bit_xor:
    return make.operator()<arith::XOrIOp>();
  case AtomicKind::exch:
    return value;
  }
  llvm_unreachable("unknown atomic");
}

warp::UpdateAttr warp::getUpdate(Operation *update) {
  auto plan = update->getAttrOfType<UpdateAttr>(attr::update);
  return plan ? plan
              : UpdateAttr::get(update->getContext(), UpdateScope::thread,
                                /*run=*/0, /*sum=*/-1);
}

void warp::setUpdate(Operation *update, UpdateScope scope, int64_t run) {
  update->setAttr(attr::update,
                  UpdateAttr::get(update->getContext(), scope, run,
                                  getUpdate(update).getSum()));
}

SmallVector<warp::Leaf> warp::leavesOf(AtomicComponentsOp update) {
  SmallVector<Leaf> leaves;
  collectLeaves(cast<ArrayType>(update.getArray().getType()).getElementType(),
                0, leaves);
  return leaves;
}

bool warp::canCombine(AtomicComponentsOp update) {
  return commutes(update) &&
         llvm::all_of(update.getResultTypes(), [](Type type) {
           return type.getIntOrFloatBitWidth() >= 32;
         });
}

bool warp::tellsTurn(Operation *update) {
  auto atomic = dyn_cast<AtomicComponentsOp>(update);
  if (!atomic)
    return isa<AtomicCasOp>(update);
  return !getUpdate(atomic).isExact() &&
         (!atomic->use_empty() || atomic.getKind() == AtomicKind::exch);
}

bool warp::mayTellTurn(Operation *op) {
  auto call = dyn_cast<LibraryCallOp>(op);
  return call ? call.getCallee().starts_with(nativeTurnPrefix) : tellsTurn(op);
}

bool warp::mayTellTurns(Operation *entry) {
  return entry
      ->walk([](Operation *op) {
        return mayTellTurn(op) ? WalkResult::interrupt()
                               : WalkResult::advance();
      })
      .wasInterrupted();
}

bool warp::keepsTurns(Operation *entry) {
  return getVariant(entry).keepsThreadOrder() && mayTellTurns(entry);
}

bool warp::dependsOnOrder(Operation *update) {
  if (tellsTurn(update))
    return true;
  auto atomic = dyn_cast<AtomicComponentsOp>(update);
  return atomic && !getUpdate(atomic).isExact() &&
         combiningKind(atomic.getKind()) == AtomicKind::add &&
         llvm::any_of(atomic.getComponents().getTypes(), isFloat);
}

bool warp::hasOrderedUpdates(Operation *entry) {
  return entry
      ->walk([](Operation *op) {
        return dependsOnOrder(op) ? WalkResult::interrupt()
                                  : WalkResult::advance();
      })
      .wasInterrupted();
}

Value warp::negate(OpBuilder &b, Location loc, Value value) {
  if (isa<FloatType>(getElementTypeOrSelf(value)))
    return arith::NegFOp::create(b, loc, value);
  Value zero =
      arith::ConstantOp::create(b, loc, b.getZeroAttr(value.getType()));
  return arith::SubIOp::create(b, loc, zero, value);
}

AtomicKind warp::combiningKind(AtomicKind kind) {
  return kind == AtomicKind::sub ? AtomicKind::add : kind;
}

/// True if an array is an argument, or the gradients of one, and has no other
/// name.
static bool hasOneName(Value array) {
  auto isArgument = [](Value value) {
    auto argument = dyn_cast<BlockArgument>(value);
    return argument
               ? isa<FunctionOpInterface>(argument.getOwner()->getParentOp())
               : value.getDefiningOp<warp::ParameterOp>() != nullptr;
  };
  auto grad = array.getDefiningOp<warp::GradOp>();
  if (!grad)
    return isArgument(array);
  Value parameter = grad.getArray();
  return isArgument(parameter) &&
         llvm::none_of(parameter.getUsers(), [&](Operation *user) {
           return isa<warp::GradOp>(user) && user != grad;
         });
}

bool warp::commutes(AtomicComponentsOp op) {
  AtomicKind kind = combiningKind(op.getKind());
  if (kind != AtomicKind::add && kind != AtomicKind::min &&
      kind != AtomicKind::max)
    return false;
  return !getUpdate(op).isExact() && hasOneName(op.getArray()) &&
         llvm::all_of(op.getArray().getUsers(), [&](Operation *user) {
           auto other = dyn_cast<AtomicComponentsOp>(user);
           return isa<DimOp>(user) || (other && other->use_empty() &&
                                       combiningKind(other.getKind()) == kind);
         });
}

Value warp::identity(OpBuilder &b, Location loc, AtomicKind kind, Type type) {
  kind = combiningKind(kind);
  if (auto floatType = dyn_cast<FloatType>(type)) {
    const llvm::fltSemantics &semantics = floatType.getFloatSemantics();
    // A minimum or maximum of NaN and a number is the number.
    APFloat value = kind == AtomicKind::add
                        ? APFloat::getZero(semantics, /*Negative=*/true)
                        : APFloat::getNaN(semantics);
    return arith::ConstantOp::create(b, loc, b.getFloatAttr(type, value));
  }
  unsigned width = type.getIntOrFloatBitWidth();
  bool isUnsigned = type.isUnsignedInteger();
  APInt value = APInt::getZero(width);
  if (kind == AtomicKind::min)
    value = isUnsigned ? APInt::getMaxValue(width)
                       : APInt::getSignedMaxValue(width);
  if (kind == AtomicKind::max && !isUnsigned)
    value = APInt::getSignedMinValue(width);
  return arith::ConstantOp::create(
      b, loc, b.getIntegerAttr(b.getIntegerType(width), value));
}

bool warp::isInvariant(Value value, Block *first) {
  if (auto argument = dyn_cast<BlockArgument>(value))
    return argument.getOwner() == first;
  // To read where a thread is has no effect, and no operands that differ.
  if (getGridRead(value))
    return false;
  Operation *op = value.getDefiningOp();
  return isPure(op) && op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return isInvariant(operand, first);
         });
}

Value warp::cloneInvariant(OpBuilder &b, Value value, Block *first,
                           IRMapping &clones) {
  if (value.getParentBlock() == first)
    return value;
  if (Value known = clones.lookupOrNull(value))
    return known;
  Operation *op = value.getDefiningOp();
  for (Value operand : op->getOperands())
    clones.map(operand, cloneInvariant(b, operand, first, clones));
  b.clone(*op, clones);
  return clones.lookup(value);
}
