//===- FloatMath.cpp - Elementary functions of 32-bit floats --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elementary functions that a CPU kernel calls per thread. They are linked
// into the kernel as bitcode and inlined, so they are written for the loop
// vectoriser: no branch, no call, no table but one, and special cases decided
// by selects at the end.
//
// A float function is evaluated in double. That leaves 29 bits to spare, so a
// plain polynomial of relative error 2^-40 rounds to the nearest float in all
// but about one case in a thousand, over- and underflow happen only in the
// final conversion, and subnormal operands need no case of their own.
//
// Polynomials interpolate at Chebyshev nodes (relative error in brackets):
// sin, cos on [-pi/4, pi/4], 2^x on [-1/2, 1/2], log2((1+s)/(1-s)) on
// [1/sqrt(2), sqrt(2)], atan on [0, tan(pi/8)], sinh on [-1, 1].
//
//===----------------------------------------------------------------------===//

using f32 = float;
using f64 = double;
using i64 = long long;
using u32 = unsigned int;

#define WARP_MATH extern "C" __attribute__((always_inline, used))

namespace {

constexpr f64 halfPi = 0x1.921fb54442d18p+0;
constexpr f64 halfPiLow = 0x1.1a62633145c07p-54;
constexpr f64 twoOverPi = 0x1.45f306dc9c883p-1;
constexpr f64 ln2 = 0x1.62e42fefa39efp-1;
constexpr f64 log2OfE = 0x1.71547652b82fep+0;
constexpr f64 log10Of2 = 0x1.34413509f79ffp-2;
constexpr f64 infinity = __builtin_inf();
constexpr f64 notANumber = __builtin_nan("");

/// Adding this to |x| < 2^51 leaves the nearest integer in the low bits.
constexpr f64 roundToInteger = 0x1.8p+52;

inline f64 fromBits(i64 bits) { return __builtin_bit_cast(f64, bits); }
inline i64 toBits(f64 x) { return __builtin_bit_cast(i64, x); }
inline f64 fma(f64 a, f64 b, f64 c) { return __builtin_fma(a, b, c); }
inline f64 abs(f64 x) { return __builtin_fabs(x); }
inline f64 sqrt(f64 x) { return __builtin_sqrt(x); }
inline f64 copysign(f64 x, f64 y) { return __builtin_copysign(x, y); }

/// Horner's rule, from the constant term.
template <int n> inline f64 polynomial(f64 x, const f64 (&c)[n]) {
  f64 sum = c[n - 1];
#pragma clang loop unroll(full)
  for (int i = n - 2; i >= 0; --i)
    sum = fma(sum, x, c[i]);
  return sum;
}

/// 2^k modulo 2 pi in [-pi, pi] (and 2^k itself below 2 pi) to 106 bits.
constexpr f64 powerModTwoPi[105][2] = {
    {0x1.0000000000000p+0, 0x0.0p+0},
    {0x1.0000000000000p+1, 0x0.0p+0},
    {-0x1.243f6a8885a31p+1, 0x1.cb3b399d747f2p-53},
    {0x1.b7812aeef4b9fp+0, -0x1.a62633145c06ep-56},
    {-0x1.6cbe3f9990e92p+1, 0x1.61b1acd85d7d7p-53},
    {0x1.2b0bad558f435p-1, -0x1.f5f7fb2e61132p-59},
    {0x1.2b0bad558f435p+0, -0x1.f5f7fb2e61132p-58},
    {0x1.2b0bad558f435p+1, -0x1.f5f7fb2e61132p-57},
    {-0x1.9c501fbace38dp+0, -0x1.ce0f17215e8d0p-55},
    {0x1.87ef4acdb76a3p+1, 0x1.4dbd3ad1dc3a6p-53},
    {-0x1.460d4ed16ce9ep-3, -0x1.94a50bed30c26p-57},
    {-0x1.460d4ed16ce9ep-2, -0x1.94a50bed30c26p-56},
    {-0x1.460d4ed16ce9ep-1, -0x1.94a50bed30c26p-55},
    {-0x1.460d4ed16ce9ep+0, -0x1.94a50bed30c26p-54},
    {-0x1.460d4ed16ce9ep+1, -0x1.94a50bed30c26p-53},
    {0x1.304999cb579e8p+0, -0x1.e90aa2efac07ep-54},
    {0x1.304999cb579e8p+1, -0x1.e90aa2efac07ep-53},
    {-0x1.87586de3accc3p+0, -0x1.b6831078e4261p-59},
    {-0x1.87586de3accc3p+1, -0x1.b6831078e4261p-58},
    {0x1.58e8ec12c0aa8p-3, 0x1.95c955afd3e7bp-57},
    {0x1.58e8ec12c0aa8p-2, 0x1.95c955afd3e7bp-56},
    {0x1.58e8ec12c0aa8p-1, 0x1.95c955afd3e7bp-55},
    {0x1.58e8ec12c0aa8p+0, 0x1.95c955afd3e7bp-54},
    {0x1.58e8ec12c0aa8p+1, 0x1.95c955afd3e7bp-53},
    {-0x1.c9b6498c1137fp-1, -0x1.2643605c762f1p-58},
    {-0x1.c9b6498c1137fp+0, -0x1.2643605c762f1p-57},
    {0x1.5a8920fc746b2p+1, -0x1.f003a5a903450p-53},
    {-0x1.bcb4a23e73336p-1, -0x1.4cc11b4920ae8p-57},
    {-0x1.bcb4a23e73336p+0, -0x1.4cc11b4920ae8p-56},
    {0x1.678ac84a126fap+1, 0x1.e1947f9043554p-53},
    {-0x1.54a767d1830eep-1, -0x1.c66f1d081359ap-55},
    {-0x1.54a767d1830eep+0, -0x1.c66f1d081359ap-54},
    {-0x1.54a767d1830eep+1, -0x1.c66f1d081359ap-53},
    {0x1.ebc26b95fe14fp-1, -0x1.6065ceb66cc97p-55},
    {0x1.ebc26b95fe14fp+0, -0x1.6065ceb66cc97p-54},
    {-0x1.387cfef2878e2p+1, 0x1.ab55ab9c1ed6dp-55},
    {0x1.668ad946ed0dap+0, -0x1.eb20c79eca277p-54},
    {0x1.668ad946ed0dap+1, -0x1.eb20c79eca277p-53},
    {-0x1.5ca6dfeaae1f6p-1, -0x1.60cab403f9f91p-58},
    {-0x1.5ca6dfeaae1f6p+0, -0x1.60cab403f9f91p-57},
    {-0x1.5ca6dfeaae1f6p+1, -0x1.60cab403f9f91p-56},
    {0x1.abc6aacca5912p-1, -0x1.1b6f34f397eb5p-56},
    {0x1.abc6aacca5912p+0, -0x1.1b6f34f397eb5p-55},
    {-0x1.7878bfbbe011fp+1, 0x1.3d839f23a8898p-53},
    {0x1.9a6f58862bf99p-2, 0x1.7e60254ee49ebp-56},
    {0x1.9a6f58862bf99p-1, 0x1.7e60254ee49ebp-55},
    {0x1.9a6f58862bf99p+0, 0x1.7e60254ee49ebp-54},
    {-0x1.89d0120259a97p+1, -0x1.6cc942274dc45p-54},
    {0x1.09f4683d25023p-3, 0x1.fee10ecf6f246p-59},
    {0x1.09f4683d25023p-2, 0x1.fee10ecf6f246p-58},
    {0x1.09f4683d25023p-1, 0x1.fee10ecf6f246p-57},
    {0x1.09f4683d25023p+0, 0x1.fee10ecf6f246p-56},
    {0x1.09f4683d25023p+1, 0x1.fee10ecf6f246p-55},
    {-0x1.10569a0e3b9eap+1, -0x1.35543efad3eebp-53},
    {0x1.0392366c0e65cp+1, -0x1.af1dbc98e2e42p-56},
    {-0x1.1d1afdb068d79p+1, 0x1.5f73ca773bc62p-53},
    {0x1.d412de4f67e7ep+0, 0x1.e758b6a2061a3p-54},
    {-0x1.502c8c391dbb2p+1, -0x1.35b03f02159adp-55},
    {0x1.07cca42c94599p+0, -0x1.984d6479fd323p-55},
    {0x1.07cca42c94599p+1, -0x1.984d6479fd323p-54},
    {-0x1.14a6222f5ceffp+1, 0x1.976ea91bba67bp-56},
    {0x1.f5e64c5397865p+0, 0x1.3540e152f4359p-54},
    {-0x1.2e591e34ee1cbp+1, -0x1.ff07ca1f2e969p-54},
    {0x1.8f1a5c3d52d34p+0, 0x1.ade7e21ae7526p-56},
    {0x1.8f1a5c3d52d34p+1, 0x1.ade7e21ae7526p-55},
    {-0x1.82ac8377ff216p-5, 0x1.17955574142a1p-60},
    {-0x1.82ac8377ff216p-4, 0x1.17955574142a1p-59},
    {-0x1.82ac8377ff216p-3, 0x1.17955574142a1p-58},
    {-0x1.82ac8377ff216p-2, 0x1.17955574142a1p-57},
    {-0x1.82ac8377ff216p-1, 0x1.17955574142a1p-56},
    {-0x1.82ac8377ff216p+0, 0x1.17955574142a1p-55},
    {-0x1.82ac8377ff216p+1, 0x1.17955574142a1p-54},
    {0x1.ee6639887604dp-3, 0x1.8b437ad3f55e0p-58},
    {0x1.ee6639887604dp-2, 0x1.8b437ad3f55e0p-57},
    {0x1.ee6639887604dp-1, 0x1.8b437ad3f55e0p-56},
    {0x1.ee6639887604dp+0, 0x1.8b437ad3f55e0p-55},
    {-0x1.35d931000f9e3p+1, -0x1.6f2308f890d1ep-53},
    {0x1.711a1110cccd4p+0, -0x1.5302971d2c45bp-54},
    {0x1.711a1110cccd4p+1, -0x1.5302971d2c45bp-53},
    {-0x1.082d219bb0225p-1, 0x1.29b05b18df9e2p-56},
    {-0x1.082d219bb0225p+0, 0x1.29b05b18df9e2p-55},
    {-0x1.082d219bb0225p+1, 0x1.29b05b18df9e2p-54},
    {0x1.13e52751255e7p+1, -0x1.4315bd0929c20p-54},
    {-0x1.f8ea37cc75cc6p+0, 0x1.104af928957a5p-54},
    {0x1.2b5532bc0fd6bp+1, -0x1.75e080e9be09ap-54},
    {-0x1.9b2a0a20cbeb6p+0, 0x1.556ae2ced9d62p-55},
    {0x1.89156067b9b7bp+1, -0x1.2085c83607941p-53},
    {-0x1.214a9b91233b2p-3, 0x1.45f5262caae07p-58},
    {-0x1.214a9b91233b2p-2, 0x1.45f5262caae07p-57},
    {-0x1.214a9b91233b2p-1, 0x1.45f5262caae07p-56},
    {-0x1.214a9b91233b2p+0, 0x1.45f5262caae07p-55},
    {-0x1.214a9b91233b2p+1, 0x1.45f5262caae07p-54},
    {0x1.c35466cc7e59ap+0, -0x1.0a8c26e1933d7p-54},
    {-0x1.60eb03bc07497p+1, 0x1.815e2577c2837p-54},
    {0x1.89a58c41dc40cp-1, -0x1.27745096c7eeep-55},
    {0x1.89a58c41dc40cp+0, -0x1.27745096c7eeep-54},
    {0x1.89a58c41dc40cp+1, -0x1.27745096c7eeep-53},
    {-0x1.0f45204cd2192p-3, -0x1.d6b3c80daf49ap-60},
    {-0x1.0f45204cd2192p-2, -0x1.d6b3c80daf49ap-59},
    {-0x1.0f45204cd2192p-1, -0x1.d6b3c80daf49ap-58},
    {-0x1.0f45204cd2192p+0, -0x1.d6b3c80daf49ap-57},
    {-0x1.0f45204cd2192p+1, -0x1.d6b3c80daf49ap-56},
    {0x1.05b529eee170cp+1, 0x1.bf17d45f1fae7p-53},
    {-0x1.18d516aac2c18p+1, 0x1.496ae25bb3dc1p-53},
    {0x1.e52a7a6600402p+0, 0x1.8f351633e671fp-54},
};

struct Angle {
  f64 remainder; // in [-pi/4, pi/4]
  i64 quadrant;
};

/// Splits an angle into a quadrant and a remainder, exactly enough for every
/// finite float. A large angle m 2^k, with m of 24 bits, is first replaced by
/// m (2^k modulo 2 pi), to 106 bits (cf. Payne and Hanek, "Radian reduction
/// for trigonometric functions", SIGNUM 18, 1983, for the need).
inline Angle reduceAngle(f32 x) {
  u32 bits = __builtin_bit_cast(u32, x);
  int exponent = int((bits >> 23) & 0xff) - 150;
  int k = exponent < 0 ? 0 : (exponent > 104 ? 104 : exponent);
  f64 mantissa = f64(int((bits & 0x7fffff) | 0x800000));
  mantissa = copysign(mantissa, f64(x));
  bool large = exponent > 0;
  f64 high = large ? mantissa * powerModTwoPi[k][0] : f64(x);
  f64 low = large ? fma(mantissa, powerModTwoPi[k][0], -high) +
                        mantissa * powerModTwoPi[k][1]
                  : -0.0; // keeps the sign of a zero angle
  f64 shifted = fma(high, twoOverPi, roundToInteger);
  f64 turns = shifted - roundToInteger;
  f64 remainder = fma(-turns, halfPi, high);
  remainder = fma(-turns, halfPiLow, remainder) + low;
  return {remainder, toBits(shifted)};
}

inline f64 sinNearZero(f64 r) { // [2^-47]
  constexpr f64 c[] = {0x1.fffffffffffd9p-1,  -0x1.5555555550e49p-3,
                       0x1.1111110bd3b54p-7,  -0x1.a019f89438a1fp-13,
                       0x1.71d72a4b779d6p-19, -0x1.a94de9088c46dp-26};
  return r * polynomial(r * r, c);
}

inline f64 cosNearZero(f64 r) { // [2^-53]
  constexpr f64 c[] = {0x1.0000000000000p+0,  -0x1.fffffffffff77p-2,
                       0x1.555555554e6d2p-5,  -0x1.6c16c163b498ep-10,
                       0x1.a019f7eebbb5ep-16, -0x1.27df3a2ecce24p-22,
                       0x1.1b893bd61e9c0p-29};
  return polynomial(r * r, c);
}

inline f64 negateIf(f64 x, bool condition) { return condition ? -x : x; }

/// 2^x; |x| may be as large as 2^10 without over- or underflow.
inline f64 exp2Double(f64 x) { // [2^-40]
  constexpr f64 c[] = {0x1.0000000000000p+0,  0x1.62e42fef84cdbp-1,
                       0x1.ebfbdff823ce7p-3,  0x1.c6b08dd7004bap-5,
                       0x1.3b2ab7181c555p-7,  0x1.5d8745a35e369p-10,
                       0x1.4308ac8390f53p-13, 0x1.00dc4cd9e7a19p-16,
                       0x1.63d1390345570p-20};
  f64 shifted = x + roundToInteger;
  f64 fraction = x - (shifted - roundToInteger);
  f64 scale = fromBits((toBits(shifted) + 1023) << 52);
  return polynomial(fraction, c) * scale;
}

/// Keeps NaN, so that it comes through exp2Double.
inline f64 limit(f64 x, f64 low, f64 high) {
  x = x < low ? low : x;
  return x > high ? high : x;
}

inline f64 expDouble(f64 x) {
  return exp2Double(limit(x * log2OfE, -1000.0, 1000.0));
}

struct Logarithm {
  f64 exponent, fraction; // log2 of a positive normal number is their sum
};

inline Logarithm splitLog2(f64 x) { // [2^-45]
  constexpr f64 c[] = {0x1.71547652b8251p+1, 0x1.ec709dc53bfcfp-1,
                       0x1.2776c2935a8c1p-1, 0x1.a61a2ef4051f3p-2,
                       0x1.4795463b406c3p-2, 0x1.21b245a850e1dp-2};
  constexpr i64 sqrtHalf = 0x3fe6a09e667f3bcdLL;
  i64 bits = toBits(x);
  // Arithmetic shifts of 64 bits are dear before AVX-512; the sum is positive.
  i64 positive = bits - sqrtHalf + (1024LL << 52);
  i64 biased = i64((unsigned long long)positive >> 52);
  f64 exponent = fromBits(biased | 0x4330000000000000LL) -
                 (0x1.0p+52 + 1024.0);
  f64 m = fromBits(bits - ((biased - 1024) << 52));
  f64 s = (m - 1.0) / (m + 1.0);
  return {exponent, s * polynomial(s * s, c)};
}

/// Results of a logarithm outside (0, inf).
inline f32 finishLog(f64 x, f64 result) {
  result = x == 0.0 ? -infinity : result;
  result = x == infinity ? infinity : result;
  return f32(x >= 0.0 ? result : notANumber);
}

inline f64 atanPositive(f64 x) { // [2^-45]; x may be infinite
  constexpr f64 c[] = {0x1.fffffffffff0dp-1,  -0x1.55555554e53e8p-2,
                       0x1.99999910f9196p-3,  -0x1.249228f16315fp-3,
                       0x1.c714cc286b268p-4,  -0x1.73d963bf0c396p-4,
                       0x1.35cbd91f7449ap-4,  -0x1.e123c910996e0p-5,
                       0x1.f61079a67a655p-6};
  constexpr f64 tanPiOver8 = 0x1.a827999fcef32p-2;
  bool above = x > 1.0;
  f64 t = above ? 1.0 / x : x;
  bool middle = t > tanPiOver8;
  f64 u = middle ? (t - 1.0) / (t + 1.0) : t;
  f64 angle = u * polynomial(u * u, c) + (middle ? halfPi / 2 : 0.0);
  return above ? halfPi - angle : angle;
}

/// Angle of a point in [0, pi], from |y| and x; not both zero or infinite.
inline f64 angleOf(f64 y, f64 x) {
  f64 angle = atanPositive(y / abs(x));
  return x < 0.0 ? 2 * halfPi - angle : angle;
}

inline f64 sinhSmall(f64 x) { // [2^-43]
  constexpr f64 c[] = {0x1.ffffffffffd34p-1, 0x1.5555555587b48p-3,
                       0x1.111110ec59911p-7, 0x1.a01a28c329346p-13,
                       0x1.71cb623ab9f8ap-19, 0x1.b6be36e12230dp-26};
  return x * polynomial(x * x, c);
}

inline f64 sinhDouble(f64 x) {
  f64 e = expDouble(abs(x));
  f64 large = copysign(0.5 * (e - 1.0 / e), x);
  return abs(x) < 1.0 ? sinhSmall(x) : large;
}

inline f64 coshDouble(f64 x) {
  f64 e = expDouble(abs(x));
  return 0.5 * (e + 1.0 / e);
}

/// 1 for an odd integer, 0 for an even one, -1 for anything else.
inline int parity(f64 y) {
  f64 half = y * 0.5;
  bool integer = __builtin_trunc(y) == y;
  bool even = __builtin_trunc(half) == half;
  return integer ? (even ? 0 : 1) : -1;
}

} // namespace

