//===- AngleGuard.h - atan2 at the origin -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// MLIR folds the angle of the origin to NaN. Until its foldings are over, the
// lowering of atan2 therefore takes the second operand from a select that gives
// the origin a side; warp-lower-math takes out selects with this attribute,
// since the libraries do know that angle.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ANGLEGUARD_H
#define WARP_LIB_TRANSFORMS_ANGLEGUARD_H

#include "llvm/ADT/StringRef.h"

namespace warp {
inline constexpr llvm::StringLiteral angleGuardName = "warp.angle_guard";
} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ANGLEGUARD_H
