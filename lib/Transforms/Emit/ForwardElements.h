//===- ForwardElements.h - Store-to-load forwarding of elements -*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_FORWARDELEMENTS_H
#define WARP_LIB_TRANSFORMS_FORWARDELEMENTS_H

namespace mlir {
class Operation;
} // namespace mlir

namespace warp {

/// Replaces a load by what the thread has just stored at the same place.
void forwardStores(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_FORWARDELEMENTS_H