WARP_MATH f32 warp_sinf(f32 x) {
  Angle a = reduceAngle(x);
  f64 value = a.quadrant & 1 ? cosNearZero(a.remainder)
                             : sinNearZero(a.remainder);
  return f32(x - x == 0.0f ? negateIf(value, a.quadrant & 2) : notANumber);
}

WARP_MATH f32 warp_cosf(f32 x) {
  Angle a = reduceAngle(x);
  f64 value = a.quadrant & 1 ? sinNearZero(a.remainder)
                             : cosNearZero(a.remainder);
  return f32(x - x == 0.0f ? negateIf(value, (a.quadrant + 1) & 2)
                           : notANumber);
}

WARP_MATH f32 warp_tanf(f32 x) {
  Angle a = reduceAngle(x);
  f64 s = sinNearZero(a.remainder), c = cosNearZero(a.remainder);
  bool odd = a.quadrant & 1;
  f64 value = (odd ? -c : s) / (odd ? s : c);
  return f32(x - x == 0.0f ? value : notANumber);
}

WARP_MATH f32 warp_asinf(f32 x) {
  f64 y = abs(f64(x));
  return f32(copysign(atanPositive(y / sqrt((1.0 - y) * (1.0 + y))), x));
}

WARP_MATH f32 warp_acosf(f32 x) {
  f64 y = x;
  return f32(angleOf(sqrt((1.0 - y) * (1.0 + y)), y));
}

