//===- PlanLoads.cpp - K-step and pipeline stages of products -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Chooses the K-step of software-pipelined matmul loops on GPUs of compute
// capability 9.0: rows of 128 bytes load fastest, so a loop takes as many steps
// at a time as make such rows. TMA loads them where it can
// (lib/DeviceLib/nvidia/TileRings.h); then no thread computes addresses.
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

static int64_t fastDepthOf(TileMatmulOp product) {
  return fastBytes / getByteSize(tileType(product.getA()).getElementType());
}

//===----------------------------------------------------------------------===//
// Steps
//===----------------------------------------------------------------------===//

/// Lets the loop take several steps at a time, if they follow each other in the
/// arrays; `whole`: only if there are none left then.
static void mergeSteps(scf::ForOp loop, TileMatmulOp product, bool whole) {
  int64_t depth = depthOf(product), fastDepth = fastDepthOf(product);
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
      setLayout(load, getLayout(load).withMerged(axis, depth));
  setShape(product.getA(), !product.getTransposeA(), fastDepth);
  setShape(product.getB(), product.getTransposeB(), fastDepth);
  OpBuilder before(loop);
  loop.setStep(arith::ConstantOp::create(before, loop.getLoc(),
                                         b.getI32IntegerAttr(steps)));
}

//===----------------------------------------------------------------------===//
// TMA
//===----------------------------------------------------------------------===//

/// True if nothing in the kernel may write to an array: TMA reads through the
/// asynchronous proxy, which does not see those writes.
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

int64_t getTmaBoxColumns(TileLoadOp load) {
  TileType type = tileType(load.getResult());
  int64_t columns = type.getShape()[1];
  return getLayout(load).getSwizzled()
             ? std::min(columns,
                        fastBytes / int64_t(getByteSize(type.getElementType())))
             : columns;
}

/// True if launches can make a tensor map of the array. A box has at most 256
/// rows and columns.
static bool canLoadByTma(FunctionOpInterface kernel, TileLoadOp load) {
  constexpr int64_t most = 256;
  auto array = dyn_cast<BlockArgument>(load.getArray());
  return array && array.getOwner() == &kernel.getFunctionBody().front() &&
         tileType(load.getResult()).getShape()[0] <= most &&
         getTmaBoxColumns(load) <= most &&
         !kernel->hasAttr(warp::attr::argTypes) &&
         !getVariant(kernel).isDeterministic() && isOnlyRead(kernel, array);
}

/// True if boxes of a loop are equally far apart from step to step.
static bool hasConstantStep(scf::ForOp loop, TileLoadOp load) {
  Forms forms;
  Symbol trip = Symbol::trip(loop);
  return llvm::all_of(load.getOffsets(), [&](Value offset) {
    Form form = forms.of(offset);
    std::optional<Form> each = form.coefficientOf(trip);
    return each && each->isDefinedOutside(loop) &&
           form.without(trip).isDefinedOutside(loop);
  });
}

/// Makes a load one by TMA, with a tensor map.
static void loadByTma(FunctionOpInterface kernel, TileLoadOp load,
                      bool holdsBarriers) {
  Builder b(kernel.getContext());
  ParameterLayout layout = layOutParameters(kernel.getArgumentTypes());
  SmallVector<Attribute> maps;
  if (auto list = kernel->getAttrOfType<ArrayAttr>(warp::attr::tensorMaps))
    llvm::append_range(maps, list);
  int64_t place = llvm::alignTo(layout.size, tensorMapAlignment) +
                  tensorMapBytes * maps.size();
  auto array = cast<BlockArgument>(load.getArray());
  TileType type = tileType(load.getResult());
  int64_t columns = getTmaBoxColumns(load),
          bytes = getByteSize(type.getElementType());
  maps.push_back(b.getDenseI64ArrayAttr(
      {layout.offsets[array.getArgNumber()], place, type.getShape()[0], columns,
       bytes, getLayout(load).getSwizzled() ? columns * bytes : 0}));
  kernel->setAttr(warp::attr::tensorMaps, b.getArrayAttr(maps));
  setLayout(load, getLayout(load).withTensorMap(place, holdsBarriers));
}

/// True if the depth is worth TMA: shorter rows of halves are faster merged,
/// and other elements are read in rows of 128 bytes.
static bool isDeepEnough(TileMatmulOp product) {
  constexpr int64_t leastDepth = 32;
  int64_t depth = depthOf(product);
  return getProductForm(product)->isByWarpgroups()
             ? depth >= leastDepth
             : depth % fastDepthOf(product) == 0;
}

void planLoads(FunctionOpInterface kernel, scf::ForOp loop,
               TileMatmulOp product) {
  bool byWarpgroups = getProductForm(product)->isByWarpgroups();
  if (!byWarpgroups &&
      (!getTarget(kernel).has(Feature::TensorMaps) || subtracts(product) ||
       !tileType(product.getA()).getElementType().isF32()))
    return;
  FactorLoads loads = loadsOf(product);
  // Threads read single numbers across the depth in runs, wherever they lie.
  for (const FactorLoad &load : loads)
    if (byWarpgroups || load.axis == 1)
      setLayout(load.op, getLayout(load.op).withSwizzle(true));
  bool byTma = llvm::all_of(loads, [&](const FactorLoad &load) {
    return canLoadByTma(kernel, load.op) && hasConstantStep(loop, load.op);
  });
  if (byTma || byWarpgroups)
    mergeSteps(loop, product, /*whole=*/byTma);
  if (byTma && isDeepEnough(product)) {
    for (const auto &[i, load] : llvm::enumerate(loads))
      loadByTma(kernel, load.op, /*holdsBarriers=*/i == 0);
    return;
  }
  if (byWarpgroups && byTma)
    return mergeSteps(loop, product, /*whole=*/false);
  if (!byWarpgroups)
    for (const FactorLoad &load : loads)
      setLayout(load.op, getLayout(load.op).withSwizzle(false));
}

} // namespace warp::tiles
