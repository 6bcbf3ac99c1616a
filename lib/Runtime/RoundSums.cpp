//===- RoundSums.cpp - Rounding of exact sums -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernel that ends a launch with exact sums, one thread per number. It goes
// through the digits twice: the carry that is left after the last digit tells
// the sign of the sum, and the digits of its absolute value have one of three
// fates: the highest that is not zero and the two below it make the fraction,
// all others only say whether something was lost when it is rounded, to nearest
// and ties to even. An element that no update touched is not written.
//
// The former value of the element is one more term of the sum. It is exchanged
// only if it still is that, so that launches of several threads or streams may
// add to one array.
//
//===----------------------------------------------------------------------===//

#include "ExactSums.h"
#include "warp/Forks.h"

using namespace warp;

namespace {

/// A value of 64 bits, or a condition, with operators.
struct Number64 {
  Builder *b;
  Value value;

  Number64 lift(int64_t number) const {
    return {b, b->constant(Type::parse("si64"), number)};
  }
  Number64 apply(const char *name, Number64 other) const {
    return {b, b->builtin(name, {value, other.value}).values[0]};
  }
  Number64 operator+(Number64 y) const { return apply("add", y); }
  Number64 operator-(Number64 y) const { return apply("sub", y); }
  Number64 operator*(Number64 y) const { return apply("mul", y); }
  Number64 operator&(Number64 y) const { return apply("bit_and", y); }
  Number64 operator|(Number64 y) const { return apply("bit_or", y); }
  Number64 operator<<(Number64 y) const { return apply("lshift", y); }
  Number64 operator>>(Number64 y) const { return apply("rshift", y); }
  Number64 operator==(Number64 y) const { return apply("eq", y); }
  Number64 operator!=(Number64 y) const { return apply("ne", y); }
  Number64 operator<(Number64 y) const { return apply("lt", y); }
  Number64 operator&(int64_t y) const { return *this & lift(y); }
  Number64 operator<<(int64_t y) const { return *this << lift(y); }
  Number64 operator>>(int64_t y) const { return *this >> lift(y); }
  Number64 operator+(int64_t y) const { return *this + lift(y); }
  Number64 operator-(int64_t y) const { return *this - lift(y); }
  Number64 operator*(int64_t y) const { return *this * lift(y); }
  Number64 operator==(int64_t y) const { return *this == lift(y); }
  Number64 operator!=(int64_t y) const { return *this != lift(y); }
  Number64 operator<(int64_t y) const { return *this < lift(y); }
};

/// The branch that is not taken is computed, too.
Number64 choose(Number64 condition, Number64 yes, Number64 no) {
  return {yes.b, yes.b->builtin("where", {condition.value, yes.value, no.value})
                     .values[0]};
}

class RoundingKernel {
public:
  explicit RoundingKernel(int width);
  Module finish() { return b.finish(); }

private:
  using N = Number64;
  using Values = Builder::Values;

  N wrap(Value value) { return {&b, value}; }
  N number(int64_t value) { return zero.lift(value); }
  N bitsOf(Value real);
  Value realOf(N bits);
  /// A word of the sum, 0 if it was never touched.
  N word(Value weight);
  void splitOld(N magnitude, N isNegative);
  /// Digit of the sum and the old element, before carrying.
  N digit(Value weight);
  N carryOverAll();
  N round(N sign);
  N compose(N top, const N (&window)[3], N lost);
  Value roundOrNot(Value old);
  Value exceptional(Value old, N flags);
  /// True if a digit of the number is not zero.
  N anyWord();
  /// The weights from the lowest to the highest digit of the sum and the old
  /// element, and of what is carried.
  Values beginDigits(const Values &inits);

  int width, mantissa, count;
  int64_t infinity;
  Builder b;
  Type real, bits, wide;
  Value out, digits, touched, index;
  N zero, flags;
  /// Digits of the old element, and the weight of the first.
  N own[3], ownWeight;
  /// Weights of all that was touched: from the first, before the last.
  N lowest, highest;
};

} // namespace

