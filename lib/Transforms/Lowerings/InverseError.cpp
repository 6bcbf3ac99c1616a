//===- InverseError.cpp - Lowerings of erfinv and erfcinv -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// With w = -log((1 - x) (1 + x)), erfinv(x) / x is smooth in w, and in the tail
// erfinv(x) / sqrt(w) is smooth in 1 / sqrt(w); the variables are those of
// M. Giles, "Approximating the erfinv function", GPU Computing Gems, 2011. The
// polynomials are printed by scripts/fit_erfinv.py. The complement works on y
// = 1 - x without forming x where that would lose it, down to the smallest y.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

namespace {
/// On [0, 5.5]; relative error 2.2e-8.
constexpr double singleCentral[] = {
    -7.2760946613119725e-9, 7.5109309290044474e-9, 4.7561662951632486e-7,
    -2.6623315439614029e-6, -9.465523824953614e-6, 0.00020930638095993993,
    -0.0010386016136157948, -0.0050361975091063226, 0.24433026200226167,
    1.5627896446253179,
};
constexpr double singleCentralMiddle = 2.75;

/// On [0.097, 0.4265]; relative error 1.2e-8.
constexpr double singleTail[] = {
    113.36374418354797, 0.076277640284322478, -1.572725498108813,
    -3.3188843502325594, 0.62869901158160067, -0.8318808038379748,
    0.51373755495961497, 0.099045574770769968, -0.19608704532758051,
    0.95762904342406525,
};
constexpr double singleTailMiddle = 0.26175;

/// On [0, 6.5]; relative error 7.7e-17.
constexpr double doubleCentral[] = {
    2.1675359501573771e-21, 4.9423021146376705e-21, -2.8395053591897005e-19,
    4.0501902442045664e-19, 1.6021944710409509e-17, -9.4342801486237332e-17,
    -2.728251965223157e-16, 6.2759354446699987e-15, -2.7233546237040122e-14,
    -1.4433724995322345e-13, 2.4306498864020346e-12, -8.8486736338430223e-12,
    -7.0475002617174673e-11, 9.6482977580299676e-10, -2.8502840073111981e-9,
    -3.297689122881984e-8, 3.9233677622878574e-7, -1.0082651697867555e-6,
    -1.4770969391730154e-5, 0.00017776603602858928, -0.00064955434541029773,
    -0.0062942038650460971, 0.23861648595217379, 1.6835786578550349,
};
constexpr double doubleCentralMiddle = 3.25;

/// On [0.2, 0.3925]; relative error 1.4e-17.
constexpr double doubleTail[] = {
    -6046614830.0956872, 1417366256.3438831, 302141802.32050894,
    -125103746.87335284, 665226.98200780382, 5488365.1327846578,
    -677450.83375668414, -155606.73954756635, 42835.621495711544,
    3283.9797236359979, -1975.4966636565618, -72.301543993313224,
    76.133630738546581, 9.0060848669292438, -3.6090121662499055,
    -0.14732486258369899, -0.78416635846402837, 0.40396903066959043,
    0.14646746004732551, -0.18755209781612374, 0.95100186775481294,
};
constexpr double doubleTailMiddle = 0.29625;

/// On [0.09, 0.2]; relative error 1.3e-17.
constexpr double doubleFarTail[] = {
    -256592704.37946603, 44780770.799714314, -4796719.3687397365,
    889793.73560712603, -186335.78246553082, 36003.988462888547,
    -7125.0744017029898, 1476.8252031903856, -321.81014104798094,
    74.562160959601087, -18.470792764155917, 5.1740311195337517,
    -2.0943947542372675, 1.1070674254311803, -0.16866545907562685,
    -0.19188788205696139, 0.98087811879896747,
};
constexpr double doubleFarTailMiddle = 0.145;

/// On [0.036, 0.09]; relative error 2.3e-17.
constexpr double doubleFarthestTail[] = {
    -33987788647648.101, 2598467949758.8249, -96145011970.086879,
    7821185786.1152197, -784728984.45359124, 65788604.370599383,
    -5596704.9433598546, 503921.24246589365, -47680.656099681437,
    4808.5628852288746, -530.0158325318742, 66.341847232077179,
    -10.467666603770046, 2.617196596676396, -0.57775784854243117,
    -0.13542317874441904, 0.99474599444603001,
};
constexpr double doubleFarthestTailMiddle = 0.063;

/// A polynomial in the distance from the middle of its interval.
struct Polynomial {
  ArrayRef<double> coefficients;
  double middle;

  Scalar operator()(Scalar x) const {
    Scalar t = x - middle, value = x.like(coefficients.front());
    for (double c : coefficients.drop_front())
      value = fma(value, t, x.like(c));
    return value;
  }

  /// The polynomial times a factor. The last sum, which cancels, keeps what its
  /// rounding lost, as does the last coefficient.
  Scalar times(Scalar factor, Scalar x) const {
    Scalar t = x - middle, value = x.like(coefficients.front());
    for (double c : coefficients.drop_front().drop_back())
      value = fma(value, t, x.like(c));
    double last = coefficients.back();
    double rounded = x.getWidth() == 32 ? double(float(last)) : last;
    Scalar sum = fma(value, t, x.like(rounded));
    Scalar lost = fma(value, t, x.like(rounded) - sum) + (last - rounded);
    return fma(factor, sum, factor * lost);
  }
};
} // namespace

/// |erfinv| in the tail, where `root` is sqrt(w).
static Scalar evaluateTail(Scalar root) {
  Scalar inverseRoot = 1.0 / root;
  if (root.getWidth() == 32)
    return Polynomial{singleTail, singleTailMiddle}.times(root, inverseRoot);
  Scalar near = Polynomial{doubleTail, doubleTailMiddle}(inverseRoot);
  Scalar isFar = inverseRoot < 0.2;
  return root * branch(isFar, near, [&]() -> Scalars {
    Scalar far = Polynomial{doubleFarTail, doubleFarTailMiddle}(inverseRoot);
    Scalar farthest = Polynomial{doubleFarthestTail, doubleFarthestTailMiddle}(
        inverseRoot);
    return {select(inverseRoot < 0.09, farthest, far)};
  })[0];
}

/// The inverse at x, given (1 - x) (1 + x).
static Scalar invert(Scalar x, Scalar product) {
  Scalar w = -log(product);
  bool isSingle = x.getWidth() == 32;
  Polynomial central =
      isSingle ? Polynomial{singleCentral, singleCentralMiddle}
               : Polynomial{doubleCentral, doubleCentralMiddle};
  Scalar near = central.times(x, w);
  return branch(w > (isSingle ? 5.5 : 6.5), near, [&]() -> Scalars {
    Scalar root = sqrt(w);
    return {copysign(evaluateTail(root), x)};
  })[0];
}

Scalars lowerErfInv(Emitter &, Operands args) {
  Scalar x = args[0][0];
  return {invert(x, (1.0 - x) * (1.0 + x))};
}

Scalars lowerErfcInv(Emitter &, Operands args) {
  Scalar y = args[0][0];
  return {invert(1.0 - y, y * (2.0 - y))};
}

} // namespace warp::lowering
