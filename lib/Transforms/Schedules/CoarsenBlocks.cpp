//===- CoarsenBlocks.cpp - Block coarsening of matrix products ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Neighbouring blocks of a matrix product load the same rows of one factor.
// If block j has columns [T j, T j + T) of the other factor and of the
// result, and does nothing else with j, one block of as many threads can
// compute the columns of several: tiles become wider, and each element is
// computed as before. Threads hold more accumulators then, and read less shared
// memory for each.
//
//   for k:                              for k:
//     x = tile_load a[i, k]               x = tile_load a[i, k]
//     y = tile_load b[k, T j]  64 x 64    y = tile_load b[k, 2 T j]  64 x 128
//     s = x y + s              64 x 64    s = x y + s                64 x 128
//   tile_store s, c[i, T j]             tile_store s, c[i, 2 T j]
//
// The launch has fewer blocks, so it is for those that fill the GPU all the
// same
// (`max_block_coarsening`).
//
//===----------------------------------------------------------------------===//

#include "Schedules.h"

#include "Analysis/Forms.h"
#include "Tiles/LowerTiles.h"
#include "Tiles/TileProducts.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"
#include "warp/Schedule.h"

#include "llvm/ADT/MapVector.h"
#include "llvm/ADT/TypeSwitch.h"

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

namespace {

/// Most rows and columns of TMA tiles and of instructions.
constexpr int64_t mostExtent = 256;
/// Accumulators that a thread can hold: of matrix instructions, and of FMAs.
constexpr int64_t mostSums = 128, mostOwnSums = 64;
constexpr int64_t mostBlocks = 4;
/// Bytes of shared memory, so that there is room for pipeline stages.
constexpr int64_t mostBytes = 128 * 1024;

class CoarsenBlocks : public LaunchRewrite {
public:
  explicit CoarsenBlocks(ScheduleSite &site)
      : LaunchRewrite(site), kernel(site.function),
        dimension(site.variant.getRank() - 2) {}

  bool applies() override;
  bool profit() override;
  void rewrite() override;
  Description describe(bool isMade) override {
    if (!isMade)
      return {"block_coarsening", "1", "fewer blocks would not fill the GPU"};
    return {"block_coarsening", std::to_string(factor),
            "wider tiles read less shared memory for each sum"};
  }
  int sizeFacts() const override { return maxBlockCoarseningFact; }

private:
  bool canMerge();
  /// Blocks to merge, of at most so many.
  int64_t chooseFactor(int64_t most) const;
  bool findWindows();
  bool findWindow(OpOperand &use, int64_t extent);
  /// Tiles that become wider along an axis.
  void mark(Value tile, int64_t axis);
  bool spread();
  bool spreadToOperands(Value tile, int64_t axis);
  bool spreadToUser(OpOperand &use, int64_t axis);
  void markCarried(scf::ForOp loop, unsigned number, int64_t axis);
  bool markMap(TileMapOp op, int64_t axis);
  bool isAllowed(Operation *op) const;
  bool isFactor(Value tile) const;
  int64_t countWideBytes() const;
  bool isGood(TileMatmulOp op, int64_t factor) const;
  bool isMarked(Value tile, int64_t axis) const {
    auto known = axes.find(tile);
    return known != axes.end() && known->second == axis;
  }

  FunctionOpInterface kernel;
  int64_t threads = 0, factor = 1;
  /// The last dimension of blocks.
  int64_t dimension;
  /// T j, and T.
  SmallVector<std::pair<MulOp, int64_t>> starts;
  llvm::MapVector<Value, int64_t> axes;
  SmallVector<Value> open;
  /// Loads and stores at T j.
  llvm::DenseSet<Operation *> windows;
  SmallVector<TileMatmulOp> products;
  /// No tile has two axes along which it would become wider.
  bool agree = true;
};

} // namespace

//===----------------------------------------------------------------------===//
// Analysis
//===----------------------------------------------------------------------===//

void CoarsenBlocks::mark(Value tile, int64_t axis) {
  auto [entry, isNew] = axes.insert({tile, axis});
  agree &= entry->second == axis;
  if (isNew)
    open.push_back(tile);
}

/// The axis at which an operation's window begins at an offset, if it is that
/// long there.
template <typename Op>
static std::optional<int64_t> axisOf(Op op, TileType tile, OpOperand &use,
                                     int64_t extent) {
  std::optional<int64_t> axis;
  for (auto [d, offset] : llvm::enumerate(op.getOffsets())) {
    if (offset != use.get())
      continue;
    if (axis || tile.getShape()[d] != extent)
      return std::nullopt;
    axis = d;
  }
  return op.getPicked() ? std::nullopt : axis;
}

bool CoarsenBlocks::findWindow(OpOperand &use, int64_t extent) {
  Operation *op = use.getOwner();
  Value tile;
  std::optional<int64_t> axis;
  if (auto load = dyn_cast<TileLoadOp>(op)) {
    tile = load.getResult();
    axis = axisOf(load, tileType(tile), use, extent);
  } else if (auto store = dyn_cast<TileStoreOp>(op)) {
    tile = store.getTile();
    axis = axisOf(store, tileType(tile), use, extent);
  } else if (auto update = dyn_cast<TileAtomicOp>(op)) {
    tile = update.getTile();
    if (update.getOld().use_empty())
      axis = axisOf(update, tileType(tile), use, extent);
    if (axis)
      mark(update.getOld(), *axis);
  }
  if (!axis)
    return false;
  windows.insert(op);
  mark(tile, *axis);
  return true;
}

