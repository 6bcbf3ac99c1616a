//===- WarpAllTypes.td - Types of all headers ----------------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The dialect parses and prints its types in one place.
//
//===----------------------------------------------------------------------===//

include "WarpOps.td"
include "WarpTileTypes.td"