WARP_MATH f32 warp_atanf(f32 x) {
  return f32(copysign(atanPositive(abs(f64(x))), x));
}

WARP_MATH f32 warp_atan2f(f32 y, f32 x) {
  f64 b = abs(f64(y)), a = x;
  // Both infinite stand for a diagonal; both zero for the axis x points along.
  bool diagonal = b == infinity && abs(a) == infinity;
  b = diagonal ? 1.0 : b;
  a = diagonal ? copysign(1.0, a) : a;
  bool origin = b == 0.0 && a == 0.0;
  a = origin ? copysign(1.0, a) : a;
  return f32(copysign(angleOf(b, a), y));
}

WARP_MATH f32 warp_expf(f32 x) { return f32(expDouble(x)); }
WARP_MATH f32 warp_exp2f(f32 x) {
  return f32(exp2Double(limit(x, -1000.0, 1000.0)));
}

WARP_MATH f32 warp_logf(f32 x) {
  Logarithm l = splitLog2(x);
  return finishLog(x, fma(l.exponent, ln2, l.fraction * ln2));
}

WARP_MATH f32 warp_log2f(f32 x) {
  Logarithm l = splitLog2(x);
  return finishLog(x, l.exponent + l.fraction);
}

WARP_MATH f32 warp_log10f(f32 x) {
  Logarithm l = splitLog2(x);
  return finishLog(x, fma(l.exponent, log10Of2, l.fraction * log10Of2));
}

