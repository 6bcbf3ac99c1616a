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

static bool isNumber(Value factor, double expected) {
  auto known = factor.getDefiningOp<ConstantOp>();
  auto number = known ? dyn_cast<FloatAttr>(known.getValue()) : FloatAttr();
  return number && number.getValue().isExactlyValue(expected);
}

static bool isOne(Value factor) { return !factor || isNumber(factor, 1); }

bool subtracts(TileMatmulOp op) {
  return op.getAlpha() && isNumber(op.getAlpha(), -1);
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

/// Rows and columns of sums per thread, or per warp.
using Patch = std::pair<int64_t, int64_t>;

static std::string nameOf(Patch patch) {
  return "_" + std::to_string(patch.first) + "x" + std::to_string(patch.second);
}

/// How the sums of a tile are shared by `owners`, threads or warps: if not by
/// all, then by as many as can be.
static std::optional<Patch> findPatch(ArrayRef<int64_t> shape, int64_t owners,
                                      ArrayRef<Patch> patches) {
  std::optional<Patch> best;
  int64_t most = 0;
  for (Patch patch : patches) {
    auto [rows, columns] = patch;
    int64_t count = (shape[0] / rows) * (shape[1] / columns);
    if (shape[0] % rows != 0 || shape[1] % columns != 0 || count > owners ||
        count <= most)
      continue;
    best = patch;
    most = count;
  }
  return best;
}

/// Threads that have a row of sums each compute that many without a form for
/// it, and fewer with one.
constexpr int64_t fewestHolders = 16;

static std::optional<Patch> findThreadPatch(ArrayRef<int64_t> shape,
                                            int64_t threads) {
  auto patch = findPatch(shape, threads, {{8, 8}, {8, 4}, {4, 8}, {4, 4}});
  auto holders = [&] {
    return shape[0] * shape[1] / (patch->first * patch->second);
  };
  if (!patch || holders() < 32)
    if (auto less = findPatch(shape, threads, {{2, 4}}))
      patch = less;
  if (!patch || holders() < fewestHolders)
    return std::nullopt;
  return patch;
}

std::optional<ProductForm> findProductForm(TileMatmulOp op, int64_t threads,
                                           const TargetInfo &target) {
  Type type = tileType(op.getA()).getElementType(),
       result = tileType(op.getResult()).getElementType();
  bool isNarrow = type.isF16() || type.isBF16();
  bool isDouble = type.isF64() && target.has(Feature::DoubleMma);
  if (!target.has(Feature::BlockTiles) ||
      (isNarrow && !target.has(Feature::Mma)) ||
      !target.hasFullSubgroups(threads) ||
      !(isOne(op.getAlpha()) || subtracts(op)) || !isOne(op.getBeta()) ||
      tileType(op.getB()).getElementType() != type ||
      !(result == type || (isNarrow && result.isF32())) ||
      (op.getC() && op.getC().getType() != op.getResult().getType()) ||
      !(type.isF32() || isNarrow || isDouble))
    return std::nullopt;
  std::optional<Factor> a = getFactor(op.getA(), op.getTransposeA());
  std::optional<Factor> b = getFactor(op.getB(), !op.getTransposeB());
  int64_t depth = depthOf(op);
  int64_t run = 16 / getByteSize(type);
  if (!a || !b || a->pitch % run != 0 || b->pitch % run != 0 ||
      depth % (isNarrow ? 16 : 4) != 0)
    return std::nullopt;
  ArrayRef<int64_t> shape = tileType(op.getResult()).getShape();
  std::string ending = "_";
  ending += a->isAlong ? "k" : "m";
  ending += b->isAlong ? "k" : "n";
  if (type.isF32()) {
    auto patch = findThreadPatch(shape, threads);
    if (!patch)
      return std::nullopt;
    std::string name = "f32" + nameOf(*patch) + ending;
    return ProductForm{name, name, patch->first * patch->second};
  }
  static constexpr Patch ofDoubles[] = {
      {64, 32}, {32, 32}, {32, 16}, {16, 32}, {16, 16}};
  static constexpr Patch ofHalves[] = {{64, 64}, {64, 32}, {32, 64}, {32, 32},
                                       {32, 16}, {16, 32}, {16, 16}};
  auto patch = findPatch(shape, threads / target.getSubgroupSize(),
                         isDouble ? ArrayRef(ofDoubles) : ArrayRef(ofHalves));
  if (!patch)
    return std::nullopt;
  std::string name = isDouble ? "f64" : type.isF16() ? "f16" : "bf16";
  return ProductForm{name + nameOf(*patch) + ending,
                     (isDouble ? "f64_mma" : "mma") + nameOf(*patch),
                     patch->first * patch->second / target.getSubgroupSize()};
}

void setProductForm(TileMatmulOp op, const ProductForm &form) {
  op->setAttr(warp::attr::function,
              TileFunctionAttr::get(op.getContext(), form.product, form.layout,
                                    form.slots));
}

std::optional<ProductForm> getProductForm(TileMatmulOp op) {
  auto function = op->getAttrOfType<TileFunctionAttr>(warp::attr::function);
  if (!function)
    return std::nullopt;
  return ProductForm{function.getName().str(), function.getAccumulators().str(),
                     function.getSlots()};
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
