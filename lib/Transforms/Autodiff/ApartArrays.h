//===- ApartArrays.h - Arrays with disjoint reads and writes ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_APARTARRAYS_H
#define WARP_TRANSFORMS_AUTODIFF_APARTARRAYS_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {
/// On a kernel and its derivatives: how many dimensions a launch may have. In
/// one of more, threads would share elements that are taken for their own.
constexpr llvm::StringLiteral maxRank = "warp.max_rank";
} // namespace warp::attr

namespace warp::autodiff {

/// On a kernel that is differentiated, a flag per array leaf: no element of it
/// is both read and written by the launch that the derivative is for. The
/// runtime finds that out from the launch's regions.
constexpr llvm::StringLiteral apartAttrName = "warp.apart";

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_APARTARRAYS_H
