//===- Checks.h - Checks that several operations share ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_DIALECT_CHECKS_H
#define WARP_LIB_DIALECT_CHECKS_H

#include "WarpDialect/WarpTypes.h"

#include "mlir/IR/Operation.h"

namespace warp {

/// The struct has this field, of the given type.
llvm::LogicalResult verifyField(mlir::Operation *op, StructType type,
                                llvm::StringRef field, mlir::Type actual);

} // namespace warp

#endif // WARP_LIB_DIALECT_CHECKS_H