RoundingKernel::RoundingKernel(int width)
    : width(width), mantissa(width == 32 ? 23 : 52), count(countDigits(width)),
      infinity(width == 32 ? int64_t(0xff) << 23 : int64_t(0x7ff) << 52),
      b("round_sums"), real(Type::parse(width == 32 ? "f32" : "f64")),
      bits(Type::parse(width == 32 ? "ui32" : "ui64")),
      wide(Type::parse("si64")) {
  auto arguments =
      b.beginFunction("round_sums", {"out", "digits", "touched"},
                      {Type::parse("!warp.array<1 x " + real.str() + ">"),
                       Type::parse("!warp.array<2 x si64>"),
                       Type::parse("!warp.array<1 x si32>")},
                      /*isKernel=*/true);
  out = arguments[0];
  digits = arguments[1];
  touched = arguments[2];
  index = b.tid(1)[0];
  zero = wrap(b.zero(wide));
  auto mark = [&](int64_t place) {
    return wrap(b.cast(b.load(touched, {number(place).value}), wide));
  };
  lowest = number(count) - mark(count + 1);
  highest = mark(count + 2);
  flags = word(number(count).value);
  N any = anyWord() | flags;
  b.beginIf((any != 0).value);
  Value again = b.beginWhile({b.constant(Type::parse("i1"), true)})[0];
  b.whileCondition(again, {again});
  Value old = b.load(out, {index});
  Value found = b.atomicCas(out, {index}, old, roundOrNot(old));
  b.endWhile({(bitsOf(found) != bitsOf(old)).value});
  b.beginElse();
  b.endIf({}, {});
  b.endFunction({});
}

Number64 RoundingKernel::bitsOf(Value value) {
  return wrap(b.cast(b.bitcast(value, bits), wide));
}

Value RoundingKernel::realOf(N value) {
  return b.bitcast(b.cast(value.value, bits), real);
}

Number64 RoundingKernel::word(Value weight) {
  Value mark = b.load(touched, {weight});
  b.beginIf(b.builtin("ne", {mark, b.zero(mark.type())}).values[0]);
  Value found = b.load(digits, {weight, index});
  b.beginElse();
  return wrap(b.endIf({found}, {zero.value})[0]);
}

Number64 RoundingKernel::anyWord() {
  auto loop =
      b.beginFor(lowest.value, highest.value, number(1).value, {zero.value});
  return wrap(b.endFor({(wrap(loop[1]) | word(loop[0])).value})[0]);
}

Builder::Values RoundingKernel::beginDigits(const Values &inits) {
  N begin = lowest.apply("min", ownWeight);
  // A word carries less than 2^36, which is two digits.
  N end = highest.apply("max", ownWeight + 3) + 2;
  end = end.apply("min", number(count));
  return b.beginFor(begin.value, end.value, number(1).value, inits);
}

/// As `SumFunctions` does it for terms.
void RoundingKernel::splitOld(N magnitude, N isNegative) {
  int64_t hidden = int64_t(1) << mantissa;
  N field = magnitude >> mantissa;
  N isSubnormal = field == 0;
  N fraction = magnitude & (hidden - 1);
  fraction = choose(isSubnormal, fraction, fraction | number(hidden));
  N shift = choose(isSubnormal, number(0), field - 1);
  ownWeight = wrap(
      b.builtin("floordiv", {shift.value, number(digitBits).value}).values[0]);
  N rest = shift - ownWeight * digitBits;
  // Zero has its digits where the sum has them.
  ownWeight = choose(magnitude == 0, lowest, ownWeight);
  int64_t mask = (int64_t(1) << digitBits) - 1;
  own[0] = (fraction << rest) & mask;
  own[1] = (fraction >> (number(digitBits) - rest)) & mask;
  own[2] = (fraction >> (number(2 * digitBits) - rest)) & mask;
  for (N &part : own)
    part = choose(isNegative, zero - part, part);
}

Number64 RoundingKernel::digit(Value weight) {
  N above = wrap(weight) - ownWeight;
  N old = zero;
  for (int i = 2; i >= 0; --i)
    old = choose(above == i, own[i], old);
  return word(weight) + old;
}

/// The remainder after the last digit.
Number64 RoundingKernel::carryOverAll() {
  auto loop = beginDigits({zero.value});
  N total = digit(loop[0]) + wrap(loop[1]);
  return wrap(b.endFor({(total >> digitBits).value})[0]);
}

