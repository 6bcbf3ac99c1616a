//===- WarpDialect.h - The warp dialect -------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_WARPDIALECT_H
#define WARPDIALECT_WARPDIALECT_H

#include "mlir/IR/Dialect.h"

#include "WarpDialect/WarpDialect.h.inc"

namespace warp {

/// Unit attribute of the function that a launch runs.
constexpr llvm::StringLiteral kernelAttrName = "warp.kernel";
/// Unit attribute of a float operation that must round on its own: it is
/// neither contracted nor reassociated.
constexpr llvm::StringLiteral exactAttrName = "warp.exact";

} // namespace warp

#endif // WARPDIALECT_WARPDIALECT_H
