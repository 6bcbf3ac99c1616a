//===- StageElements.cpp - Coalesced accesses of wide elements ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If neighbouring threads of a GPU access neighbouring elements, those of a
// warp are one stretch of memory. But one instruction moves one word of each,
// and these lie an element apart: a matrix of nine words is loaded by nine
// instructions that touch every line of the stretch, and stored in pieces of
// lines, at a quarter of the memory's bandwidth. So a warp shares the work.
// Thread l moves words l, l + 32, l + 64, ... of the stretch, and the threads
// exchange them in a slab of shared memory that belongs to their warp:
//
//   load    memory -> share -> slab -> element
//   store   element -> slab -> share -> memory
//
// This takes 32 threads whose elements follow each other. That indices do in a
// row of the launch is known here; that all threads are there is asked where
// the access is. The answer holds for the rest of a block of the IR. Where
// blocks have whole rows, a warp may have threads of several: there it compares
// addresses. A loop would access the same element again and again, which the
// cache is for.
//
// A warp that lacks some threads (the last one of a launch, a branch that some
// take) stores the stretch from the first to the last element that it has, and
// leaves out words of missing threads. Threads on the other side of a branch
// may do the same at that time: so each thread has a slot of the slab, of one
// size for all elements of the kernel, and barriers are those of the threads
// that came together. Where more than a quarter of the stretch is missing each
// thread stores its own element. It loads its own in any case: the first load
// brings lines to the cache of the multiprocessor, for the others to find.
//
// Threads with a row of elements each (`pose[world, body]`) do the same, in
// loops as well: the elements at one place in 32 rows are moved by groups of
// threads, one for each element, so that an instruction touches the lines of
// few rows. Here the threads compare the indices within the row. A launch of
// few warps waits for the memory's latency, to which an exchange adds, so its
// threads access their own elements.
//
// A thread's element is read and written by others, so barriers of the warp
// keep the order of its accesses: there is one before every staged access,
// which also frees the slab; one within, where share and element are exchanged;
// and one after it, since threads that part there would use their slots. Loads
// with nothing but arithmetic between them are in flight together.
//
// Here is what finds such accesses; ElementStage.cpp writes their code, and
// PartialStage.cpp that of warps that lack threads.
//
//===----------------------------------------------------------------------===//

#include "StageElements.h"

#include "Analysis/ThreadVariance.h"
#include "Choices.h"
#include "Emit/ArrayLowering.h"
#include "GpuBlock.h"
#include "KernelFunction.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Interfaces/DataLayoutInterfaces.h"
#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

/// Bytes of shared memory for the slabs of a block.
constexpr int64_t mostOfSlabs = 40 * 1024;
/// Registers of loads that are in flight together.
constexpr int64_t mostInFlight = 96;
/// Warps of a launch below which lines of rows are no limit: two for each
/// multiprocessor of a large card.
constexpr int64_t leastWarps = 256;

//===----------------------------------------------------------------------===//
// Indices
//===----------------------------------------------------------------------===//

/// True if an index is one more in the next thread of a row. Where it wraps
/// around, an access is out of bounds.
static bool followsThreads(Value index, const warp::ThreadVariance &variance) {
  return variance.step(index) == 1 && !variance.dependsOnMoment(index);
}

/// The only index that tells the threads of a row apart, if it does so by one
/// from thread to thread and the others are the same wherever threads are in
/// step.
static std::optional<unsigned>
findRowIndex(ValueRange indices, const warp::ThreadVariance &variance) {
  std::optional<unsigned> found;
  for (auto [dim, index] : llvm::enumerate(indices)) {
    if (variance.isUniform(index, warp::Scope::Lanes))
      continue;
    if (found || !followsThreads(index, variance))
      return std::nullopt;
    found = dim;
  }
  return found;
}

/// True if values are the same for the threads of a warp that lies in a row.
static bool areUniform(ValueRange values,
                       const warp::ThreadVariance &variance) {
  return llvm::all_of(values, [&](Value value) {
    return variance.agreement(value, warp::Scope::Lanes) ==
           warp::Agreement::Yes;
  });
}

