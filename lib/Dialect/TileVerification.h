//===- TileVerification.h - Shared parts of tile verifiers ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_DIALECT_TILEVERIFICATION_H
#define WARP_LIB_DIALECT_TILEVERIFICATION_H

#include "WarpDialect/TileOps.h"

namespace warp {

inline TileType typeOf(mlir::Value tile) {
  return mlir::cast<TileType>(tile.getType());
}

inline mlir::LogicalResult require(mlir::Operation *op, bool holds,
                                   const llvm::Twine &message) {
  if (holds)
    return mlir::success();
  return op->emitOpError() << message;
}

/// A function of elements has no tile operations: it is computed wherever the
/// elements are.
inline mlir::LogicalResult verifyElementFunction(mlir::Operation *op) {
  auto result = op->getRegion(0).walk([](mlir::Operation *inner) {
    if (!isTileOp(inner) && !mlir::isa<BarrierOp>(inner))
      return mlir::WalkResult::advance();
    inner->emitOpError() << "cannot stand in a function of elements";
    return mlir::WalkResult::interrupt();
  });
  return mlir::failure(result.wasInterrupted());
}

inline bool isNumber(mlir::Type type) {
  return isScalar(type) && !isBool(type);
}

} // namespace warp

#endif // WARP_LIB_DIALECT_TILEVERIFICATION_H
