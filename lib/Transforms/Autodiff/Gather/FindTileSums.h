//===- FindTileSums.h - Sums of products over blocks ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_FINDTILESUMS_H
#define WARP_TRANSFORMS_AUTODIFF_FINDTILESUMS_H

#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp::autodiff {

/// An addition to gradients, in a loop, of a product that was converted if
/// there is a map, by all blocks along a dimension of the launch.
struct TileSum {
  TileAtomicOp update;
  TileMapOp conversion;
  TileMatmulOp product;
  mlir::scf::ForOp loop;
  unsigned dim;
  /// True if each block and step has elements of its own.
  bool isApart;
};

/// Sums of an adjoint whose terms each block can compute for another one before
/// the launch. The adjoint has one `tid` if there are any.
llvm::SmallVector<TileSum> findTileSums(mlir::func::FuncOp adjoint);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_FINDTILESUMS_H
