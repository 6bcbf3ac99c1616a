//===- CopiedArrays.h - Arrays that workers may have copies of --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_COPIEDARRAYS_H
#define WARP_LIB_TRANSFORMS_COPIEDARRAYS_H

#include "warp/PrivateCopies.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// The arrays that a kernel in phase `launch` updates atomically, if all of
/// these updates add numbers and nothing else happens to the arrays, provided
/// that those of a launch are disjoint. None otherwise.
std::vector<CopiedArray> findCopied(mlir::FunctionOpInterface kernel);

/// Attaches to a kernel what `readCopied` finds on its entry.
void attachCopied(mlir::Operation *kernel, const CopiedArrays &copied);
CopiedArrays readCopied(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_COPIEDARRAYS_H
