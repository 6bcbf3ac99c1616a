//===- ApartUpdates.h - Updates that no two blocks make -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_APARTUPDATES_H
#define WARP_TRANSFORMS_TILES_APARTUPDATES_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {
/// On a `tile_atomic`: no other block, nor another update, touches its
/// elements.
constexpr llvm::StringLiteral apart = "warp.apart";
} // namespace warp::attr

#endif // WARP_TRANSFORMS_TILES_APARTUPDATES_H
