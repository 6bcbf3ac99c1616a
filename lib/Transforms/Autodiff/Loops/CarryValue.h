//===- CarryValue.h - Additional loop-carried value -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_CARRYVALUE_H
#define WARP_TRANSFORMS_AUTODIFF_CARRYVALUE_H

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp::autodiff {

/// Walks code in program order with a value that some operations change. Loops
/// and branches that hold such operations get it as one more value.
class ValueCarrier {
public:
  virtual ~ValueCarrier() = default;

  /// The value after an operation with regions, or at the end of a
  /// block, if it is `current` before.
  mlir::Value carry(mlir::Operation *op, mlir::Value current);
  mlir::Value carry(mlir::Block &block, mlir::Value current);

private:
  /// True if an operation without regions changes the value.
  virtual bool changes(mlir::Operation *op) const = 0;
  /// The value after such an operation, which may be erased.
  virtual mlir::Value pass(mlir::Operation *op, mlir::Value current) = 0;

  bool holdsChange(mlir::Operation *op) const;
  mlir::Value carry(mlir::scf::ForOp loop, mlir::Value start);
  mlir::Value carry(mlir::scf::IfOp branch, mlir::Value current);
  mlir::Value carry(mlir::scf::WhileOp loop, mlir::Value start);
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_CARRYVALUE_H