WARP_MATH f32 warp_sinhf(f32 x) { return f32(sinhDouble(x)); }
WARP_MATH f32 warp_coshf(f32 x) { return f32(coshDouble(x)); }
WARP_MATH f32 warp_tanhf(f32 x) {
  f64 y = limit(x, -20.0, 20.0);
  return f32(sinhDouble(y) / coshDouble(y));
}

/// Special cases as IEEE 754-2019, section 9.2.1, has them for pow.
WARP_MATH f32 warp_powf(f32 x, f32 y) {
  f64 base = abs(f64(x)), exponent = y;
  Logarithm l = splitLog2(base);
  f64 logarithm = l.exponent + l.fraction;
  logarithm = base == 0.0 ? -infinity : logarithm;
  logarithm = base == infinity ? infinity : logarithm;
  logarithm = base != base ? notANumber : logarithm;
  f64 value = exp2Double(limit(exponent * logarithm, -1000.0, 1000.0));
  int p = parity(exponent);
  bool negative = __builtin_signbit(x);
  value = negateIf(value, negative && p == 1);
  bool invalid = x < 0.0f && p < 0 && base != infinity && base != 0.0;
  value = invalid && abs(exponent) != infinity ? notANumber : value;
  bool one = x == 1.0f || y == 0.0f;
  one |= x == -1.0f && abs(exponent) == infinity;
  return f32(one ? 1.0 : value);
}