bool CoarsenBlocks::findWindows() {
  SmallVector<Value> numbers;
  kernel->walk([&](TidOp tid) {
    if (int64_t(tid.getNumResults()) > dimension)
      numbers.push_back(tid.getResult(dimension));
  });
  for (Value number : numbers)
    for (Operation *user : number.getUsers()) {
      auto start = dyn_cast<MulOp>(user);
      if (!start)
        return false;
      bool isFirst = start->getOperand(0) == number;
      auto extent = getConstantInteger(start->getOperand(isFirst ? 1 : 0));
      if (!extent)
        return false;
      starts.push_back({start, *extent});
      for (OpOperand &use : start->getUses())
        if (!findWindow(use, *extent))
          return false;
    }
  return !starts.empty();
}

void CoarsenBlocks::markCarried(scf::ForOp loop, unsigned number,
                                int64_t axis) {
  mark(loop.getInitArgs()[number], axis);
  mark(loop.getRegionIterArgs()[number], axis);
  mark(loop.getYieldedValues()[number], axis);
  mark(loop.getResult(number), axis);
}

bool CoarsenBlocks::markMap(TileMapOp op, int64_t axis) {
  for (Value value : llvm::concat<Value>(SmallVector<Value>(op.getInputs()),
                                         SmallVector<Value>(op.getResults())))
    if (isTile(value))
      mark(value, axis);
    else if (!value.getDefiningOp<ConstantOp>())
      return false; // may differ between threads, and elements change theirs
  return true;
}

bool CoarsenBlocks::spreadToOperands(Value tile, int64_t axis) {
  Operation *def = tile.getDefiningOp();
  if (!def) {
    auto loop = dyn_cast<scf::ForOp>(tile.getParentBlock()->getParentOp());
    if (loop)
      markCarried(loop, cast<BlockArgument>(tile).getArgNumber() - 1, axis);
    return loop != nullptr;
  }
  return llvm::TypeSwitch<Operation *, bool>(def)
      .Case<TileLoadOp, TileAtomicOp>(
          [&](Operation *op) { return windows.contains(op); })
      .Case([&](TileSplatOp op) {
        return op.getValue().getDefiningOp<ConstantOp>() != nullptr;
      })
      .Case([&](TileTransposeOp op) {
        mark(op.getTile(), op.getAxes()[axis]);
        return true;
      })
      .Case([&](TileMapOp op) { return markMap(op, axis); })
      .Case([&](scf::ForOp op) {
        markCarried(op, cast<OpResult>(tile).getResultNumber(), axis);
        return true;
      })
      .Case([&](TileMatmulOp op) {
        if (op.getC())
          mark(op.getC(), axis);
        return true;
      })
      .Default(false);
}

bool CoarsenBlocks::spreadToUser(OpOperand &use, int64_t axis) {
  return llvm::TypeSwitch<Operation *, bool>(use.getOwner())
      .Case<TileStoreOp, TileAtomicOp>(
          [&](Operation *op) { return windows.contains(op); })
      .Case([&](TileTransposeOp op) {
        for (auto [to, from] : llvm::enumerate(op.getAxes()))
          if (from == axis)
            mark(op.getResult(), to);
        return true;
      })
      .Case([&](TileMapOp op) { return markMap(op, axis); })
      .Case([&](scf::ForOp op) {
        markCarried(op, use.getOperandNumber() - op.getNumControlOperands(),
                    axis);
        return true;
      })
      .Case([&](scf::YieldOp op) {
        auto loop = dyn_cast<scf::ForOp>(op->getParentOp());
        if (loop)
          markCarried(loop, use.getOperandNumber(), axis);
        return loop != nullptr;
      })
      .Case([&](TileMatmulOp op) {
        // Columns of the second factor, or what is added to.
        if (use.get() == op.getA() ||
            (use.get() == op.getB() && axis != !op.getTransposeB()))
          return false;
        mark(op.getResult(), 1);
        return use.get() != op.getC() || axis == 1;
      })
      .Default(false);
}

bool CoarsenBlocks::spread() {
  while (!open.empty()) {
    Value tile = open.pop_back_val();
    int64_t axis = axes[tile];
    if (!spreadToOperands(tile, axis))
      return false;
    for (OpOperand &use : tile.getUses())
      if (!spreadToUser(use, axis))
        return false;
  }
  return agree;
}

