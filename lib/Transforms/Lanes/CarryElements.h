//===- CarryElements.h - Scalar replacement in recurrences ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_CARRYELEMENTS_H
#define WARP_LIB_TRANSFORMS_CARRYELEMENTS_H

namespace mlir {
class FunctionOpInterface;
} // namespace mlir

namespace warp {

/// Has loops carry what an iteration stores and the next one loads.
void carryElements(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_CARRYELEMENTS_H
