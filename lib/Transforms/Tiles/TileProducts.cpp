//===- TileProducts.cpp - Forms of products on GPUs -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "TileProducts.h"

#include "KernelFunction.h"

using namespace mlir;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Forms
//===----------------------------------------------------------------------===//

/// Asynchronous copies and matrices of 16 x 8 came with it.
constexpr int64_t oldestVersion = 80;

static bool isOne(Value factor) {
  if (!factor)
    return true;
  auto known = factor.getDefiningOp<ConstantOp>();
  auto number = known ? dyn_cast<FloatAttr>(known.getValue()) : FloatAttr();
  return number && number.getValue().isExactlyValue(1.0);
}

std::optional<Factor> getFactor(Value tile, bool depthIsFirst) {
  std::optional<Strided> strided = getStrided(tile);
  if (!strided || tileType(strided->memory).getRank() != 2)
    return std::nullopt;
  int64_t depthStep = strided->steps[!depthIsFirst];
  int64_t pitch = getPitch(strided->memory)
                      .value_or(tileType(strided->memory).getShape()[1]);
  return Factor{strided->memory, pitch, depthStep == 1};
}

/// Rows and columns of sums per thread, or per warp, if the tile divides.
static bool fitsBlocked(int64_t m, int64_t n, int64_t r, int64_t c,
                        int64_t threads) {
  if (m % r != 0 || n % c != 0 || (m / r) * (n / c) != threads)
    return false;
  int64_t columns = n / c;
  int64_t wide = columns % 8 == 0   ? 8
                 : columns % 4 == 0 ? 4
                 : columns % 2 == 0 ? 2
                                    : 1;
  return (m / r) % (32 / wide) == 0;
}

static bool fitsWarps(int64_t m, int64_t n, int64_t r, int64_t c,
                      int64_t threads) {
  return m % r == 0 && n % c == 0 && (m / r) * (n / c) * 32 == threads;
}

std::optional<ProductForm> findProductForm(TileMatmulOp op, int64_t threads,
                                           int64_t version) {
  Type type = tileType(op.getA()).getElementType();
  if (version < oldestVersion || threads % 32 != 0 || !isOne(op.getAlpha()) ||
      !isOne(op.getBeta()) || tileType(op.getB()).getElementType() != type ||
      !tileType(op.getResult()).getElementType().isF32() ||
      (op.getC() && op.getC().getType() != op.getResult().getType()) ||
      !(type.isF32() || type.isF16() || type.isBF16()))
    return std::nullopt;
  std::optional<Factor> a = getFactor(op.getA(), op.getTransposeA());
  std::optional<Factor> b = getFactor(op.getB(), !op.getTransposeB());
  int64_t depth = tileType(op.getA()).getShape()[!op.getTransposeA()];
  int64_t run = type.isF32() ? 4 : 8;
  if (!a || !b || a->pitch % run != 0 || b->pitch % run != 0 ||
      depth % (type.isF32() ? 4 : 16) != 0)
    return std::nullopt;
  ArrayRef<int64_t> shape = tileType(op.getResult()).getShape();
  std::string ending = "_";
  ending += a->isAlong ? "k" : "m";
  ending += b->isAlong ? "k" : "n";
  using Patch = std::pair<int64_t, int64_t>;
  auto patchOf = [](Patch patch) {
    return "_" + std::to_string(patch.first) + "x" +
           std::to_string(patch.second);
  };
  if (type.isF32()) {
    for (Patch patch : {Patch(8, 8), Patch(8, 4), Patch(4, 8), Patch(4, 4)})
      if (fitsBlocked(shape[0], shape[1], patch.first, patch.second, threads)) {
        std::string name = "f32" + patchOf(patch) + ending;
        return ProductForm{name, name, patch.first * patch.second};
      }
    return std::nullopt;
  }
  for (Patch patch :
       {Patch(64, 64), Patch(64, 32), Patch(32, 64), Patch(32, 32),
        Patch(32, 16), Patch(16, 32), Patch(16, 16)})
    if (fitsWarps(shape[0], shape[1], patch.first, patch.second, threads))
      return ProductForm{
          (type.isF16() ? "f16" : "bf16") + patchOf(patch) + ending,
          "mma" + patchOf(patch), patch.first * patch.second / 32};
  return std::nullopt;
}

void setProductForm(TileMatmulOp op, const ProductForm &form) {
  Builder b(op.getContext());
  op->setAttr(attr::form, b.getArrayAttr({b.getStringAttr(form.product),
                                          b.getStringAttr(form.layout),
                                          b.getI64IntegerAttr(form.slots)}));
}

std::optional<ProductForm> getProductForm(TileMatmulOp op) {
  auto form = op->getAttrOfType<ArrayAttr>(attr::form);
  if (!form)
    return std::nullopt;
  return ProductForm{cast<StringAttr>(form[0]).str(),
                     cast<StringAttr>(form[1]).str(),
                     cast<IntegerAttr>(form[2]).getInt()};
}

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

bool isPlainWindow(Value array, TileType tile, ValueRange offsets) {
  auto type = cast<ArrayType>(array.getType());
  while (auto view = array.getDefiningOp<ViewOp>())
    array = view.getArray();
  if (auto gradient = array.getDefiningOp<GradOp>())
    array = gradient.getArray();
  return isa<BlockArgument>(array) && tile.getRank() == 2 &&
         type.getRank() == 2 && llvm::all_of(offsets, [](Value offset) {
           return getByteSize(offset.getType()) <= 4;
         });
}

} // namespace warp::tiles
