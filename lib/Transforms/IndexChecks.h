//===- IndexChecks.h - Bounds checks of debug launches ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_INDEXCHECKS_H
#define WARP_LIB_TRANSFORMS_INDEXCHECKS_H

#include "mlir/IR/Builders.h"

namespace warp {

/// Has a debug launch report indices of a composite that are out of bounds,
/// unless all of them are constants, which the front end has checked.
void checkIndices(mlir::OpBuilder &b, mlir::Location loc, mlir::Type composite,
                  mlir::ValueRange indices);

/// The same for all that is indexed within an operation: components, rows,
/// tiles and arrays of a thread; other arrays are checked where they are
/// accessed. An access with a check is left alone: first this is done before
/// anything is removed that nobody uses, and then for what passes have made.
void insertIndexChecks(mlir::Operation *module);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_INDEXCHECKS_H
