//===- Accumulators.h - Products in register accumulators -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_ACCUMULATORS_H
#define WARP_TRANSFORMS_TILES_ACCUMULATORS_H

#include "LowerTiles.h"
#include "TileProducts.h"

namespace warp::tiles {

/// Code of tiles whose elements are accumulators: sums of products in registers
/// of threads, in the layout of the product's form (TileProducts.h).
struct AccumulatorLowering : TileLowering {
  using TileLowering::TileLowering;

  /// A number in all elements.
  void set(mlir::Operation *op);
  /// The elements of a tile in memory.
  void take(TileMapOp op);
  /// A copy in memory.
  void give(TileMapOp op);
  void storeTile(TileStoreOp op);
  void addTile(TileAtomicOp op);
  /// A product with a form.
  void multiply(TileMatmulOp op);
  /// A loop that loads the factors of its product ahead of their use.
  void pipeline(mlir::scf::ForOp loop);

private:
  Value accumulatorsOf(Value tile, int64_t slots);
  void callForSums(const llvm::Twine &name, const ProductForm &form,
                   TileType type, ValueRange arguments);
  void call(llvm::StringRef verb, Value tile, Values arguments);
  void multiply(TileMatmulOp op, Value sums, Value stage);
  Value addressOfStage(Value tile, Value stage);
  void limitWindow(Values &window, int64_t axis, Value count);
  Values offsetsAt(TileLoadOp load, mlir::scf::ForOp loop, Value iteration,
                   Value *array = nullptr);
  void fetch(TileLoadOp load, mlir::scf::ForOp loop, Value iteration,
             Value stage);
  Value iterationAfter(mlir::scf::ForOp loop, Value iteration, Value steps);
  Value isIteration(mlir::scf::ForOp loop, Value iteration);
  Value stepsBefore(mlir::scf::ForOp loop);
  void pipelineCopies(mlir::scf::ForOp loop);
  // In TmaProducts.cpp.
  Values tmaFactorOf(TileLoadOp load, mlir::scf::ForOp loop);
  void pipelineTma(mlir::scf::ForOp loop);
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_ACCUMULATORS_H
