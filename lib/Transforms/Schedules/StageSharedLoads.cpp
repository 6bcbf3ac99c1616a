//===- StageSharedLoads.cpp - Uniform loads through shared memory ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// In a loop over all particles every thread of a GPU loads particle j in
// iteration j. The lanes of a warp wait for the same address, hundreds of
// cycles where it has to come from far, and again in the next iterations. So a
// warp works in tiles of 32 iterations. Lane l loads what iteration l of the
// next tile needs, all lanes leave that in a slab of shared memory that belongs
// to their warp, and each iteration takes its element from there:
//
//   loaded = x[first + lane]
//   for tile = first to end step 32:
//     slab[lane] = loaded                  (the warp waits before and after)
//     loaded = x[tile + 32 + lane]         (on the way during the iterations)
//     for step = 0 to 32:
//       the iteration tile + step, with slab[step] for x[tile + step]
//   for the rest: the loop as it was
//
// The iterations keep their order. Needed are bounds and arrays that are the
// same for the warp, and a loop that does nothing to memory but load. A warp
// with a lane missing goes through no tile.
//
// Runs after warp-rotate-loops: a loop with updates is its business.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ThreadVariance.h"
#include "Choices.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "Launch/UnrollLoop.h"

#include "WarpDialect/TilePasses.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

namespace warp {
#define GEN_PASS_DEF_STAGELOADS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// Iterations of a tile.
constexpr int64_t tileSize = warp::warpSize;
/// Loops with fewer have no time to gain.
constexpr int64_t fewestTrips = 2 * tileSize;
/// Bytes of all elements that one iteration takes from the slab.
constexpr int64_t mostBytes = 64;
/// Iterations of a tile that are copies in the code.
constexpr int64_t copies = 8;

namespace {

/// A load of one element per iteration, the same for the warp.
struct Staged {
  warp::LoadComponentsOp load;
  /// Where its elements begin in the slab.
  int64_t offset = 0, elementSize = 0;
};

/// Puts tiles in front of one loop.
class LoadStage {
public:
  LoadStage(scf::ForOp loop, LLVM::LLVMFuncOp entry,
            const warp::ThreadVariance &variance)
      : loop(loop), entry(entry), variance(variance), b(loop),
        loc(loop.getLoc()) {}

  bool qualifies();
  void build();

private:
  bool isUniform(Value value);
  void collect(warp::LoadComponentsOp load);
  bool isShort();

  void buildSlab();
  void buildTiles(Value end);
  Value endOfTiles();
  SmallVector<Value> loadAhead(Value first);
  void fillSlab(ValueRange loaded);
  SmallVector<Value> buildStep(Value tile, Value step, ValueRange carried);
  Value slot(Staged &staged, Value number, int64_t component);