/// True if an array is the same for all threads and has no gaps.
static bool isPacked(Value array, const warp::ThreadVariance &variance) {
  while (Operation *op = array.getDefiningOp()) {
    if (auto view = dyn_cast<warp::ViewOp>(op)) {
      if (!areUniform(view.getIndices(), variance))
        return false;
    } else if (!isa<warp::GradOp>(op)) {
      break;
    }
    array = op->getOperand(0);
  }
  auto parameter = array.getDefiningOp<warp::ParameterOp>();
  return parameter && parameter.getPacked();
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

static int64_t getWordSize(Type element) {
  return warp::getByteSize(warp::getElementScalar(element));
}

/// Bytes of the slab for elements of a type.
static int64_t getSlabSize(Type element, int64_t warpSize) {
  int64_t count = warp::getComponentCount(element);
  int64_t words = warpSize * count;
  words += words / warp::getSlabPeriod(count, warpSize) - 1;
  return llvm::alignTo(words * getWordSize(element), 8);
}

/// Bytes from one slot of a thread to the next, for an element of a type; an
/// odd number of words, so that threads are at different banks.
static int64_t getSlotSize(Type element) {
  int64_t unit = std::max<int64_t>(getWordSize(element), 4);
  int64_t size = warp::getComponentCount(element) * getWordSize(element);
  return unit * (llvm::divideCeil(size, unit) | 1);
}

/// Bytes of the slab for elements of rows.
static int64_t getRowSlabSize(Type element, int64_t warpSize) {
  int64_t pitch = warp::getRowPitch(warp::getComponentCount(element));
  return llvm::alignTo(warpSize * pitch * getWordSize(element), 8);
}

static Type getElement(Value array) {
  return cast<warp::ArrayType>(array.getType()).getElementType();
}

/// Components of which an instruction each moves one, with gaps that hardware
/// does not make up for; measured.
static int64_t fewestComponents(Type element) {
  return getWordSize(element) < 8 ? 5 : 4;
}

/// Components of an element that an access is about.
static int64_t countComponents(warp::LoadComponentsOp load) {
  return llvm::count_if(load.getComponents(),
                        [](Value component) { return !component.use_empty(); });
}

static int64_t countComponents(warp::StoreComponentsOp store) {
  return store.getComponents().size();
}

namespace {

/// Collects the accesses of one block of the IR after the other.
class Finder {
public:
  /// `mostBytes` is what the slab of one warp may have.
  Finder(LLVM::LLVMFuncOp entry, warp::StagedAccesses &staged,
         int64_t mostBytes)
      : entry(entry), staged(staged), mostBytes(mostBytes),
        warpSize(warp::getTarget(entry).getSubgroupSize()) {}

  void visit(Block &block);

  /// Bytes that the largest element found needs.
  int64_t slabSize = 0;

private:
  template <typename Op> bool canStage(Op access);
  bool isStretch(Value array, ValueRange indices, Block *block);
  template <typename Op> bool isOfRows(Op access);
  void visitLoad(warp::LoadComponentsOp load);

  LLVM::LLVMFuncOp entry;
  /// Once it is needed.
  std::optional<warp::ThreadVariance> variance;
  warp::StagedAccesses &staged;
  int64_t mostBytes, warpSize;
  /// The group that more loads may join.
  warp::LoadComponentsOp first;
  int64_t inFlight = 0;
};

} // namespace

/// True if elements at these indices follow each other in a warp.
bool Finder::isStretch(Value array, ValueRange indices, Block *block) {
  if (!variance)
    variance.emplace(entry);
  return isPacked(array, *variance) &&
         followsThreads(indices.back(), *variance) &&
         areUniform(indices.drop_back(), *variance) &&
         variance->isNonNegative(indices.back(), block);
}

/// True if each thread of a warp has an element of its own row, and notes which
/// index is that of the row.
template <typename Op> bool Finder::isOfRows(Op access) {
  Value array = access.getArray();
  ValueRange indices = access.getIndices();
  if (indices.size() < 2 ||
      warp::getComponentCount(getElement(array)) > warpSize)
    return false;
  if (!variance)
    variance.emplace(entry);
  std::optional<unsigned> row = findRowIndex(indices, *variance);
  if (!row || *row + 1 == indices.size() || !isPacked(array, *variance) ||
      !variance->isNonNegative(indices[*row], access->getBlock()))
    return false;
  staged.rows[access] = *row;
  return true;
}

template <typename Op> bool Finder::canStage(Op access) {
  Type element = getElement(access.getArray());
  if (!warp::isComposite(element) || getWordSize(element) < 2 ||
      warp::getComponentCount(element) < fewestComponents(element))
    return false;
  int64_t size =
      std::max(getSlabSize(element, warpSize), warpSize * getSlotSize(element));
  bool isSideBySide =
      size <= mostBytes &&
      countComponents(access) >= fewestComponents(element) &&
      !access->template getParentOfType<LoopLikeOpInterface>() &&
      isStretch(access.getArray(), access.getIndices(), access->getBlock());
  if (!isSideBySide) {
    size = getRowSlabSize(element, warpSize);
    // Words of rows are further apart, so fewer of them are worth it.
    if (size > mostBytes || countComponents(access) < 4 || !isOfRows(access))
      return false;
  }
  if (isSideBySide)
    staged.slotBytes = std::max(staged.slotBytes, getSlotSize(element));
  slabSize = std::max(slabSize, size);
  warp::noteChoice(access->template getParentOfType<LLVM::LLVMFuncOp>(),
                   "access", "words shared by a warp",
                   isSideBySide ? "elements are one stretch of memory"
                                : "elements are in rows of threads",
                   access);
  return true;
}

void Finder::visitLoad(warp::LoadComponentsOp load) {
  bool joins = first && llvm::all_of(load->getOperands(), [&](Value operand) {
                 Operation *op = operand.getDefiningOp();
                 return !op || op->getBlock() != first->getBlock() ||
                        op->isBeforeInBlock(first);
               });
  if (!canStage(load)) {
    if (joins)
      load->moveBefore(first);
    return;
  }
  if (staged.rows.contains(load)) {
    staged.loads[load] = {load};
    return;
  }
  int64_t registers =
      llvm::divideCeil(warp::getByteSize(getElement(load.getArray())), 4);
  if (!joins || inFlight + registers > mostInFlight) {
    first = load;
    inFlight = 0;
  }
  inFlight += registers;
  staged.loads[load];
  staged.loads[first].push_back(load);
}

void Finder::visit(Block &block) {
  first = nullptr;
  for (Operation &op : llvm::make_early_inc_range(block)) {
    if (auto load = dyn_cast<warp::LoadComponentsOp>(op)) {
      visitLoad(load);
      continue;
    }
    if (!isMemoryEffectFree(&op))
      first = nullptr;
    if (auto store = dyn_cast<warp::StoreComponentsOp>(op);
        store && canStage(store))
      staged.stores.insert(store);
  }
}

/// True if the grid has that many blocks.
static Value hasBlocks(OpBuilder &b, Location loc, int64_t least) {
  Type i64 = b.getI64Type();
  Value blocks;
  for (warp::Axis axis : {warp::Axis::x, warp::Axis::y, warp::Axis::z}) {
    Value extent = arith::ExtUIOp::create(
        b, loc, i64, readGrid(b, loc, warp::GridValue::gridDim, axis));
    blocks = blocks ? arith::MulIOp::create(b, loc, blocks, extent) : extent;
  }
  Value limit = arith::ConstantOp::create(b, loc, b.getI64IntegerAttr(least));
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::uge, blocks,
                               limit);
}

