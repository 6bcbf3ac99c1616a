//===- WarpDialect.h - The warp dialect -------------------------*- C++ -*-===//

#ifndef WARPDIALECT_WARPDIALECT_H
#define WARPDIALECT_WARPDIALECT_H

#include "mlir/IR/Dialect.h"

#include "WarpDialect/WarpDialect.h.inc"

namespace warp {

/// Unit attribute of the function that a launch runs.
constexpr llvm::StringLiteral kernelAttrName = "warp.kernel";

} // namespace warp

#endif // WARPDIALECT_WARPDIALECT_H