/// Bits of the absolute value of the sum, which `sign` makes positive.
Number64 RoundingKernel::round(N sign) {
  // Carry; the two digits before this one, and whether any before those is not
  // zero; the highest digit so far with what was below it.
  Value none = zero.value;
  auto loop =
      beginDigits({none, none, none, none, none, none, none, none, none});
  N carry = wrap(loop[1]), before = wrap(loop[2]), second = wrap(loop[3]),
    below = wrap(loop[4]);
  N total = sign * digit(loop[0]) + carry;
  N current = total & ((int64_t(1) << digitBits) - 1);
  N isTop = current != 0;
  N weight = wrap(loop[0]);
  auto results = b.endFor({(total >> digitBits).value, current.value,
                           before.value, (below | second).value,
                           choose(isTop, weight, wrap(loop[5])).value,
                           choose(isTop, current, wrap(loop[6])).value,
                           choose(isTop, before, wrap(loop[7])).value,
                           choose(isTop, second, wrap(loop[8])).value,
                           choose(isTop, below, wrap(loop[9])).value});
  N window[3] = {wrap(results[5]), wrap(results[6]), wrap(results[7])};
  N rounded = compose(wrap(results[4]), window, wrap(results[8]));
  rounded = choose(window[0] == 0, zero, rounded);
  return choose(wrap(results[0]) != 0, number(infinity), rounded);
}

/// Rounds a fraction of three digits, the first of weight `top`.
Number64 RoundingKernel::compose(N top, const N (&window)[3], N lost) {
  Type f64 = Type::parse("f64");
  N exponent = wrap(b.bitcast(b.cast(window[0].value, f64), wide));
  N length = (exponent >> 52) - 1022 + 2 * digitBits;
  N drop = length - (mantissa + 1);
  N high = (window[0] << digitBits) | window[1], low = window[2];
  // Bits of `high` that are dropped; less than none if some of `low` stay.
  N fromHigh = drop - digitBits;
  N keepsLow = fromHigh < 0;
  N one = number(1);
  N kept = choose(keepsLow, (high << (zero - fromHigh)) | (low >> drop),
                  high >> fromHigh);
  N rest = choose(keepsLow, low & ((one << drop) - 1),
                  ((high & ((one << fromHigh) - 1)) << digitBits) | low);
  N half = one << (drop - 1);
  N odd = choose(lost != 0, one, kept & 1);
  N up = choose(half < rest, one, choose(rest == half, odd, zero));
  kept = kept + up;
  // The least bit that is kept, in units of the least subnormal number. Below
  // that there is nothing.
  N shift = drop + (top - 2) * digitBits;
  N isFine = shift < 0;
  kept = choose(isFine, kept >> (zero - shift), kept);
  shift = choose(isFine, zero, shift);
  N whole = (shift << mantissa) + kept;
  N fits = shift < (infinity >> mantissa) - 1;
  return choose(fits, choose(whole < infinity, whole, number(infinity)),
                number(infinity));
}

/// The rules of IEEE arithmetic for infinities and NaN.
Value RoundingKernel::exceptional(Value old, N flags) {
  Value sum = old;
  auto term = [&](int64_t flag, int64_t bits) {
    N chosen = choose((flags & flag) == 0, zero, number(bits));
    sum = b.builtin("add", {sum, realOf(chosen)}).values[0];
  };
  term(addedInfinity, infinity);
  term(addedMinusInfinity, infinity | int64_t(1) << (width - 1));
  term(addedNaN, infinity | int64_t(1) << (mantissa - 1));
  return sum;
}

Value RoundingKernel::roundOrNot(Value old) {
  N whole = bitsOf(old);
  N magnitude = whole & ((uint64_t(1) << (width - 1)) - 1);
  N isFinite = magnitude < infinity;
  b.beginIf(choose(isFinite, flags, number(1)).apply("ne", zero).value);
  Value special = exceptional(old, flags);
  b.beginElse();
  splitOld(magnitude, magnitude != whole);
  N isNegative = carryOverAll() < 0;
  N sign = choose(isNegative, number(-1), number(1));
  N rounded = round(sign);
  N signBit = choose(isNegative, number(int64_t(1) << (width - 1)), zero);
  Value sum = realOf(rounded | signBit);
  return b.endIf({special}, {sum})[0];
}

Kernel &warp::roundingKernel(int width) {
  static ForkMutex mutex;
  // Never destroyed: launches may end while the process does.
  static Kernel *kernels[2] = {};
  std::lock_guard lock(mutex);
  Kernel *&kernel = kernels[width == 64];
  if (!kernel)
    kernel = new Kernel(RoundingKernel(width).finish(), "round_sums");
  return *kernel;
}
