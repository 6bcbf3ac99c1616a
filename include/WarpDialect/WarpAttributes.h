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

class TargetInfo;

/// Bits of the widest vectors of a target that do not lower its clock; 0 if it
/// has none, or there is no such target.
int64_t getVectorBits(llvm::StringRef target);

} // namespace warp

#define GET_ATTRDEF_CLASSES
#include "WarpDialect/WarpAttributes.h.inc"

#endif // WARPDIALECT_WARPATTRIBUTES_H
