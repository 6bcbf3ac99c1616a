//===- CopyKernel.h - Strided copies by kernels -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_COPYKERNEL_H
#define WARP_LIB_RUNTIME_CUDA_COPYKERNEL_H

#include "Runtime/CopyNest.h"

namespace warp {

class Stream;

/// Copies within a CUDA device by a kernel. False, with nothing done, if the
/// copy is too small to be worth one or does not fit its arrays.
bool copyByKernel(const CopyNest &nest, int device, const Stream *stream);

/// The same for a source packed along another dimension than the destination.
/// `dims` are in the order of the destination's strides, of words that all
/// addresses allow. False where tiles of words do not fit.
bool copyTransposed(const CopyNest::Dimension *dims, int rank, int64_t word,
                    char *dst, const char *src, int device,
                    const Stream *stream);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_COPYKERNEL_H
