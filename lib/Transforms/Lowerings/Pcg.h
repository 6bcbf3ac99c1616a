//===- Pcg.h - Constants of the random numbers ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// PCG-RXS-M-XS on 32 bits. A step is
//
//   n = state * multiplier + increment
//   w = (n >> ((n >> topShift) + leastShift) ^ n) * mixer
//   w >> lastShift ^ w
//
// and each line of it is a bijection of 32-bit words.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LOWERINGS_PCG_H
#define WARP_TRANSFORMS_LOWERINGS_PCG_H

#include <cstdint>

namespace warp::pcg {

constexpr uint32_t multiplier = 747796405u, increment = 2891336453u,
                   mixer = 277803737u;
constexpr unsigned topShift = 28, leastShift = 4, lastShift = 22;

} // namespace warp::pcg

#endif // WARP_TRANSFORMS_LOWERINGS_PCG_H
