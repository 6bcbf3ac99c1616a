//===- CarryReshaped.h - Shapes of carried tiles ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_CARRYRESHAPED_H
#define WARP_TRANSFORMS_TILES_CARRYRESHAPED_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp::tiles {

/// Has loops and branches carry tiles in the shape that they are used in.
void carryReshaped(mlir::FunctionOpInterface kernel);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_CARRYRESHAPED_H
