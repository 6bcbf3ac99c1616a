//===- WarpgroupProducts.cpp - Products by four warps together ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Matrix instructions of compute capability 9.0 read factors of 16 bits from
// the block's memory, where loops that load ahead put them swizzled
// (lib/DeviceLib/gpu/TileWarpgroupProducts.cpp). Rows of 128 bytes come fastest
// from memory, so a loop goes through as many steps at a time as make 64
// elements of the depth.
//
//===----------------------------------------------------------------------===//

#include "TileProducts.h"

#include "Analysis/Forms.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;

namespace warp::tiles {

/// Elements of the depth that are loaded together.
constexpr int64_t fastDepth = 64;

/// How many columns can lie swizzled; across the depth, groups of 64 alone.
static bool canSwizzle(const Factor &factor) {
  int64_t columns = tileType(factor.memory).getShape()[1];
  return columns % 64 == 0 ||
         (factor.isAlong && (columns == 16 || columns == 32));
}

std::optional<ProductForm> findWarpgroupForm(TileMatmulOp op, int64_t threads,
                                             TargetAttr target) {
  Type type = tileType(op.getA()).getElementType();
  std::optional<Factor> a = getFactor(op.getA(), op.getTransposeA());
  std::optional<Factor> b = getFactor(op.getB(), !op.getTransposeB());
  if (target.getProcessor() != "sm_90a" || threads % 128 != 0 ||
      !(type.isF16() || type.isBF16()) || !a || !b || !canSwizzle(*a) ||
      !canSwizzle(*b))
    return std::nullopt;
  ArrayRef<int64_t> shape = tileType(op.getResult()).getShape();
  using Patch = std::pair<int64_t, int64_t>;
  for (auto [rows, columns] :
       {Patch(64, 256), Patch(128, 128), Patch(64, 128), Patch(64, 64)}) {
    if (shape[0] % rows != 0 || shape[1] % columns != 0 ||
        (shape[0] / rows) * (shape[1] / columns) * 128 != threads)
      continue;
    std::string patch = std::to_string(rows) + "x" + std::to_string(columns);
    std::string product = type.isF16() ? "wg_f16_" : "wg_bf16_";
    product +=
        patch + "_" + (a->isAlong ? "k" : "m") + (b->isAlong ? "k" : "n");
    return ProductForm{product, "wg_" + patch, rows * columns / 128};
  }
  return std::nullopt;
}

/// Gives a tile, loaded or a transposed view, another shape.
static void setShape(Value tile, int64_t axis, int64_t extent) {
  if (auto view = tile.getDefiningOp<TileTransposeOp>())
    setShape(view.getTile(), view.getAxes()[axis], extent);
  SmallVector<int64_t> shape(tileType(tile).getShape());
  shape[axis] = extent;
  tile.setType(
      TileType::get(tile.getContext(), shape, tileType(tile).getElementType()));
}

void mergeSteps(scf::ForOp loop, TileMatmulOp product) {
  int64_t depth = tileType(product.getA()).getShape()[!product.getTransposeA()];
  if (fastDepth % depth != 0 || depth == fastDepth ||
      getConstantInteger(loop.getStep()) != 1)
    return;
  int64_t steps = fastDepth / depth;
  Forms forms;
  Symbol trip = Symbol::trip(loop);
  SmallVector<std::pair<TileLoadOp, int64_t>> loads;
  for (auto [tile, depthIsFirst] :
       {std::pair(product.getA(), product.getTransposeA()),
        std::pair(product.getB(), !product.getTransposeB())}) {
    Factor factor = *getFactor(tile, depthIsFirst);
    auto load = factor.memory.getDefiningOp<TileLoadOp>();
    int64_t axis = factor.isAlong;
    for (int64_t d = 0; d < 2; ++d) {
      std::optional<Form> each =
          forms.of(load.getOffsets()[d]).coefficientOf(trip);
      std::optional<int64_t> number = each ? each->getConstant() : std::nullopt;
      if (number != (d == axis ? depth : 0))
        return;
    }
    loads.emplace_back(load, axis);
  }
  std::optional<Form> trips = forms.countTrips(loop);
  std::optional<int64_t> count = trips ? trips->getConstant() : std::nullopt;
  Builder b(loop.getContext());
  if (!count || *count % steps != 0)
    for (auto [load, axis] : loads)
      load->setAttr(attr::merged, b.getDenseI64ArrayAttr({axis, depth}));
  setShape(product.getA(), !product.getTransposeA(), fastDepth);
  setShape(product.getB(), product.getTransposeB(), fastDepth);
  OpBuilder before(loop);
  loop.setStep(arith::ConstantOp::create(before, loop.getLoc(),
                                         b.getI32IntegerAttr(steps)));
}

} // namespace warp::tiles
