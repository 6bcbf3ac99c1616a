//===- SumFunctions.cpp - Functions that add to exact sums ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A float is a whole number, `fraction`, shifted left by its exponent, in units
// of the least subnormal number. The shift divided by 28 is the weight of its
// lowest digit, the rest says how the fraction falls apart into digits, which
// all have the sign of the float. Digits that are 0 cost nothing.
//
//===----------------------------------------------------------------------===//

#include "SumFunctions.h"

#include "warp/ExactSums.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using namespace warp;
using arith::CmpIPredicate;

Value SumFunctions::constant(Type type, int64_t value) {
  Location loc = module.getLoc();
  return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

Value SumFunctions::element(Type type, Value array, Value index) {
  return LLVM::GEPOp::create(b, module.getLoc(), array.getType(), type, array,
                             index, LLVM::GEPNoWrapFlags::inbounds);
}

void SumFunctions::call(OpBuilder &caller, Location loc, StringRef name,
                        ValueRange operands, Body body) {
  auto function = module.lookupSymbol<LLVM::LLVMFuncOp>(name);
  if (!function) {
    b.setInsertionPointToStart(module.getBody());
    auto type = LLVM::LLVMFunctionType::get(
        LLVM::LLVMVoidType::get(b.getContext()),
        llvm::to_vector(operands.getTypes()));
    function = LLVM::LLVMFuncOp::create(b, module.getLoc(), name, type,
                                        LLVM::Linkage::Internal);
    Block *block = function.addEntryBlock(b);
    b.setInsertionPointToStart(block);
    body(block->getArguments());
    b.setInsertionPointToEnd(block);
    LLVM::ReturnOp::create(b, module.getLoc(), ValueRange());
  }
  LLVM::CallOp::create(caller, loc, function, operands);
}

/// Notes that a digit of a weight is touched, the first time.
void SumFunctions::mark(const SumPlace &to, Value weight, unsigned width) {
  Location loc = module.getLoc();
  Type i32 = b.getI32Type(), i64 = b.getI64Type();
  Value place = element(i32, to.touched, weight);
  Value marked = LLVM::LoadOp::create(b, loc, i32, place);
  Value isNew = arith::CmpIOp::create(b, loc, CmpIPredicate::eq, marked,
                                      constant(i32, 0));
  auto ifNew = scf::IfOp::create(b, loc, isNew, /*withElseRegion=*/false);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(ifNew.thenBlock());
  LLVM::StoreOp::create(b, loc, constant(i32, 1), place);
  int64_t count = countDigits(width);
  auto raise = [&](int64_t number, Value bound) {
    LLVM::AtomicRMWOp::create(b, loc, LLVM::AtomicBinOp::max,
                              element(i32, to.touched, constant(i64, number)),
                              arith::TruncIOp::create(b, loc, i32, bound),
                              LLVM::AtomicOrdering::monotonic, scope, 4);
  };
  raise(count + 1, arith::SubIOp::create(b, loc, constant(i64, count), weight));
  raise(count + 2, arith::AddIOp::create(b, loc, weight, constant(i64, 1)));
}

/// The word of a weight.
Value SumFunctions::wordAt(const SumPlace &to, Value weight) {
  Location loc = module.getLoc();
  Value row = arith::MulIOp::create(b, loc, weight, to.count);
  return element(b.getI64Type(), to.digits,
                 arith::AddIOp::create(b, loc, row, to.number));
}

/// Adds to one word. An atomic instruction is saved where nothing is added;
/// otherwise a branch would cost more than it saves.
void SumFunctions::combine(const SumPlace &to, Value weight, Value digit,
                           unsigned width, bool shared) {
  Location loc = module.getLoc();
  Type i64 = b.getI64Type();
  OpBuilder::InsertionGuard guard(b);
  if (!shared) {
    mark(to, weight, width);
    Value word = wordAt(to, weight);
    Value old = LLVM::LoadOp::create(b, loc, i64, word);
    LLVM::StoreOp::create(b, loc, arith::AddIOp::create(b, loc, old, digit),
                          word);
    return;
  }
  Value any = arith::CmpIOp::create(b, loc, CmpIPredicate::ne, digit,
                                    constant(i64, 0));
  auto ifAny = scf::IfOp::create(b, loc, any, /*withElseRegion=*/false);
  b.setInsertionPointToStart(ifAny.thenBlock());
  mark(to, weight, width);
  LLVM::AtomicRMWOp::create(b, loc, LLVM::AtomicBinOp::add, wordAt(to, weight),
                            digit, LLVM::AtomicOrdering::monotonic, scope, 8);
}

/// Sets flags, which is rare.
void SumFunctions::setFlags(const SumPlace &to, Value flags, unsigned width) {
  Location loc = module.getLoc();
  Type i32 = b.getI32Type();
  Value weight = constant(b.getI64Type(), countDigits(width));
  LLVM::StoreOp::create(b, loc, constant(i32, 1),
                        element(i32, to.touched, weight));
  LLVM::AtomicRMWOp::create(b, loc, LLVM::AtomicBinOp::_or, wordAt(to, weight),
                            flags, LLVM::AtomicOrdering::monotonic, scope, 8);
}

/// Digits of `fraction << shift`; the shift is less than a digit.
SmallVector<Value> SumFunctions::split(Value fraction, Value shift,
                                       unsigned count) {
  Location loc = module.getLoc();
  Type i64 = b.getI64Type();
  Value mask = constant(i64, (int64_t(1) << digitBits) - 1);
  Value low = arith::ShLIOp::create(b, loc, fraction, shift);
  SmallVector<Value> digits{arith::AndIOp::create(b, loc, low, mask)};
  for (unsigned i = 1; i < count; ++i) {
    Value down = arith::SubIOp::create(b, loc, constant(i64, i * digitBits),
                                       shift);
    Value rest = arith::ShRUIOp::create(b, loc, fraction, down);
    digits.push_back(arith::AndIOp::create(b, loc, rest, mask));
  }
  return digits;
}

void SumFunctions::add(OpBuilder &caller, Location loc, const SumPlace &to,
                       Value value, bool shared) {
  std::string name = std::string(shared ? "warp_add_exactly_f"
                                        : "warp_add_exactly_alone_f") +
                     (value.getType().isF32() ? "32" : "64");
  call(caller, loc, name, {to.digits, to.touched, to.count, to.number, value},
       [&](ValueRange arguments) { buildAdd(arguments, shared); });
}

void SumFunctions::takeApart(Value value, const SumPlace &to,
                             function_ref<void(Value, ValueRange)> add) {
  Location loc = module.getLoc();
  auto type = cast<FloatType>(value.getType());
  unsigned width = type.getWidth(), mantissa = type.getFPMantissaWidth() - 1;
  Type i64 = b.getI64Type(), word = b.getIntegerType(width);
  auto compare = [&](CmpIPredicate predicate, Value x, int64_t y) -> Value {
    return arith::CmpIOp::create(b, loc, predicate, x, constant(i64, y));
  };
  Value bits = arith::BitcastOp::create(b, loc, word, value);
  // From here on 64 bits, with the sign in all of the upper ones.
  if (width != 64)
    bits = arith::ExtSIOp::create(b, loc, i64, bits);
  Value sign = arith::ShRSIOp::create(b, loc, bits, constant(i64, 63));
  int64_t hidden = int64_t(1) << mantissa;
  int64_t infinity = (int64_t(1) << (width - 1)) - hidden;
  Value magnitude = arith::AndIOp::create(
      b, loc, bits, constant(i64, infinity | (hidden - 1)));
  auto branch = scf::IfOp::create(
      b, loc, compare(CmpIPredicate::ult, magnitude, infinity),
      /*withElseRegion=*/true);

  b.setInsertionPointToStart(branch.thenBlock());
  Value one = constant(i64, 1), unit = constant(i64, digitBits);
  Value field =
      arith::ShRUIOp::create(b, loc, magnitude, constant(i64, mantissa));
  Value fraction =
      arith::AndIOp::create(b, loc, magnitude, constant(i64, hidden - 1));
  Value normal = arith::OrIOp::create(b, loc, fraction, constant(i64, hidden));
  Value isNormal = compare(CmpIPredicate::ne, field, 0);
  fraction = arith::SelectOp::create(b, loc, isNormal, normal, fraction);
  Value shift = arith::SelectOp::create(
      b, loc, isNormal, arith::SubIOp::create(b, loc, field, one),
      constant(i64, 0));
  Value weight = arith::DivUIOp::create(b, loc, shift, unit);
  Value rest = arith::RemUIOp::create(b, loc, shift, unit);
  SmallVector<Value> digits = split(fraction, rest, width == 32 ? 2 : 3);
  for (Value &digit : digits) {
    Value flipped = arith::XOrIOp::create(b, loc, digit, sign);
    digit = arith::SubIOp::create(b, loc, flipped, sign);
  }
  add(weight, digits);

  b.setInsertionPointToStart(branch.elseBlock());
  Value isPositive = compare(CmpIPredicate::eq, sign, 0);
  Value flag = arith::SelectOp::create(b, loc, isPositive,
                                       constant(i64, addedInfinity),
                                       constant(i64, addedMinusInfinity));
  Value isNaN = compare(CmpIPredicate::ugt, magnitude, infinity);
  flag = arith::SelectOp::create(b, loc, isNaN, constant(i64, addedNaN), flag);
  setFlags(to, flag, width);
}

void SumFunctions::buildAdd(ValueRange arguments, bool shared) {
  SumPlace to{arguments[0], arguments[1], arguments[2], arguments[3]};
  unsigned width = arguments[4].getType().getIntOrFloatBitWidth();
  takeApart(arguments[4], to, [&](Value weight, ValueRange digits) {
    for (Value digit : digits) {
      combine(to, weight, digit, width, shared);
      weight = arith::AddIOp::create(b, module.getLoc(), weight,
                                     constant(b.getI64Type(), 1));
    }
  });
}

void SumFunctions::addToWindow(OpBuilder &caller, Location loc,
                               const SumPlace &to, Value value, Value window) {
  std::string name = std::string("warp_add_to_window_f") +
                     (value.getType().isF32() ? "32" : "64");
  call(caller, loc, name,
       {to.digits, to.touched, to.count, to.number, value, window},
       [&](ValueRange arguments) { buildAddToWindow(arguments); });
}

/// The first float of a thread decides where its window lies: it leaves room
/// for floats with a weight of one less and one more.
void SumFunctions::buildAddToWindow(ValueRange arguments) {
  Location loc = module.getLoc();
  SumPlace to{arguments[0], arguments[1], arguments[2], arguments[3]};
  Value window = arguments[5];
  Type i64 = b.getI64Type();
  auto slot = [&](int64_t number) {
    return element(i64, window, constant(i64, number));
  };
  auto equal = [&](Value x, int64_t y) -> Value {
    return arith::CmpIOp::create(b, loc, CmpIPredicate::eq, x,
                                 constant(i64, y));
  };
  unsigned width = arguments[4].getType().getIntOrFloatBitWidth();
  auto add = [&](Value weight, ValueRange digits) {
    Value any = digits[0];
    for (Value digit : digits.drop_front())
      any = arith::OrIOp::create(b, loc, any, digit);
    auto ifZero = scf::IfOp::create(b, loc, equal(any, 0),
                                    /*withElseRegion=*/true);
    b.setInsertionPointToStart(ifZero.elseBlock());
    Value place = LLVM::LoadOp::create(b, loc, i64, slot(0));
    place = arith::SelectOp::create(b, loc, equal(place, emptyWindow), weight,
                                    place);
    LLVM::StoreOp::create(b, loc, place, slot(0));
    // Slot of the first digit.
    Value offset = arith::AddIOp::create(
        b, loc, arith::SubIOp::create(b, loc, weight, place), constant(i64, 1));
    Value fits = arith::CmpIOp::create(b, loc, CmpIPredicate::ult, offset,
                                       constant(i64, 3));
    auto ifFits = scf::IfOp::create(b, loc, fits, /*withElseRegion=*/true);
    b.setInsertionPointToStart(ifFits.thenBlock());
    for (int64_t i = 0; i < windowDigits(width); ++i) {
      Value total = LLVM::LoadOp::create(b, loc, i64, slot(i + 1));
      for (auto [j, digit] : llvm::enumerate(digits)) {
        Value part = arith::SelectOp::create(
            b, loc, equal(offset, i - int64_t(j)), digit, constant(i64, 0));
        total = arith::AddIOp::create(b, loc, total, part);
      }
      LLVM::StoreOp::create(b, loc, total, slot(i + 1));
    }
    b.setInsertionPointToStart(ifFits.elseBlock());
    for (auto [j, digit] : llvm::enumerate(digits)) {
      Value at = arith::AddIOp::create(b, loc, weight, constant(i64, j));
      combine(to, at, digit, width, /*shared=*/true);
    }
  };
  takeApart(arguments[4], to, add);
}

void SumFunctions::addDigit(OpBuilder &caller, Location loc, const SumPlace &to,
                            Value weight, Value digit, unsigned width) {
  call(caller, loc, "warp_add_digit_f" + std::to_string(width),
       {to.digits, to.touched, to.count, to.number, weight, digit},
       [&](ValueRange arguments) {
         SumPlace place{arguments[0], arguments[1], arguments[2], arguments[3]};
         combine(place, arguments[4], arguments[5], width, /*shared=*/true);
       });
}

void SumFunctions::addSum(OpBuilder &caller, Location loc, const SumPlace &to,
                          Value digits, Value touched, unsigned width,
                          bool shared) {
  std::string name =
      std::string(shared ? "warp_add_sum_f" : "warp_add_sum_alone_f") +
      std::to_string(width);
  call(caller, loc, name,
       {to.digits, to.touched, to.count, to.number, digits, touched},
       [&](ValueRange arguments) { buildAddSum(arguments, width, shared); });
}

void SumFunctions::buildAddSum(ValueRange arguments, unsigned width,
                               bool shared) {
  Location loc = module.getLoc();
  SumPlace to{arguments[0], arguments[1], arguments[2], arguments[3]};
  Type i32 = b.getI32Type(), i64 = b.getI64Type();
  auto addWord = [&](Value weight, bool isFlag) {
    Value mark = LLVM::LoadOp::create(b, loc, i32,
                                      element(i32, arguments[5], weight));
    Value isTouched = arith::CmpIOp::create(b, loc, CmpIPredicate::ne, mark,
                                            constant(i32, 0));
    auto ifTouched =
        scf::IfOp::create(b, loc, isTouched, /*withElseRegion=*/false);
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(ifTouched.thenBlock());
    Value digit = LLVM::LoadOp::create(b, loc, i64,
                                       element(i64, arguments[4], weight));
    if (isFlag)
      setFlags(to, digit, width);
    else
      combine(to, weight, digit, width, shared);
  };
  Value last = constant(i64, countDigits(width));
  auto loop = scf::ForOp::create(b, loc, constant(i64, 0), last,
                                 constant(i64, 1));
  {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(loop.getBody());
    addWord(loop.getInductionVar(), /*isFlag=*/false);
  }
  b.setInsertionPointAfter(loop);
  addWord(last, /*isFlag=*/true);
}