warp::StagedAccesses warp::findStagedAccesses(LLVM::LLVMFuncOp entry) {
  StagedAccesses staged;
  int64_t blockDim = getVariant(entry).getBlockDim();
  int64_t warpSize = getTarget(entry).getSubgroupSize();
  int64_t warps = llvm::divideCeil(blockDim, warpSize);
  auto module = entry->getParentOfType<ModuleOp>();
  int64_t left = staticBlockBytes - sharedBytes(module);
  Finder finder(entry, staged, std::min(left, mostOfSlabs) / warps);
  entry.walk([&](Block *block) { finder.visit(*block); });
  int64_t slabSize = finder.slabSize;
  if (slabSize == 0)
    return staged;

  OpBuilder b = OpBuilder::atBlockBegin(&entry.getBody().front());
  Location loc = entry.getLoc();
  auto constant = [&](int64_t value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
  };
  auto slabs = LLVM::LLVMArrayType::get(b.getI8Type(), warps * slabSize);
  Value shared = makeShared(b, loc, module, slabs, "element_slabs");
  Value last = constant(warpSize - 1);
  Value x = readGrid(b, loc, GridValue::threadId), thread = x;
  if (getVariant(entry).getRank() > 1) {
    thread = threadInBlock(b, loc);
    Value rest = arith::AndIOp::create(
        b, loc, readGrid(b, loc, GridValue::blockDim), last);
    staged.inRow = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, rest,
                                         constant(0));
  }
  staged.lane = arith::AndIOp::create(b, loc, thread, last);
  if (!staged.rows.empty())
    staged.isCrowded = hasBlocks(b, loc, llvm::divideCeil(leastWarps, warps));
  Value warp = subgroupOf(b, loc, thread);
  Value offset = arith::MulIOp::create(b, loc, warp, constant(slabSize));
  staged.slab = LLVM::GEPOp::create(b, loc, shared.getType(), b.getI8Type(),
                                    shared, ArrayRef<LLVM::GEPArg>(offset));
  return staged;
}