  Value constant(Type type, int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  Value constant(int64_t value) { return constant(b.getI32Type(), value); }
  Value add(Value x, Value y) { return arith::AddIOp::create(b, loc, x, y); }
  Type counterType() { return loop.getInductionVar().getType(); }
  Value widen(Value number) {
    if (counterType() == number.getType())
      return number;
    return arith::ExtUIOp::create(b, loc, counterType(), number);
  }

  scf::ForOp loop;
  LLVM::LLVMFuncOp entry;
  const warp::ThreadVariance &variance;
  OpBuilder b;
  Location loc;
  SmallVector<Staged> stages;
  int64_t bytes = 0;
  /// What lanes must agree on for bounds and arrays to be the same.
  llvm::SetVector<Value> compared;
  Value lane, slab;
};

} // namespace

//===----------------------------------------------------------------------===//
// Loops that qualify
//===----------------------------------------------------------------------===//

/// Whether a value is the same for the warp, and in all iterations.
bool LoadStage::isUniform(Value value) {
  return variance.strideIfEqual(value, loop, compared) == 0;
}

void LoadStage::collect(warp::LoadComponentsOp load) {
  int64_t size = 0;
  for (Type type : load.getResultTypes()) {
    if (!type.isIntOrFloat())
      return;
    unsigned width = type.getIntOrFloatBitWidth();
    if (width != 32 && width != 64)
      return;
    size += width / 8;
  }
  if (bytes + size > mostBytes || !isUniform(load.getArray()) ||
      !llvm::all_of(load.getIndices().drop_back(),
                    [&](Value index) { return isUniform(index); }) ||
      variance.strideIfEqual(load.getIndices().back(), loop, compared) != 1)
    return;
  stages.push_back({load, tileSize * bytes, size});
  bytes += size;
}

bool LoadStage::isShort() {
  APInt first, last;
  return matchPattern(loop.getLowerBound(), m_ConstantInt(&first)) &&
         matchPattern(loop.getUpperBound(), m_ConstantInt(&last)) &&
         last.getSExtValue() - first.getSExtValue() < fewestTrips;
}

bool LoadStage::qualifies() {
  if (!matchPattern(loop.getStep(), m_One()) || isShort() ||
      !isa<IntegerType>(counterType()) ||
      counterType().getIntOrFloatBitWidth() < 32 ||
      !isUniform(loop.getLowerBound()) || !isUniform(loop.getUpperBound()))
    return false;
  WalkResult result = loop.getBody()->walk([&](Operation *op) {
    bool isSimple = isa<warp::LoadComponentsOp>(op) ||
                    op->hasTrait<OpTrait::HasRecursiveMemoryEffects>() ||
                    isMemoryEffectFree(op);
    return isSimple && !isa<LoopLikeOpInterface>(op) ? WalkResult::advance()
                                                     : WalkResult::interrupt();
  });
  if (result.wasInterrupted())
    return false;
  for (auto load : loop.getBody()->getOps<warp::LoadComponentsOp>())
    collect(load);
  return !stages.empty();
}

//===----------------------------------------------------------------------===//
// Tiles
//===----------------------------------------------------------------------===//

/// The part of the shared memory that belongs to this warp.
void LoadStage::buildSlab() {
  auto module = entry->getParentOfType<ModuleOp>();
  int64_t warps =
      llvm::divideCeil(warp::getVariant(entry).getBlock(), warp::warpSize);
  int64_t slabSize = tileSize * bytes;
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(), warps * slabSize);
  Value shared = warp::makeShared(b, loc, module, type, "load_slabs");
  StringRef name = shared.getDefiningOp<LLVM::AddressOfOp>().getGlobalName();
  module.lookupSymbol<LLVM::GlobalOp>(name).setAlignment(16);
  Value number =
      arith::ShRUIOp::create(b, loc, warp::threadInBlock(b, loc), constant(5));
  Value offset = arith::MulIOp::create(b, loc, number, constant(slabSize));
  slab = LLVM::GEPOp::create(b, loc, shared.getType(), b.getI8Type(), shared,
                             ArrayRef<LLVM::GEPArg>(offset));
}

/// The first iteration that is in no full tile, or that a warp with a lane
/// missing begins with.
Value LoadStage::endOfTiles() {
  Value first = loop.getLowerBound(), last = loop.getUpperBound();
  Value any =
      arith::CmpIOp::create(b, loc,
                            loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                                  : arith::CmpIPredicate::slt,
                            first, last);
  Value trips = arith::SubIOp::create(b, loc, last, first);
  trips =
      arith::AndIOp::create(b, loc, trips, constant(counterType(), -tileSize));
  Value together = warp::isWarpTogether(b, loc, compared.getArrayRef());
  Value both = arith::AndIOp::create(b, loc, any, together);
  trips =
      arith::SelectOp::create(b, loc, both, trips, constant(counterType(), 0));
  return add(first, trips);
}

/// Address of a component of an element in the slab.
Value LoadStage::slot(Staged &staged, Value number, int64_t component) {
  int64_t before = staged.offset;
  for (Value result : staged.load.getResults().take_front(component))
    before += result.getType().getIntOrFloatBitWidth() / 8;
  Type element = LLVM::LLVMArrayType::get(b.getI8Type(), staged.elementSize);
  Value start = LLVM::GEPOp::create(b, loc, slab.getType(), element, slab,
                                    ArrayRef<LLVM::GEPArg>(number));
  return LLVM::GEPOp::create(b, loc, slab.getType(), b.getI8Type(), start,
                             ArrayRef<LLVM::GEPArg>(int32_t(before)));
}

/// What this lane loads of the tile that begins at `first`.
SmallVector<Value> LoadStage::loadAhead(Value first) {
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

void LoadStage::fillSlab(ValueRange loaded) {
  warp::synchronizeWarp(b, loc);
  size_t next = 0;
  for (Staged &staged : stages)
    for (size_t i = 0, end = staged.load.getNumResults(); i < end; ++i) {
      Value value = loaded[next++];
      LLVM::StoreOp::create(b, loc, value, slot(staged, lane, i),
                            value.getType().getIntOrFloatBitWidth() / 8);
    }
  warp::synchronizeWarp(b, loc);
}

/// One iteration with what the slab has for it.
SmallVector<Value> LoadStage::buildStep(Value tile, Value step,
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

/// The loop over tiles, with what it carries and what was loaded ahead.
void LoadStage::buildTiles(Value end) {
  SmallVector<Value> inits(loop.getInitArgs());
  size_t count = inits.size();
  llvm::append_range(inits, loadAhead(loop.getLowerBound()));
  auto tiles = scf::ForOp::create(b, loc, loop.getLowerBound(), end,
                                  constant(counterType(), tileSize), inits,
                                  nullptr, loop.getUnsignedCmp());
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(tiles.getBody());
  Value tile = tiles.getInductionVar();
  fillSlab(tiles.getRegionIterArgs().drop_front(count));
  Value next = add(tile, constant(counterType(), tileSize));
  Value isLast =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, next, end);
  next = arith::SelectOp::create(b, loc, isLast, tile, next);
  SmallVector<Value> loaded = loadAhead(next);
  auto steps =
      scf::ForOp::create(b, loc, constant(0), constant(tileSize), constant(1),
                         tiles.getRegionIterArgs().take_front(count));
  warp::setCopies(steps, copies);
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

void LoadStage::build() {
  lane = warp::readGrid(b, loc, warp::GridValue::laneId);
  buildSlab();
  Value end = endOfTiles();
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

namespace {

struct StageLoads : warp::impl::StageLoadsBase<StageLoads> {
  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry || entry->hasAttr(warp::attr::blockThreads) ||
        !warp::isGpu(entry) || warp::getVariant(entry).getDebug() ||
        !warp::getVariant(entry).hasWholeWarps())
      return;
    SmallVector<scf::ForOp> loops;
    entry.walk([&](scf::ForOp loop) { loops.push_back(loop); });
    std::optional<warp::ThreadVariance> variance;
    for (scf::ForOp loop : loops) {
      if (loop.getBody()->getOps<warp::LoadComponentsOp>().empty())
        continue;
      if (!variance)
        variance.emplace(entry);
      LoadStage stage(loop, entry, *variance);
      if (!stage.qualifies())
        continue;
      warp::noteChoice(entry, "loop", "tiles of " + Twine(tileSize),
                       "a warp loads for all of its lanes", loop);
      stage.build();
      variance.reset();
    }
  }
};

} // namespace
