//===- TableFolds.h - Rewrites to constant tables ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_DIALECT_TABLEFOLDS_H
#define WARP_LIB_DIALECT_TABLEFOLDS_H

#include "mlir/IR/Attributes.h"
#include "mlir/IR/Types.h"

namespace mlir {
class RewritePatternSet;
} // namespace mlir

namespace warp {

/// A constant as `warp.cast` converts it; null for other than numbers.
mlir::Attribute castConstant(mlir::Attribute value, mlir::Type from,
                             mlir::Type to);

void addTablePatterns(mlir::RewritePatternSet &patterns);

} // namespace warp

#endif // WARP_LIB_DIALECT_TABLEFOLDS_H
