//===- BlockRows.h - Sums of a block over counted elements ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_BLOCKROWS_H
#define WARP_LIB_TRANSFORMS_BLOCKROWS_H

#include "WarpDialect/WarpOps.h"

namespace warp {

/// An update that one lane makes for all of its warp.
struct WarpUpdate {
  AtomicComponentsOp op;
  /// The array of whole elements, of which the update may be of a component.
  mlir::Value array;
  /// The component; null for an update of all.
  mlir::Value component;
  int64_t components = 1;
  /// True if it is another lane each time that makes that of an element.
  bool changesLanes = false;
};

/// Marks an update that each lane of a warp makes for all of it, in a loop that
/// the warp runs together.
constexpr llvm::StringLiteral warpSumAttr = "warp.warp_sum";

/// True if an update is of an element whose index loops count, so that the
/// threads of a block come to the same few elements again and again.
bool isCounted(AtomicComponentsOp op);

/// Has warps add to rows of their own in shared memory, whose sums go to the
/// arrays at the end of the entry.
void addInBlockRows(mlir::FunctionOpInterface entry,
                    llvm::ArrayRef<WarpUpdate> updates);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_BLOCKROWS_H
