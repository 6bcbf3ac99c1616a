//===- AbsentThreads.h - Masking of absent threads --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_ABSENTTHREADS_H
#define WARP_TRANSFORMS_TILES_ABSENTTHREADS_H

#include "TileBuffers.h"

#include "mlir/IR/Builders.h"

namespace warp::tiles {

/// True if element e of a tile is what thread e of the block holds, or is
/// computed of such elements.
bool isOfThreads(mlir::Value tile);

/// An integer type that has an index outside of every array, whatever is added
/// to it within a tile; and that index.
mlir::Type nowhereType(mlir::Type index);
mlir::Value makeNowhere(mlir::OpBuilder &b, mlir::Location loc,
                        mlir::Type type);

/// Indices of elements that are nowhere for threads that are not there;
/// `alive` is what each thread has, or a tile of that.
mlir::Value pickedOrNowhere(mlir::OpBuilder &b, mlir::Location loc,
                            mlir::Value picked, mlir::Value alive);

/// A value under a condition, and otherwise another one.
mlir::Value orElse(mlir::OpBuilder &b, mlir::Location loc,
                   mlir::Value condition, mlir::Value value,
                   llvm::function_ref<mlir::Value()> other);

/// Moves elements of a load, store or update outside of the array where the
/// thread that gives their offset does not exist: its offset is undefined, and
/// the elements there belong to others. `differs` tells what threads
/// have each their own of.
void maskAccess(TileAccessOp op, mlir::Value alive,
                llvm::function_ref<bool(mlir::Value)> differs);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_ABSENTTHREADS_H
