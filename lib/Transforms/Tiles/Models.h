//===- Models.h - Models of tile operations ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A model implements TileOpInterface for one operation. The file of a family
// has its models, lowerings and adjoints, and attaches the models.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_MODELS_H
#define WARP_TRANSFORMS_TILES_MODELS_H

#include "LowerTiles.h"

#include "Autodiff/Reverse/ReverseTiles.h"

namespace warp::tiles {

template <typename Model, typename Op>
using TileModel = TileOpInterface::ExternalModel<Model, Op>;

void attachElements(mlir::MLIRContext &context);
void attachViews(mlir::MLIRContext &context);
void attachAccesses(mlir::MLIRContext &context);
void attachUpdates(mlir::MLIRContext &context);
void attachThreads(mlir::MLIRContext &context);
void attachParts(mlir::MLIRContext &context);
void attachReductions(mlir::MLIRContext &context);
void attachScans(mlir::MLIRContext &context);
void attachSorts(mlir::MLIRContext &context);
void attachProducts(mlir::MLIRContext &context);
void attachFactors(mlir::MLIRContext &context);
void attachSolves(mlir::MLIRContext &context);
void attachTransforms(mlir::MLIRContext &context);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_MODELS_H
