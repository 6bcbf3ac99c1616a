//===- Atomics.h - What an atomic update computes ---------------*- C++ -*-===//

#ifndef WARP_LIB_TRANSFORMS_ATOMICS_H
#define WARP_LIB_TRANSFORMS_ATOMICS_H

#include "WarpDialect/WarpOps.h"

#include "mlir/IR/Builders.h"

namespace warp {

/// The value that an update of `old` by `value` leaves. `type` still has its
/// sign. With `anyOrder` a sum may be reassociated.
mlir::Value combine(mlir::OpBuilder &b, mlir::Location loc, AtomicKind kind,
                    mlir::Value old, mlir::Value value, mlir::Type type,
                    bool anyOrder = false);

/// Whether the order of atomic updates in an entry may show: sums of floats
/// round, and old values tell who came first.
bool dependsOnOrder(mlir::Operation *update);
bool hasOrderedUpdates(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ATOMICS_H
