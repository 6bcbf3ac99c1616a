//===- PlaceLocals.h - Stack placement of composites ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_COMPOSITES_PLACELOCALS_H
#define WARP_TRANSFORMS_COMPOSITES_PLACELOCALS_H

namespace mlir {
class FunctionOpInterface;
} // namespace mlir

namespace warp {

/// Adds to components, where what is added to a long composite is a number.
void addInPlace(mlir::FunctionOpInterface function);

/// Reads components of long composites from their newest value, where that lets
/// an insertion have the memory of the one before it.
void readNewest(mlir::FunctionOpInterface function);

/// Gives memory of the thread to the composites of a function that are long and
/// indexed at run time; an index out of range is taken as the last.
void placeLocals(mlir::FunctionOpInterface function);

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_PLACELOCALS_H
