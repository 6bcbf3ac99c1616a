//===- TensorMapAttributes.h - Orders of the copy engine --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H
#define WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H

#include "llvm/ADT/StringRef.h"

namespace warp {

namespace attr {
/// On kernels, and their entries: maps of arrays (warp/TensorMaps.h), each as
/// descriptor, place, rows, columns, bytes of an element and of the swizzle.
constexpr llvm::StringLiteral tensorMaps = "warp.tensor_maps";
} // namespace attr

namespace tiles::attr {
/// On a load that the copy engine makes: where its map is among the parameters.
constexpr llvm::StringLiteral map = "map";
/// On one of the loads of such a loop: barriers lie behind its tiles.
constexpr llvm::StringLiteral ring = "ring";
} // namespace tiles::attr

} // namespace warp

#endif // WARP_TRANSFORMS_TILES_TENSORMAPATTRIBUTES_H
