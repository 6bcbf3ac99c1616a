//===- NestRuns.h - Loop nests of neighbour runs ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_NESTRUNS_H
#define WARP_LIB_TRANSFORMS_NESTRUNS_H

namespace mlir {
class Operation;
} // namespace mlir

namespace warp {

/// Makes the runs of loops through runs of a list (RunLoop.h) loops of their
/// own, inside of those that look for runs.
void nestRuns(mlir::Operation *entry);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_NESTRUNS_H
