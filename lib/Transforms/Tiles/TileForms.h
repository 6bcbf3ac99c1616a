//===- TileForms.h - Factors and transforms by warps ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILEFORMS_H
#define WARP_TRANSFORMS_TILES_TILEFORMS_H

#include "TileBuffers.h"

namespace warp::tiles {

/// Marks factors, solves and transforms that the device library has functions
/// for on a GPU, and gives matrices that only those read a pitch, so that their
/// rows and columns lie in different banks.
void chooseForms(mlir::FunctionOpInterface kernel, int64_t threads);

/// Bytes that an operation with a form needs besides its tiles.
int64_t getFormBytes(mlir::Operation *op, int64_t threads);
/// The ending of the function, a number of columns, rows or elements.
int64_t getForm(mlir::Operation *op);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILEFORMS_H
