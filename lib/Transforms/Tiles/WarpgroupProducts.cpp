//===- WarpgroupProducts.cpp - Warpgroup matrix products ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Matrix instructions of compute capability 9.0 read factors of 16 bits from
// shared memory, where loops that load ahead put them swizzled
// (lib/DeviceLib/nvidia/TileWarpgroupProducts.cpp).
//
//===----------------------------------------------------------------------===//

#include "Targets/Target.h"
#include "TileProducts.h"

using namespace mlir;

namespace warp::tiles {

/// How many columns can lie swizzled; across the depth, groups of 64 alone.
static bool canSwizzle(const Factor &factor) {
  int64_t columns = tileType(factor.memory).getShape()[1];
  return columns % 64 == 0 ||
         (factor.isAlong && (columns == 16 || columns == 32));
}

/// Rows and columns of sums per warpgroup.
using Patch = std::pair<int64_t, int64_t>;

static std::optional<Patch> findPatch(ArrayRef<int64_t> shape,
                                      int64_t threads) {
  for (auto [rows, columns] : {Patch(64, 256), Patch(128, 128), Patch(64, 128),
                               Patch(128, 64), Patch(64, 64), Patch(64, 32)})
    if (shape[0] % rows == 0 && shape[1] % columns == 0 &&
        (shape[0] / rows) * (shape[1] / columns) * 128 == threads)
      return Patch(rows, columns);
  return std::nullopt;
}

bool hasWarpgroupPatch(ArrayRef<int64_t> shape, int64_t threads) {
  return findPatch(shape, threads).has_value();
}

std::optional<ProductForm> findWarpgroupForm(TileMatmulOp op, int64_t threads,
                                             const TargetInfo &target) {
  Type type = tileType(op.getA()).getElementType();
  std::optional<Factor> a = getFactor(op.getA(), op.getTransposeA());
  std::optional<Factor> b = getFactor(op.getB(), !op.getTransposeB());
  if (!target.has(Feature::Wgmma) || threads % 128 != 0 || subtracts(op) ||
      !(type.isF16() || type.isBF16()) || !a || !b || !canSwizzle(*a) ||
      !canSwizzle(*b))
    return std::nullopt;
  auto patch = findPatch(tileType(op.getResult()).getShape(), threads);
  if (!patch)
    return std::nullopt;
  auto [rows, columns] = *patch;
  std::string name = std::to_string(rows) + "x" + std::to_string(columns);
  std::string product = type.isF16() ? "wg_f16_" : "wg_bf16_";
  product += name + "_" + (a->isAlong ? "k" : "m") + (b->isAlong ? "k" : "n");
  return ProductForm{product, "wg_" + name, rows * columns / 128};
}

} // namespace warp::tiles
