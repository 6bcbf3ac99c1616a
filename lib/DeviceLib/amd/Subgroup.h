//===- Subgroup.h - Subgroup intrinsics of AMD's GPUs -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Included by gpu/Gpu.h, which says what each is for; those that functions of
// kernels use. Code does not depend on the lanes of a subgroup.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_DEVICELIB_AMD_SUBGROUP_H
#define WARP_DEVICELIB_AMD_SUBGROUP_H

namespace gpu {

inline float minimum(float a, float b) { return __builtin_fminf(a, b); }
inline float maximum(float a, float b) { return __builtin_fmaxf(a, b); }

/// Within 1 ulp, infinite for what is less than the least normal number.
inline float flushedReciprocal(float x) { return __builtin_amdgcn_rcpf(x); }

} // namespace gpu

#endif // WARP_DEVICELIB_AMD_SUBGROUP_H
