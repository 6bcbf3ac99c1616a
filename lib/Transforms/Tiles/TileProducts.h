//===- TileProducts.h - Products in register accumulators -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_TILEPRODUCTS_H
#define WARP_TRANSFORMS_TILES_TILEPRODUCTS_H

#include "TensorMapAttributes.h"
#include "TileBuffers.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp::tiles {

/// A function of the device library for a product, by the end of its name, and
/// the layout of its sums among threads, by that of others.
struct ProductForm {
  std::string product, layout;
  /// Sums of a thread.
  int64_t slots;

  /// Made by instructions of four warps together.
  bool isByWarpgroups() const {
    return llvm::StringRef(layout).starts_with("wg_");
  }
};
/// The form of a product in registers of GPU threads; none for other shapes.
std::optional<ProductForm> findProductForm(TileMatmulOp op, int64_t threads,
                                           const TargetInfo &target);
/// The form of a pipelined product by warpgroups; none where those
/// instructions, or the shape, are missing (WarpgroupProducts.cpp).
std::optional<ProductForm> findWarpgroupForm(TileMatmulOp op, int64_t threads,
                                             const TargetInfo &target);
/// True if warpgroups can share so many rows and columns of sums.
bool hasWarpgroupPatch(llvm::ArrayRef<int64_t> shape, int64_t threads);
/// Chooses how a loop loads the factors of its product ahead: how many steps at
/// a time, and by whom (PlanLoads.cpp).
void planLoads(mlir::FunctionOpInterface kernel, mlir::scf::ForOp loop,
               TileMatmulOp product);
/// Elements of a row that TMA loads at a time.
int64_t getTmaBoxColumns(TileLoadOp load);
/// The form that an operation is marked with.
void setProductForm(TileMatmulOp op, const ProductForm &form);
std::optional<ProductForm> getProductForm(TileMatmulOp op);

/// Bytes of a factor's rows that come fastest from memory: as many are loaded
/// together.
constexpr int64_t fastBytes = 128;
/// True if a product is taken from what it is added to.
bool subtracts(TileMatmulOp op);
/// How many elements a product sums over.
inline int64_t depthOf(TileMatmulOp op) {
  return tileType(op.getA()).getShape()[!op.getTransposeA()];
}

/// A factor in memory: from row to row or column to column in elements, and
/// whether neighbours are what is summed over.
struct Factor {
  mlir::Value memory;
  int64_t pitch;
  bool isAlong;
};
std::optional<Factor> getFactor(mlir::Value tile, bool depthIsFirst);
/// From row to row for threads; 0 where it lies swizzled.
int64_t pitchOf(const Factor &factor);

/// True if copies know how the elements of an array lie, tile and array have
/// two dimensions, and offsets 32 bits.
bool isPlainWindow(mlir::Value array, TileType tile, mlir::ValueRange offsets);

/// Bytes of a tile with what is between rows; of one that is loaded ahead, for
/// one of its stages.
int64_t getStageBytes(mlir::Value tile);

/// Marks products, accumulators and software-pipelined loops.
void planAccumulators(mlir::FunctionOpInterface kernel, int64_t threads);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_TILEPRODUCTS_H
