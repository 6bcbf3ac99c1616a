//===- StageSharedLoads.cpp - Uniform loads through shared memory ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop over all particles every thread of a GPU loads particle j in
// iteration j. All lanes of a warp wait for the same address, for the latency
// of memory, in each iteration. Software pipelining with tiles of 32 iterations
// hides that: lane l loads the elements that iteration l of the next tile
// needs, the warp stages them in shared memory of its own, and each iteration
// reads them from there:
//
//   loaded = x[first + lane]
//   for tile = first to end step 32:
//     staged[lane] = loaded                (the warp synchronizes around it)
//     loaded = x[tile + 32 + lane]         (in flight during the iterations)
//     for step = 0 to 32:
//       the iteration tile + step, with staged[step] for x[tile + step]
//   for the rest: the loop as it was
//
// The iterations keep their order. Bounds and arrays must be the same for the
// warp, and the loop has no effect on memory but loads. A warp with a lane
// missing runs no tile.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"
#include "LoopSchedule.h"

#include "Launch/UnrollLoop.h"
#include "WarpDialect/TilePasses.h"

using namespace mlir;
using namespace warp;

/// Bytes of all elements that are staged for one iteration.
constexpr int64_t mostBytes = 64;
/// Iterations of a tile that are unrolled.
constexpr int64_t copies = 8;

namespace {

/// A load of one element per iteration, the same for the warp.
struct Staged {
  LoadComponentsOp load;
  /// The offset of its elements in the memory of a warp.
  int64_t offset = 0, elementSize = 0;
};

class StageSharedLoads : public LoopSchedule {
public:
  using LoopSchedule::LoopSchedule;

  bool applies() override;
  void rewrite() override;
  Description describe(bool) override {
    return {"loop", "tiles of " + std::to_string(warpSize),
            "uniform loads staged through shared memory", loop};
  }

private:
  bool isUniform(Value value);
  void collect(LoadComponentsOp load);

  void allocate();
  void buildTiles(Value end);
  SmallVector<Value> loadAhead(Value first);
  void fill(ValueRange loaded);
  SmallVector<Value> buildStep(Value tile, Value step, ValueRange carried);
  Value slot(Staged &staged, Value number, int64_t component);

  SmallVector<Staged> stages;
  int64_t bytes = 0;
  /// Bytes of a lane that shared memory has room for.
  int64_t room = 0;
  /// Values that lanes must agree on for bounds and arrays to be the same.
  llvm::SetVector<Value> compared;
  Value lane, memory;
};

} // namespace

//===----------------------------------------------------------------------===//
// Loops that qualify
//===----------------------------------------------------------------------===//

/// True if a value is the same for the warp, and in all iterations.
bool StageSharedLoads::isUniform(Value value) {
  return site.getVariance().strideIfEqual(value, loop, compared) == 0;
}

void StageSharedLoads::collect(LoadComponentsOp load) {
  int64_t size = 0;
  for (Type type : load.getResultTypes()) {
    if (!type.isIntOrFloat())
      return;
    unsigned width = type.getIntOrFloatBitWidth();
    if (width != 32 && width != 64)
      return;
    size += width / 8;
  }
  if (bytes + size > room || !isUniform(load.getArray()) ||
      !llvm::all_of(load.getIndices().drop_back(),
                    [&](Value index) { return isUniform(index); }) ||
      site.getVariance().strideIfEqual(load.getIndices().back(), loop,
                                       compared) != 1)
    return;
  stages.push_back({load, warpSize * bytes, size});
  bytes += size;
}

bool StageSharedLoads::applies() {
  if (site.function->hasAttr(attr::blockThreads) || site.variant.getDebug() ||
      !site.variant.hasWholeWarps() ||
      loop.getBody()->getOps<LoadComponentsOp>().empty())
    return false;
  if (!hasWarpTiles(loop, site.getVariance(), compared) ||
      !llvm::all_of(*loop.getBody(), [](Operation &op) {
        return onlyLoads(op, /*loops=*/false);
      }))
    return false;
  int64_t warps = llvm::divideCeil(site.variant.getBlockDim(), warpSize);
  int64_t left = staticBlockBytes -
                 sharedBytes(site.function->getParentOfType<ModuleOp>());
  room = std::min(mostBytes, left / (warps * warpSize));
  for (auto load : loop.getBody()->getOps<LoadComponentsOp>())
    collect(load);
  return !stages.empty();
}

//===----------------------------------------------------------------------===//
// Tiles
//===----------------------------------------------------------------------===//

/// The part of the shared memory that belongs to this warp.
void StageSharedLoads::allocate() {
  auto module = site.function->getParentOfType<ModuleOp>();
  int64_t warps = llvm::divideCeil(site.variant.getBlockDim(), warpSize);
  int64_t warpBytes = warpSize * bytes;
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(), warps * warpBytes);
  Value shared = makeShared(b, loc, module, type, "staged_loads");
  StringRef name = shared.getDefiningOp<LLVM::AddressOfOp>().getGlobalName();
  module.lookupSymbol<LLVM::GlobalOp>(name).setAlignment(16);
  Value number = subgroupOf(b, loc, threadInBlock(b, loc));
  Value offset = arith::MulIOp::create(b, loc, number, constant(warpBytes));
  memory = LLVM::GEPOp::create(b, loc, shared.getType(), b.getI8Type(), shared,
                               ArrayRef<LLVM::GEPArg>(offset));
}

