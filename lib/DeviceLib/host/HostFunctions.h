//===- HostFunctions.h - Library functions as machine code ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Functions for tiles are long, and compiling them took most of the time of a
// kernel that calls one. They are compiled with this library for two levels of
// x86-64, and kernels for the host call them. Kernels for other processors, and
// hosts below the lower level, get them from the library's bitcode.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_HOST_HOSTFUNCTIONS_H
#define WARP_DEVICELIB_HOST_HOSTFUNCTIONS_H

namespace warp {

struct HostFunction {
  const char *name;
  void (*address)();
};

} // namespace warp

#define WARP_HOST_FUNCTIONS(DO)                                                \
  DO(warp_tile_cholesky_f32)                                                   \
  DO(warp_tile_cholesky_f64)                                                   \
  DO(warp_tile_fft_f32)                                                        \
  DO(warp_tile_fft_f64)                                                        \
  DO(warp_tile_product_f32)                                                    \
  DO(warp_tile_product_f64)                                                    \
  DO(warp_tile_solve_f32)                                                      \
  DO(warp_tile_solve_f64)                                                      \
  DO(warp_tile_sort)

#define WARP_HOST_COUNT(name) +1
inline constexpr int warpHostFunctionCount =
    0 WARP_HOST_FUNCTIONS(WARP_HOST_COUNT);
#undef WARP_HOST_COUNT

/// For processors with AVX-512, and for those with AVX2 and FMA.
extern "C" const warp::HostFunction
    warp_host_functions_v4[warpHostFunctionCount],
    warp_host_functions_v3[warpHostFunctionCount];

#endif // WARP_DEVICELIB_HOST_HOSTFUNCTIONS_H
