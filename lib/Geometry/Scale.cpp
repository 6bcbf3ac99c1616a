//===- Scale.cpp - Power-of-two scale of BVH coordinates ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Hierarchy.h"

#include <cmath>

float warp::geometry::chooseScale(const Bounds &bounds) {
  double size = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double low = bounds.low[axis], high = bounds.high[axis];
    if (!(low <= high))
      return 1;
    double far = std::max(std::abs(low), std::abs(high));
    size = std::max({size, high - low, std::ldexp(far, -20)});
  }
  if (size == 0)
    return 1;
  int exponent = std::ilogb(size);
  return std::ldexp(1.0f, -std::clamp(exponent, -126, 126));
}
