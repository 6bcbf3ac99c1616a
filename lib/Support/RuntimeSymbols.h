//===- RuntimeSymbols.h - Functions that code for CPUs may call -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The C library's mathematics, memory functions, the kernels' printf, and
// conversions of small floats that compilers otherwise take from their run-time
// library.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_SUPPORT_RUNTIMESYMBOLS_H
#define WARP_LIB_SUPPORT_RUNTIMESYMBOLS_H

#include <cstdint>
#include <vector>

namespace warp {

/// A function by the name that objects ask for it; the address is null where
/// the process has none.
struct RuntimeSymbol {
  const char *name;
  void *address;
};

std::vector<RuntimeSymbol> runtimeSymbols();

/// Bits of the nearest half or bfloat, ties to even; NaNs become quiet.
uint16_t halfBits(double value);
uint16_t bfloatBits(double value);
/// The value of a half.
float halfValue(uint16_t bits);

} // namespace warp

#endif // WARP_LIB_SUPPORT_RUNTIMESYMBOLS_H
