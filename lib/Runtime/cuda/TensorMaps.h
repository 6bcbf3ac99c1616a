//===- TensorMaps.h - Tensor maps of a launch -------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_CUDA_TENSORMAPS_H
#define WARP_LIB_RUNTIME_CUDA_TENSORMAPS_H

#include "warp/TensorMaps.h"

#include <vector>

namespace warp {

/// The parameters of a launch with its tensor maps.
class MappedParameters {
public:
  /// `size`: bytes of the parameters without maps.
  MappedParameters(const std::vector<TensorMap> &maps, const void *params,
                   size_t size);
  void *get() { return first; }

private:
  std::vector<char> block;
  char *first = nullptr;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_CUDA_TENSORMAPS_H
