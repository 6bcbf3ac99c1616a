//===- FillKernel.h - Fills of several regions by a kernel ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_FILLKERNEL_H
#define WARP_LIB_RUNTIME_CUDA_FILLKERNEL_H

#include "Runtime/GraphFills.h"

#include <vector>

namespace warp {

class Stream;

/// Fills regions of a CUDA device, none of which overlap, by one launch.
void fillByKernel(int device, const std::vector<FillRegion> &regions,
                  const Stream &stream);

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_FILLKERNEL_H
