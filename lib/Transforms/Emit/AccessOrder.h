//===- AccessOrder.h - Order of a thread's own accesses ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ACCESSORDER_H
#define WARP_LIB_TRANSFORMS_ACCESSORDER_H

namespace mlir {
class Operation;
} // namespace mlir

namespace warp {

/// Replaces a load by what the thread has just stored at the same place.
void forwardStores(mlir::Operation *entry);

/// Whether a vectoriser that is told that threads are independent keeps the
/// order of one thread's accesses; atomic `updates` count where they are plain.
bool keepsOrderInVectors(mlir::Operation *entry, bool updates);

/// Whether every update of an array element is of neighbours in neighbouring
/// threads, so that several threads can perform it together.
bool updatesNeighbours(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ACCESSORDER_H