/// Address of a component of a staged element.
Value StageSharedLoads::slot(Staged &staged, Value number, int64_t component) {
  int64_t before = staged.offset;
  for (Value result : staged.load.getResults().take_front(component))
    before += result.getType().getIntOrFloatBitWidth() / 8;
  Type element = LLVM::LLVMArrayType::get(b.getI8Type(), staged.elementSize);
  Value start = LLVM::GEPOp::create(b, loc, memory.getType(), element, memory,
                                    ArrayRef<LLVM::GEPArg>(number));
  return LLVM::GEPOp::create(b, loc, memory.getType(), b.getI8Type(), start,
                             ArrayRef<LLVM::GEPArg>(int32_t(before)));
}

/// Loads the element of this lane of the tile that begins at `first`.
SmallVector<Value> StageSharedLoads::loadAhead(Value first) {
  SmallVector<Value> loaded;
  Value number = add(first, widen(lane));
  for (Staged &staged : stages) {
    IRMapping clones;
    clones.map(loop.getInductionVar(), number);
    for (Operation &op : loop.getBody()->without_terminator()) {
      Operation *load = staged.load;
      if (&op == load)
        break;
      if (isPure(&op) && op.getNumRegions() == 0 &&
          llvm::all_of(op.getResultTypes(),
                       [](Type type) { return type.isSignlessInteger(); }) &&
          llvm::all_of(op.getOperands(), [&](Value operand) {
            return loop.isDefinedOutsideOfLoop(operand) ||
                   clones.contains(operand);
          }))
        b.clone(op, clones);
    }
    Operation *copy = b.clone(*staged.load.getOperation(), clones);
    llvm::append_range(loaded, copy->getResults());
  }
  return loaded;
}

void StageSharedLoads::fill(ValueRange loaded) {
  synchronizeWarp(b, loc);
  size_t next = 0;
  for (Staged &staged : stages)
    for (size_t i = 0, end = staged.load.getNumResults(); i < end; ++i) {
      Value value = loaded[next++];
      LLVM::StoreOp::create(b, loc, value, slot(staged, lane, i),
                            value.getType().getIntOrFloatBitWidth() / 8);
    }
  synchronizeWarp(b, loc);
}

/// One iteration with its staged elements.
SmallVector<Value> StageSharedLoads::buildStep(Value tile, Value step,
                                               ValueRange carried) {
  IRMapping clones;
  clones.map(loop.getInductionVar(), add(tile, widen(step)));
  clones.map(loop.getRegionIterArgs(), carried);
  for (Operation &op : loop.getBody()->without_terminator()) {
    Staged *staged = llvm::find_if(
        stages, [&](Staged &one) { return one.load.getOperation() == &op; });
    if (staged == stages.end()) {
      b.clone(op, clones);
      continue;
    }
    for (auto [i, result] : llvm::enumerate(op.getResults()))
      clones.map(result, LLVM::LoadOp::create(
                             b, loc, result.getType(), slot(*staged, step, i),
                             result.getType().getIntOrFloatBitWidth() / 8));
  }
  SmallVector<Value> next;
  for (Value value : loop.getYieldedValues())
    next.push_back(clones.lookupOrDefault(value));
  return next;
}

/// The loop over tiles; carries the values of the loop and the loads ahead.
void StageSharedLoads::buildTiles(Value end) {
  SmallVector<Value> inits(loop.getInitArgs());
  size_t count = inits.size();
  llvm::append_range(inits, loadAhead(loop.getLowerBound()));
  auto tiles = scf::ForOp::create(b, loc, loop.getLowerBound(), end,
                                  constant(counterType(), warpSize), inits,
                                  nullptr, loop.getUnsignedCmp());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(tiles.getBody());
  Value tile = tiles.getInductionVar();
  fill(tiles.getRegionIterArgs().drop_front(count));
  Value next = add(tile, constant(counterType(), warpSize));
  Value isLast =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, next, end);
  next = arith::SelectOp::create(b, loc, isLast, tile, next);
  SmallVector<Value> loaded = loadAhead(next);
  auto steps =
      scf::ForOp::create(b, loc, constant(0), constant(warpSize), constant(1),
                         tiles.getRegionIterArgs().take_front(count));
  setCopies(steps, copies);
  b.setInsertionPointToStart(steps.getBody());
  SmallVector<Value> carried =
      buildStep(tile, steps.getInductionVar(), steps.getRegionIterArgs());
  if (count > 0)
    scf::YieldOp::create(b, loc, carried);
  b.setInsertionPointAfter(steps);
  SmallVector<Value> yielded(steps.getResults());
  llvm::append_range(yielded, loaded);
  scf::YieldOp::create(b, loc, yielded);
  b.setInsertionPointAfter(tiles);
  scf::YieldOp::create(b, loc, tiles.getResults().take_front(count));
}

void StageSharedLoads::rewrite() {
  lane = readGrid(b, loc, GridValue::laneId);
  allocate();
  Value end = endOfTiles(compared.getArrayRef(), warpSize);
  Value any = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, end,
                                    loop.getLowerBound());
  size_t count = loop.getNumResults();
  auto branch = scf::IfOp::create(b, loc, loop.getResultTypes(), any,
                                  /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(b);
  if (count == 0)
    branch.thenBlock()->getTerminator()->erase();
  b.setInsertionPointToStart(branch.thenBlock());
  buildTiles(end);
  b.setInsertionPointToStart(branch.elseBlock());
  if (count > 0)
    scf::YieldOp::create(b, loc, loop.getInitArgs());
  loop.getLowerBoundMutable().assign(end);
  loop.getInitArgsMutable().assign(branch.getResults());
}

WARP_MAKE_SCHEDULE(StageSharedLoads)
