//===- Noise.cpp - Lowerings of noise -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Gradient noise (Perlin, "Improving Noise", SIGGRAPH 2002) in any number of
// dimensions: each corner of the cell around a point has a random gradient,
// and the linear functions with these gradients, zero at their corners, are
// blended by a polynomial whose first two derivatives vanish at its ends. The
// gradients are those of the peer, so its images are reproduced.
//
//===----------------------------------------------------------------------===//

#include "LoweringFunctions.h"

using namespace mlir;

namespace warp::lowering {

namespace {
/// A value and its first and second derivatives along the axes.
struct Jet {
  Scalar value;
  Scalars gradient;
  /// By rows; empty if it is not asked for.
  Scalars hessian;
};

/// The cell of a lattice that a point is in.
struct Cell {
  /// Indices of the lower and the upper corner along each axis.
  Scalars lower, upper;
  /// Position between them, from 0 to 1.
  Scalars position;

  size_t getRank() const { return position.size(); }
};
} // namespace

/// Without `periods`, the lattice is not periodic.
static Cell getCell(ArrayRef<Scalar> point, ArrayRef<Parts> periods) {
  Cell cell;
  Type index = point[0].emitter->builder.getIntegerType(32, true);
  for (auto [axis, x] : llvm::enumerate(point)) {
    Scalar below = floor(x);
    Scalar lower = convert(below, index), upper = lower + 1.0;
    cell.position.push_back(x - below);
    if (!periods.empty()) {
      auto wrap = [period = periods[axis][0]](Scalar i) {
        return i - floorDivide(i, period) * period;
      };
      lower = wrap(lower);
      upper = wrap(upper);
    }
    cell.lower.push_back(lower);
    cell.upper.push_back(upper);
  }
  return cell;
}

/// The gradient of a corner: a random direction, or slope in one dimension.
static Scalars getCornerGradient(Scalar state, ArrayRef<Scalar> corner) {
  static constexpr uint64_t primes[] = {73856093, 19349663, 53471161, 10000019};
  size_t rank = corner.size();
  auto part = [&](size_t axis) {
    return convert(corner[axis], state.type) *
           state.emitter->integer(state.type, primes[axis]);
  };
  Scalar hash = part(rank - 1) + state;
  for (size_t axis = rank - 1; axis-- > 0;)
    hash = part(axis) ^ hash;
  Scalars point = pointInCube(hash, rank);
  point.pop_back();
  if (rank == 1)
    return {point[0] + point[0]};
  // Squares of multiples of 2^-24 can't vanish.
  Scalar squares = dot(point, point);
  Scalar inverse = 1.0 / sqrt(squares);
  return forEach(point, [&](Scalar x) {
    return select(squares == 0, x, x * inverse);
  });
}

static Jet getCornerJet(Scalar state, const Cell &cell, unsigned corner,
                        bool second) {
  Scalars indices, offset;
  for (size_t axis = 0; axis < cell.getRank(); ++axis) {
    bool isUpper = corner >> axis & 1;
    indices.push_back(isUpper ? cell.upper[axis] : cell.lower[axis]);
    offset.push_back(isUpper ? cell.position[axis] - 1.0
                             : cell.position[axis]);
  }
  Scalars gradient = getCornerGradient(state, indices), hessian;
  if (second)
    hessian.append(gradient.size() * gradient.size(), gradient[0].like(0));
  return {dot(offset, gradient), gradient, hessian};
}

static Scalars blend(ArrayRef<Scalar> a, ArrayRef<Scalar> b, Scalar weight) {
  return zipWith(a, b, [&](Scalar x, Scalar y) {
    return (y - x) * weight + x;
  });
}

/// From one jet to the other along an axis.
static Jet blend(const Jet &a, const Jet &b, Scalar t, size_t axis) {
  Scalar weight = t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
  Scalar slope = 30.0 * t * t * (t * (t - 2.0) + 1.0);
  Scalar bend = 60.0 * t * (t * (2.0 * t - 3.0) + 1.0);
  Scalar difference = b.value - a.value;
  Jet result = {difference * weight + a.value,
                blend(a.gradient, b.gradient, weight),
                blend(a.hessian, b.hessian, weight)};
  result.gradient[axis] = result.gradient[axis] + difference * slope;
  if (result.hessian.empty())
    return result;
  size_t rank = a.gradient.size();
  auto add = [&](size_t row, size_t col, Scalar x) {
    Scalar &entry = result.hessian[row * rank + col];
    entry = entry + x;
  };
  for (size_t other = 0; other < rank; ++other) {
    Scalar twist = (b.gradient[other] - a.gradient[other]) * slope;
    add(axis, other, twist);
    add(other, axis, twist);
  }
  add(axis, axis, difference * bend);
  return result;
}

static Jet getNoise(Operands args, bool second = false) {
  Cell cell = getCell(args[1].scalars, args.drop_front(2));
  SmallVector<Jet, 16> jets;
  for (unsigned corner = 0; corner < 1u << cell.getRank(); ++corner)
    jets.push_back(getCornerJet(args[0][0], cell, corner, second));
  for (size_t axis = 0; axis < cell.getRank(); ++axis) {
    for (size_t i = 0; i < jets.size() / 2; ++i)
      jets[i] =
          blend(jets[2 * i], jets[2 * i + 1], cell.position[axis], axis);
    jets.truncate(jets.size() / 2);
  }
  return jets[0];
}

Scalars lowerNoise(Emitter &, Operands args) { return {getNoise(args).value}; }

Scalars lowerNoiseGradient(Emitter &, Operands args) {
  return getNoise(args).gradient;
}

Scalars lowerNoiseHessian(Emitter &, Operands args) {
  return getNoise(args, true).hessian;
}

Scalars lowerPnoise(Emitter &, Operands args) {
  return {getNoise(args).value};
}

Scalars lowerPnoiseGradient(Emitter &, Operands args) {
  return getNoise(args).gradient;
}

Scalars lowerPnoiseHessian(Emitter &, Operands args) {
  return getNoise(args, true).hessian;
}

} // namespace warp::lowering
