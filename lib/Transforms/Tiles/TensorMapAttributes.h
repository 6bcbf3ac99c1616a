//===- TensorMapAttributes.h - Attributes of TMA loads ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H
#define WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H

#include "llvm/ADT/StringRef.h"

namespace warp {

namespace attr {
/// On kernels, and their entries: tensor maps (warp/TensorMaps.h), each as
/// descriptor, offset, rows, columns, bytes of an element and of the swizzle.
constexpr llvm::StringLiteral tensorMaps = "warp.tensor_maps";
} // namespace attr

} // namespace warp

#endif // WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H
