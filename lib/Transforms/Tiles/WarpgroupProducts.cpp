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

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Forms.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "warp/TensorMaps.h"

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
  for (auto [rows, columns] : {Patch(64, 256), Patch(128, 128), Patch(64, 128),
                               Patch(64, 64), Patch(64, 32)}) {
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

namespace {

/// A factor's load, and the axis of its tile along which the depth lies.
struct FactorLoad {
  TileLoadOp op;
  int64_t axis;
};
using FactorLoads = SmallVector<FactorLoad, 2>;

} // namespace

static FactorLoads loadsOf(TileMatmulOp product) {
  FactorLoads loads;
  for (auto [tile, depthIsFirst] :
       {std::pair(product.getA(), product.getTransposeA()),
        std::pair(product.getB(), !product.getTransposeB())}) {
    Factor factor = *getFactor(tile, depthIsFirst);
    loads.push_back(
        {factor.memory.getDefiningOp<TileLoadOp>(), int64_t(factor.isAlong)});
  }
  return loads;
}

//===----------------------------------------------------------------------===//
// Steps
//===----------------------------------------------------------------------===//

/// Lets the loop take several steps at a time, if they follow each other in the
/// arrays; `whole`: only if there are none left then.
static void mergeSteps(scf::ForOp loop, TileMatmulOp product, bool whole) {
  int64_t depth = tileType(product.getA()).getShape()[!product.getTransposeA()];
  if (fastDepth % depth != 0 || depth == fastDepth ||
      getConstantInteger(loop.getStep()) != 1)
    return;
  int64_t steps = fastDepth / depth;
  Forms forms;
  Symbol trip = Symbol::trip(loop);
  FactorLoads loads = loadsOf(product);
  for (auto [load, axis] : loads)
    for (int64_t d = 0; d < 2; ++d) {
      std::optional<Form> each =
          forms.of(load.getOffsets()[d]).coefficientOf(trip);
      std::optional<int64_t> number = each ? each->getConstant() : std::nullopt;
      if (number != (d == axis ? depth : 0))
        return;
    }
  std::optional<Form> trips = forms.countTrips(loop);
  std::optional<int64_t> count = trips ? trips->getConstant() : std::nullopt;
  bool isWhole = count && *count % steps == 0;
  if (whole && !isWhole)
    return;
  Builder b(loop.getContext());
  if (!isWhole)
    for (auto [load, axis] : loads)
      load->setAttr(attr::merged, b.getDenseI64ArrayAttr({axis, depth}));
  setShape(product.getA(), !product.getTransposeA(), fastDepth);
  setShape(product.getB(), product.getTransposeB(), fastDepth);
  OpBuilder before(loop);
  loop.setStep(arith::ConstantOp::create(before, loop.getLoc(),
                                         b.getI32IntegerAttr(steps)));
}

//===----------------------------------------------------------------------===//
// Copy engine
//===----------------------------------------------------------------------===//

/// Whether nothing in the kernel may write to an array. What is written there
/// goes another way than what the copy engine reads.
static bool isOnlyRead(FunctionOpInterface kernel, Value array) {
  ArrayOrigins origins(kernel, getVariant(kernel).getDisjoint());
  bool isRead = true;
  kernel->walk([&](Operation *op) {
    if (isa<TileStoreOp, TileAtomicOp>(op))
      isRead &= !origins.mayAlias(op->getOperand(1), array);
    else if (auto access = dyn_cast<AccessOp>(op))
      isRead &=
          !access.mayWrite() || !origins.mayAlias(access.getArray(), array);
    else if (!computesTiles(op) && op->getNumRegions() == 0)
      isRead &= isMemoryEffectFree(op);
  });
  return isRead;
}

/// Whether launches can describe the array to the copy engine, whose boxes have
/// at most 256 rows.
static bool canCopyBoxes(FunctionOpInterface kernel, TileLoadOp load) {
  constexpr int64_t mostRows = 256;
  auto array = dyn_cast<BlockArgument>(load.getArray());
  return array && array.getOwner() == &kernel.getFunctionBody().front() &&
         tileType(load.getResult()).getShape()[0] <= mostRows &&
         !kernel->hasAttr(warp::attr::argTypes) &&
         !getVariant(kernel).isDeterministic() && isOnlyRead(kernel, array);
}

/// Makes a load that of the copy engine.
static void copyBoxes(FunctionOpInterface kernel, TileLoadOp load) {
  Builder b(kernel.getContext());
  ParameterLayout layout = layOutParameters(kernel.getArgumentTypes());
  SmallVector<Attribute> maps;
  if (auto list = kernel->getAttrOfType<ArrayAttr>(warp::attr::tensorMaps))
    llvm::append_range(maps, list);
  int64_t place = llvm::alignTo(layout.size, tensorMapAlignment) +
                  tensorMapBytes * maps.size();
  auto array = cast<BlockArgument>(load.getArray());
  ArrayRef<int64_t> shape = tileType(load.getResult()).getShape();
  maps.push_back(
      b.getDenseI64ArrayAttr({layout.offsets[array.getArgNumber()], place,
                              shape[0], std::min<int64_t>(shape[1], 64)}));
  kernel->setAttr(warp::attr::tensorMaps, b.getArrayAttr(maps));
  load->setAttr(attr::map, b.getI64IntegerAttr(place));
}

void planLoads(FunctionOpInterface kernel, scf::ForOp loop,
               TileMatmulOp product) {
  // Shorter rows are worth more to merge than to copy in boxes.
  constexpr int64_t leastDepth = 32;
  FactorLoads loads = loadsOf(product);
  bool inBoxes = llvm::all_of(loads, [&](const FactorLoad &load) {
    return canCopyBoxes(kernel, load.op);
  });
  mergeSteps(loop, product, /*whole=*/inBoxes);
  int64_t depth = tileType(product.getA()).getShape()[!product.getTransposeA()];
  if (!inBoxes)
    return;
  if (depth < leastDepth)
    return mergeSteps(loop, product, /*whole=*/false);
  for (const FactorLoad &load : loads)
    copyBoxes(kernel, load.op);
  loads.front().op->setAttr(attr::ring, UnitAttr::get(kernel.getContext()));
}

} // namespace warp::tiles
