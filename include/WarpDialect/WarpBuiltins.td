//===- WarpBuiltins.td - All builtins ------------------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_BUILTINS_TD
#define WARP_BUILTINS_TD

include "WarpBuiltinBase.td"
include "WarpOperators.td"
include "WarpScalarMath.td"
include "WarpLinearAlgebra.td"
include "WarpRotations.td"
include "WarpStableMath.td"
include "WarpDecompositions.td"
include "WarpRandom.td"
include "WarpSpecials.td"
include "WarpTileSpecials.td"
include "WarpTileAlgebra.td"
include "WarpLibraryFunctions.td"
include "WarpGeometryFunctions.td"

#endif // WARP_BUILTINS_TD
