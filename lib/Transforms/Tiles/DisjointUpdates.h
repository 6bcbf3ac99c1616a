//===- DisjointUpdates.h - Updates that no two blocks make ---- -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_DISJOINTUPDATES_H
#define WARP_TRANSFORMS_TILES_DISJOINTUPDATES_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {
/// On a `tile_atomic`: no other block, nor another update, touches its
/// elements.
constexpr llvm::StringLiteral disjoint = "warp.disjoint";
} // namespace warp::attr

#endif // WARP_TRANSFORMS_TILES_DISJOINTUPDATES_H
