//===- WarpAttributes.h - Attributes of launches ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_WARPATTRIBUTES_H
#define WARPDIALECT_WARPATTRIBUTES_H

#include "mlir/IR/BuiltinAttributes.h"
#include "mlir/IR/BuiltinTypes.h"

#include "WarpDialect/WarpEnums.h.inc"

namespace warp {

/// What a target may have, for passes that use it.
enum class Feature {
  /// Two neighbouring f32 are added to memory by one instruction.
  PairedFloatUpdates,
};

} // namespace warp

#define GET_ATTRDEF_CLASSES
#include "WarpDialect/WarpAttributes.h.inc"

#endif // WARPDIALECT_WARPATTRIBUTES_H
