//===- CarryOut.h - Reductions carried out of regions -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_CARRYOUT_H
#define WARP_LIB_TRANSFORMS_CARRYOUT_H

#include "mlir/IR/Builders.h"

namespace warp {

/// The update that is combined each time that control passes a place.
struct Carried {
  /// At the place; after `carryOut` in the outer block.
  mlir::Value value;
  /// The initial value of the combination; it precedes the regions.
  mlir::Value identity;
  std::function<mlir::Value(mlir::OpBuilder &, mlir::Value, mlir::Value)>
      combine;
};

/// True if values can be carried from a block through all branches and loops
/// around it to `outer`.
bool canCarryOut(mlir::Block *from, mlir::Block *outer);

/// Has branches yield the values, or the identity, and loops carry their
/// combination, so that they are known in `outer`.
void carryOut(llvm::MutableArrayRef<Carried> values, mlir::Block *from,
              mlir::Block *outer);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_CARRYOUT_H