/// True if one block does once what several blocks do.
bool CoarsenBlocks::isAllowed(Operation *op) const {
  if (isa<TileStoreOp, TileAtomicOp>(op))
    return windows.contains(op);
  if (auto product = dyn_cast<TileMatmulOp>(op))
    return isMarked(product.getResult(), 1) &&
           isMarked(product.getB(), !product.getTransposeB());
  if (op->getParentOfType<TileMapOp>())
    return isMemoryEffectFree(op) &&
           llvm::all_of(op->getOperands(), [&](Value operand) {
             return isa<BlockArgument>(operand) ||
                    op->getParentOfType<TileMapOp>()->isAncestor(
                        operand.getDefiningOp()) ||
                    operand.getDefiningOp<ConstantOp>();
           });
  return isa<TileLoadOp, TileMapOp, scf::ForOp, scf::YieldOp>(op) ||
         (op->getNumRegions() == 0 &&
          (op->hasTrait<OpTrait::IsTerminator>() || isMemoryEffectFree(op)));
}

bool CoarsenBlocks::canMerge() {
  if (dimension < 0 || !findWindows() || !spread())
    return false;
  bool isAdded = false;
  WalkResult result = kernel.getFunctionBody().walk([&](Operation *op) {
    if (auto product = dyn_cast<TileMatmulOp>(op)) {
      products.push_back(product);
      isAdded |= isa<scf::ForOp>(op->getParentOp()) && product.getC();
    }
    return isAllowed(op) ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted() && isAdded;
}

/// Bytes of what is as large as the result and not held as sums alone: loaded
/// tiles, what functions of elements make, and then sums as well.
int64_t CoarsenBlocks::countWideBytes() const {
  int64_t bytes = 0;
  for (auto [tile, axis] : axes)
    if (isa_and_nonnull<TileMapOp>(tile.getDefiningOp()) ||
        (tile.getDefiningOp<TileLoadOp>() && !isFactor(tile)))
      bytes += getTileBytes(tileType(tile));
  if (bytes != 0)
    for (TileMatmulOp op : products)
      bytes += getTileBytes(tileType(op.getResult()));
  return bytes;
}

/// True if a tile, or its transpose, is the second factor of a product.
bool CoarsenBlocks::isFactor(Value tile) const {
  return llvm::all_of(tile.getUses(), [&](OpOperand &use) {
    if (auto transpose = dyn_cast<TileTransposeOp>(use.getOwner()))
      return isFactor(transpose.getResult());
    auto product = dyn_cast<TileMatmulOp>(use.getOwner());
    return product && use.get() == product.getB();
  });
}

/// True if registers hold the accumulators of so many blocks, and shared memory
/// at least one pipeline stage ahead.
bool CoarsenBlocks::isGood(TileMatmulOp op, int64_t factor) const {
  const TargetInfo &target = site.target;
  TileType type = tileType(op.getResult());
  Type element = tileType(op.getA()).getElementType();
  int64_t rows = type.getShape()[0], columns = type.getShape()[1] * factor;
  int64_t sums = rows * columns / threads;
  int64_t rowBytes =
      std::max<int64_t>(depthOf(op) * getByteSize(element), fastBytes);
  int64_t stage = (rows + columns) * rowBytes;
  if (rows > mostExtent || columns > mostExtent ||
      2 * stage + factor * countWideBytes() > mostBytes ||
      !findProductForm(op, threads, target))
    return false;
  if (element.isF32())
    return sums <= mostOwnSums && rows % 8 == 0 && columns % 8 == 0;
  return sums <= mostSums && findWarpgroupForm(op, threads, target) &&
         hasWarpgroupPatch({rows, columns}, threads);
}

int64_t CoarsenBlocks::chooseFactor(int64_t most) const {
  while (most > 1 && !llvm::all_of(products, [&](TileMatmulOp op) {
           return isGood(op, most);
         }))
    most /= 2;
  return most;
}

/// For kernels of blocks that work on tiles, without checks or open order.
bool CoarsenBlocks::applies() {
  auto found = kernel->getAttrOfType<IntegerAttr>(warp::attr::blockThreads);
  if (!found || kernel->hasAttr(warp::attr::ragged) ||
      site.variant.getDebug() || site.variant.isDeterministic() || !canMerge())
    return false;
  threads = found.getInt();
  return chooseFactor(mostBlocks) > 1;
}

bool CoarsenBlocks::profit() {
  factor = chooseFactor(site.variant.getMaxBlockCoarsening());
  return factor > 1;
}

//===----------------------------------------------------------------------===//
// Transformation
//===----------------------------------------------------------------------===//

void CoarsenBlocks::rewrite() {
  setSchedule(kernel, getSchedule(kernel).withBlockCoarsening(factor));
  for (auto [start, extent] : starts) {
    OpBuilder b(start);
    bool isFirst = getConstantInteger(start->getOperand(0)).has_value();
    OpOperand &known = start->getOpOperand(isFirst ? 0 : 1);
    auto attribute = b.getIntegerAttr(known.get().getType(), extent * factor);
    known.set(ConstantOp::create(b, start.getLoc(), known.get().getType(),
                                 attribute));
  }
  for (auto [tile, axis] : axes) {
    SmallVector<int64_t> shape(tileType(tile).getShape());
    shape[axis] *= factor;
    Value wide = tile;
    wide.setType(TileType::get(tile.getContext(), shape,
                               tileType(tile).getElementType()));
  }
}

WARP_MAKE_SCHEDULE(CoarsenBlocks)
