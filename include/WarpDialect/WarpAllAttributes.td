//===- WarpAllAttributes.td - Attributes of all headers ------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The dialect parses and prints its attributes in one place.
//
//===----------------------------------------------------------------------===//

include "WarpOps.td"
include "WarpTileAttributes.td"
