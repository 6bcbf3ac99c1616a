//===- LibmNames.h - C library functions of native code ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Kernels have functions of their own, the same on every device; one that
// asks for the C library's is a mistake that loading it shall show. So native
// code of users, which does, asks for them by names with a prefix.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_LIBMNAMES_H
#define WARP_LIB_COMPILER_LIBMNAMES_H

namespace warp {

inline constexpr char libmPrefix[] = "warp_libm_";

// clang-format off
/// For float with an f at the end, and for double.
#define WARP_LIBM_UNARY(X)                                                     \
  X(sin) X(cos) X(tan) X(asin) X(acos) X(atan)                                 \
  X(sinh) X(cosh) X(tanh) X(asinh) X(acosh) X(atanh)                           \
  X(exp) X(exp2) X(expm1) X(log) X(log2) X(log10) X(log1p) X(logb)             \
  X(cbrt) X(erf) X(erfc) X(tgamma) X(lgamma)
// clang-format on
#define WARP_LIBM_BINARY(X)                                                    \
  X(pow) X(atan2) X(hypot) X(nextafter) X(remainder) X(fdim)
#define WARP_LIBC_MEMORY(X) X(calloc) X(free)

} // namespace warp

#endif // WARP_LIB_COMPILER_LIBMNAMES_H
