//===- RareBranch.h - Branch weights of rare branches -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_RAREBRANCH_H
#define WARP_LIB_TRANSFORMS_RAREBRANCH_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {

/// On an scf.if: hardly any thread takes the first side, so lanes ask whether
/// one of them does, however short it is.
constexpr llvm::StringLiteral rare = "warp.rare";

} // namespace warp::attr

#endif // WARP_LIB_TRANSFORMS_RAREBRANCH_H
