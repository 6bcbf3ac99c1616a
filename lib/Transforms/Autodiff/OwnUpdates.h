//===- OwnUpdates.h - Atomics on thread-exclusive elements ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_OWNUPDATES_H
#define WARP_TRANSFORMS_AUTODIFF_OWNUPDATES_H

#include "Analysis/ArrayOrigins.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/FunctionInterfaces.h"
#include "llvm/ADT/MapVector.h"

namespace warp::autodiff {

/// Makes atomics whose result is used loads and stores, in arrays of which no
/// two threads touch the same element.
void splitOwnUpdates(mlir::FunctionOpInterface kernel,
                     const ArrayLeaves &leaves);

/// An atomic as a load and a store, with one operation on what was loaded
/// between them, but for an exchange.
struct SplitUpdate {
  AtomicKind kind;
  LoadOp load;
  StoreOp store;
};

struct TrustedUpdates {
  /// Arrays for which the launch has to show that no threads conflict, by leaf,
  /// and where that matters.
  llvm::MapVector<unsigned, mlir::Location> arrays;
  llvm::SmallVector<SplitUpdate> updates;
};

/// The same in arrays of which indices do not tell, if a derivative goes
/// through the result.
TrustedUpdates splitTrustedUpdates(mlir::FunctionOpInterface kernel,
                                   const ArrayLeaves &leaves,
                                   llvm::ArrayRef<bool> active);

/// Makes them atomics again, for a launch in which threads may conflict.
void joinUpdates(llvm::ArrayRef<SplitUpdate> updates);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_OWNUPDATES_H
