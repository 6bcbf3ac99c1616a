//===- StageRows.cpp - Rows of threads through shared memory --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads that walk along rows of their own touch 32 lines of memory in each
// access of a warp:
//
//   for k: s += x[i, k]; q[i, k + 1] = s; atomic_add(g, i, k, s)
//
// The warp moves tiles of its 32 rows between memory and shared memory of its
// own, a few neighbouring columns at a time, and iterations use these:
//
//   for tile = first to end step columns:
//     for row: window[row][column] = x[i of lane row, tile + column]
//     for step: as before, with window[lane][step] for x[i, tile + step]
//     for row: q[i of lane row, tile + column + 1] = window[row][column]
//   for the rest: the loop as it was
//
// A window is that part of an array which the accesses of the loop to it touch
// in a tile: elements of one row, whose column grows or falls by one in each
// iteration, all in the straight part of the loop if there are writes.
// Iterations keep their order, and so do the accesses of a thread to an
// element. A window that is only added to holds what is added; it takes the
// place of one that has been read by then. Warps with a lane missing, or whose
// lanes do not agree on the bounds, run no tile.
//
//===----------------------------------------------------------------------===//

#include "LoopSchedule.h"
#include "RingLoop.h"

#include "Analysis/ArrayOrigins.h"
#include "Launch/UnrollLoop.h"
#include "Updates/Atomics.h"
#include "WarpDialect/TilePasses.h"

using namespace mlir;
using namespace warp;

/// Bytes that a lane has in a part of the memory of windows: a row of 16
/// floats and the padding against bank conflicts, or of 8 doubles.
constexpr int64_t partBytes = 72;
/// Parts of a loop: with them six blocks of 256 threads have room.
constexpr int64_t mostParts = 2, mostOfBlock = 40 * 1024;
constexpr StringLiteral memoryName = "staged_rows";
/// Columns of a tile: two sectors of floats, or one.
constexpr int64_t mostColumns = 16, leastColumns = 8;
/// Columns that a window may have beyond those of the tile.
constexpr int64_t mostExtra = 4;
/// Operations of a loop. A longer one hides the latency of memory itself, and
/// takes the registers that loads in flight need.
constexpr int64_t mostOperations = 64;
/// Threads whose rows begin within so many elements share lines.
constexpr int64_t leastDistance = 8;

namespace {

/// An access of the loop to an array along the row of its thread.
struct RowAccess {
  AccessOp op;
  /// Its column, beside that of the first access of the window.
  int64_t column;
};

/// The part of an array that a tile touches.
struct Window {
  SmallVector<RowAccess> accesses;
  Type type;
  /// By how much the column grows in an iteration: 1 or -1.
  int64_t direction;
  /// The first and the last column, beside that of the first access, in the
  /// direction of the loop.
  int64_t first = 0, last = 0;
  bool isRead = false, isWritten = false, isAdded = false;
  /// A window whose memory it uses.
  Window *host = nullptr;
  /// Its place: the part, and bytes of a lane before it there.
  int64_t part = 0, offset = 0;
  Value memory;

  AccessOp base() { return accesses.front().op; }
  int64_t extra() const { return last - first; }
  int64_t pitch(int64_t columns) const { return (columns + extra()) | 1; }
  int64_t bytes() const { return type.getIntOrFloatBitWidth() / 8; }
};

class StageRows : public LoopSchedule {
public:
  using LoopSchedule::LoopSchedule;

  bool applies() override;
  void rewrite() override;
  Description describe(bool) override {
    return {"loop", "tiles of " + std::to_string(columns) + " columns",
            "rows of threads staged through shared memory", loop};
  }

private:
  std::optional<int64_t> directionOf(AccessOp op);
  bool isUniform(Value value) {
    return site.getVariance().isUniform(value, Scope::Lanes);
  }
  bool collect(AccessOp op);
  bool isApart(Window &window, const ArrayOrigins &origins);
  bool share(Window &window);
  bool fit();
  bool place();

  int64_t bytesOfPart();
  LLVM::GlobalOp findMemory();
  Value makeMemory(int64_t count);
  void allocate();
  Value slot(Window &window, Value row, Value column);
  Value columnAt(Window &window, Value tile);
  SmallVector<Value> indicesOf(Window &window, Value own, Value row,
                               Value column);
  void write(AccessOp op, ArrayRef<Value> indices, Value value);
  int64_t columnsToLoad(Window &window);
  void move(Value tile, bool toMemory);
  void moveOne(Window &window, Value own, bool toMemory, Value row,
               Value column, SmallVectorImpl<std::pair<Value, Value>> &loaded);
  SmallVector<Value> buildStep(Value tile, Value step, ValueRange carried);
  void buildTiles(Value end);

  SmallVector<Window> windows;
  int64_t columns = 0, parts = 0;
  llvm::SetVector<Value> compared;
  Value lane;
};

} // namespace

//===----------------------------------------------------------------------===//
// Loops that qualify
//===----------------------------------------------------------------------===//

/// By how much the column of an element grows from iteration to iteration, if
/// the rest of its place is fixed in the loop, and far from those of other
/// lanes.
std::optional<int64_t> StageRows::directionOf(AccessOp op) {
  SmallVector<Value> indices(op.getIndices());
  if (indices.empty() || !loop.isDefinedOutsideOfLoop(op.getArray()) ||
      !isUniform(op.getArray()))
    return std::nullopt;
  const ThreadVariance &variance = site.getVariance();
  Value last = indices.back();
  Symbol trip = Symbol::trip(loop);
  const Form &form = variance.form(last);
  std::optional<Form> coefficient = form.coefficientOf(trip);
  std::optional<int64_t> stride =
      coefficient ? coefficient->getConstant() : std::nullopt;
  if (!stride || std::abs(*stride) != 1 ||
      !form.without(trip).isDefinedOutside(loop))
    return std::nullopt;
  bool differs = false;
  for (Value index : ArrayRef(indices).drop_back()) {
    if (!loop.isDefinedOutsideOfLoop(index))
      return std::nullopt;
    differs |= !isUniform(index);
  }
  std::optional<int64_t> step = variance.step(last);
  if (!differs && step && std::abs(*step) < leastDistance)
    return std::nullopt;
  return stride;
}

/// Adds an access along a row to the window of its array. False if it is none.
bool StageRows::collect(AccessOp op) {
  std::optional<int64_t> direction = directionOf(op);
  if (!direction)
    return false;
  Type type;
  auto update = dyn_cast<AtomicComponentsOp>(op.getOperation());
  if (auto load = dyn_cast<LoadComponentsOp>(op.getOperation()))
    type = load.getNumResults() == 1 ? load.getResult(0).getType() : Type();
  else if (auto store = dyn_cast<StoreComponentsOp>(op.getOperation()))
    type = store.getComponents().size() == 1
               ? store.getComponents()[0].getType()
               : Type();
  else if (update && update.getComponents().size() == 1 &&
           update->use_empty() && update.getKind() == AtomicKind::add &&
           getUpdate(update).getScope() == UpdateScope::thread &&
           !getUpdate(update).isExact())
    type = update.getComponents()[0].getType();
  if (!type || !type.isIntOrFloat() ||
      (type.getIntOrFloatBitWidth() != 32 &&
       type.getIntOrFloatBitWidth() != 64))
    return false;
  const ThreadVariance &variance = site.getVariance();
  auto isSameRow = [&](Window &window) {
    AccessOp base = window.base();
    return base.getArray() == op.getArray() && window.type == type &&
           window.direction == *direction &&
           llvm::equal(ValueRange(base.getIndices()).drop_back(),
                       ValueRange(op.getIndices()).drop_back());
  };
  for (Window &window : windows) {
    if (!isSameRow(window))
      continue;
    std::optional<Form> distance =
        variance.form(op.getIndices().back()) -
        variance.form(window.base().getIndices().back());
    std::optional<int64_t> constant =
        distance ? distance->getConstant() : std::nullopt;
    if (!constant)
      continue;
    int64_t column = *constant * *direction;
    if (std::max(window.last, column) - std::min(window.first, column) >
        mostExtra)
      continue;
    window.first = std::min(window.first, column);
    window.last = std::max(window.last, column);
    window.accesses.push_back({op, column});
    return true;
  }
  Window window;
  window.type = type;
  window.direction = *direction;
  window.accesses.push_back({op, 0});
  windows.push_back(std::move(window));
  return true;
}

/// True if nothing else in the loop touches what is written here, or writes
/// what is read.
bool StageRows::isApart(Window &window, const ArrayOrigins &origins) {
  WalkResult result = loop.getBody()->walk([&](AccessOp op) {
    bool isMember = llvm::any_of(window.accesses, [&](RowAccess &one) {
      return one.op.getOperation() == op.getOperation();
    });
    bool conflicts = !isMember &&
                     (window.isWritten || window.isAdded || op.mayWrite()) &&
                     origins.mayAlias(op.getArray(), window.base().getArray());
    return conflicts ? WalkResult::interrupt() : WalkResult::advance();
  });
  return !result.wasInterrupted();
}

/// Finds a window that has been read when this one, which is only added to, is
/// filled.
bool StageRows::share(Window &window) {
  for (Window &other : windows) {
    if (&other == &window || other.isWritten || other.isAdded ||
        other.extra() || other.bytes() != window.bytes() ||
        llvm::any_of(windows, [&](Window &one) { return one.host == &other; }))
      continue;
    Operation *added = window.base();
    if (llvm::all_of(other.accesses, [&](RowAccess &one) {
          return one.op->isBeforeInBlock(added);
        })) {
      window.host = &other;
      return true;
    }
  }
  return false;
}

/// Chooses the number of columns; drops windows that there is no room for.
bool StageRows::fit() {
  auto module = site.function->getParentOfType<ModuleOp>();
  int64_t left = mostOfBlock - sharedBytes(module);
  if (LLVM::GlobalOp known = findMemory())
    left += cast<LLVM::LLVMArrayType>(known.getGlobalType()).getNumElements();
  parts = std::min(mostParts, left / bytesOfPart());
  for (; !windows.empty(); windows.pop_back()) {
    for (Window &window : windows)
      window.host = nullptr;
    for (Window &window : windows)
      if (window.isAdded)
        share(window);
    for (columns = mostColumns; columns >= leastColumns; columns /= 2)
      if (place())
        return true;
  }
  return false;
}

/// Finds the first part with room for each window.
bool StageRows::place() {
  int64_t used[mostParts] = {};
  for (Window &window : windows) {
    if (window.host)
      continue;
    int64_t bytes = window.bytes() * window.pitch(columns);
    int64_t *part = std::find_if(used, used + parts, [&](int64_t sum) {
      return sum + bytes <= partBytes;
    });
    if (part == used + parts)
      return false;
    window.part = part - used;
    window.offset = *part;
    *part += llvm::alignTo(bytes, 8);
  }
  return true;
}

bool StageRows::applies() {
  if (site.function->hasAttr(attr::blockThreads) || site.variant.getDebug() ||
      !site.variant.hasWholeWarps() || site.target.getSubgroupSize() != 32 ||
      !hasWarpTiles(loop, site.getVariance(), compared) ||
      RingLoop(loop, site.variant.getFastMath()).qualifies(site.getVariance()))
    return false;
  int64_t operations = 0;
  WalkResult result = loop.getBody()->walk([&](Operation *op) {
    ++operations;
    auto update = dyn_cast<AtomicComponentsOp>(op);
    bool isPlain =
        (update && update->use_empty()) ||
        isa<LoadComponentsOp, StoreComponentsOp, scf::ForOp, scf::IfOp>(op) ||
        isMemoryEffectFree(op);
    return isPlain && !isShuffle(op) ? WalkResult::advance()
                                     : WalkResult::interrupt();
  });
  if (result.wasInterrupted() || operations > mostOperations)
    return false;
  for (Operation &op : *loop.getBody())
    if (auto access = dyn_cast<AccessOp>(op))
      collect(access);
  ArrayOrigins origins(site.function, site.variant.getDisjoint());
  llvm::erase_if(windows, [&](Window &window) {
    for (RowAccess &one : window.accesses) {
      window.isRead |= isa<LoadComponentsOp>(one.op.getOperation());
      window.isWritten |= isa<StoreComponentsOp>(one.op.getOperation());
      window.isAdded |= isa<AtomicComponentsOp>(one.op.getOperation());
    }
    return (window.isAdded && window.accesses.size() > 1) ||
           !isApart(window, origins);
  });
  return fit();
}

//===----------------------------------------------------------------------===//
// Tiles
//===----------------------------------------------------------------------===//

/// Bytes of a part for all warps of a block.
int64_t StageRows::bytesOfPart() {
  return llvm::alignTo(site.variant.getBlockDim(), warpSize) * partBytes;
}

/// The memory of the windows of all loops, of which a warp runs one at a time.
LLVM::GlobalOp StageRows::findMemory() {
  auto module = site.function->getParentOfType<ModuleOp>();
  for (auto global : module.getOps<LLVM::GlobalOp>())
    if (global.getSymName().starts_with(memoryName))
      return global;
  return {};
}

Value StageRows::makeMemory(int64_t count) {
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(), count * bytesOfPart());
  LLVM::GlobalOp known = findMemory();
  if (!known)
    return makeShared(b, loc, site.function->getParentOfType<ModuleOp>(), type,
                      memoryName);
  auto old = cast<LLVM::LLVMArrayType>(known.getGlobalType());
  if (old.getNumElements() < type.getNumElements()) {
    known.setGlobalType(type);
    known.getInitializerBlock()->front().getResult(0).setType(type);
  }
  return LLVM::AddressOfOp::create(b, loc, known);
}

/// The parts of the shared memory that belong to this warp.
void StageRows::allocate() {
  int64_t warps = llvm::divideCeil(site.variant.getBlockDim(), warpSize);
  int64_t count = 1;
  for (Window &window : windows)
    count = std::max(count, window.part + 1);
  Value shared = makeMemory(count);
  Value number = subgroupOf(b, loc, threadInBlock(b, loc));
  for (Window &window : windows) {
    if (window.host)
      continue;
    Value part = add(number, constant(window.part * warps));
    Value offset =
        arith::MulIOp::create(b, loc, part, constant(warpSize * partBytes));
    window.memory =
        LLVM::GEPOp::create(b, loc, shared.getType(), b.getI8Type(), shared,
                            ArrayRef<LLVM::GEPArg>(add(
                                offset, constant(warpSize * window.offset))));
  }
  for (Window &window : windows)
    if (window.host)
      window.memory = window.host->memory;
}

/// Address of an element in the memory of a window.
Value StageRows::slot(Window &window, Value row, Value column) {
  Value start =
      arith::MulIOp::create(b, loc, row, constant(window.pitch(columns)));
  return LLVM::GEPOp::create(b, loc, window.memory.getType(), window.type,
                             window.memory,
                             ArrayRef<LLVM::GEPArg>(add(start, column)));
}

/// The last index of this thread's first access in the first iteration of a
/// tile, at the first column of the window.
Value StageRows::columnAt(Window &window, Value tile) {
  Value last = window.base().getIndices().back();
  IRMapping clones;
  clones.map(loop.getInductionVar(), tile);
  llvm::SetVector<Operation *> slice;
  SmallVector<Value> work{last};
  while (!work.empty()) {
    Operation *op = work.pop_back_val().getDefiningOp();
    if (!op || op->getBlock() != loop.getBody() || !slice.insert(op))
      continue;
    llvm::append_range(work, op->getOperands());
  }
  for (Operation &op : loop.getBody()->without_terminator())
    if (slice.contains(&op))
      b.clone(op, clones);
  Value own = clones.lookupOrDefault(last);
  if (window.first == 0)
    return own;
  return add(own, constant(own.getType(), window.first * window.direction));
}

/// Indices of the element of a lane's row in a column; `own` is what
/// `columnAt` gives.
SmallVector<Value> StageRows::indicesOf(Window &window, Value own, Value row,
                                        Value column) {
  const ThreadVariance &variance = site.getVariance();
  auto mark = [&](Value made, Value original) {
    if (variance.isNonNegative(original, loop.getBody()))
      made.getDefiningOp()->setAttr(attr::nonNegative, b.getUnitAttr());
    return made;
  };
  // A warp may lie in several rows of the launch.
  auto ofRow = [&](Value value, Value original) {
    llvm::SetVector<Value> ifEqual;
    if (variance.isUniformIfEqual(original, ifEqual) && ifEqual.empty())
      return value;
    return mark(shuffle(b, loc, ShuffleMode::index, value, row), original);
  };
  SmallVector<Value> indices;
  ValueRange given = window.base().getIndices();
  for (Value index : given.drop_back())
    indices.push_back(ofRow(index, index));
  Value start = ofRow(own, given.back());
  if (own.getType() != column.getType())
    column = arith::ExtSIOp::create(b, loc, own.getType(), column);
  Value last = window.direction > 0
                   ? add(start, column)
                   : arith::SubIOp::create(b, loc, start, column).getResult();
  indices.push_back(mark(last, given.back()));
  return indices;
}

/// The same write elsewhere, of another value.
void StageRows::write(AccessOp op, ArrayRef<Value> indices, Value value) {
  auto update = dyn_cast<AtomicComponentsOp>(op.getOperation());
  if (!update) {
    StoreComponentsOp::create(b, loc, ValueRange(value), op.getArray(),
                              indices);
    return;
  }
  auto made = AtomicComponentsOp::create(b, loc, TypeRange(value.getType()),
                                         update.getKind(), ValueRange(value),
                                         op.getArray(), indices);
  setUpdate(made, UpdateScope::thread, getUpdate(update).getRun());
}

/// Columns before the first that the tile writes before it reads it: all, or
/// those that only earlier iterations have written.
int64_t StageRows::columnsToLoad(Window &window) {
  int64_t written = -1, read = -1;
  for (RowAccess &one : window.accesses) {
    int64_t &last =
        isa<LoadComponentsOp>(one.op.getOperation()) ? read : written;
    last = std::max(last, one.column - window.first);
  }
  return read < written ? written : columns + window.extra();
}

/// Moves one column of each of some rows between memory and the window.
void StageRows::moveOne(Window &window, Value own, bool toMemory, Value row,
                        Value column,
                        SmallVectorImpl<std::pair<Value, Value>> &loaded) {
  Value place = slot(window, row, column);
  SmallVector<Value> indices = indicesOf(window, own, row, column);
  if (!toMemory) {
    Value value = LoadComponentsOp::create(b, loc, TypeRange(window.type),
                                           window.base().getArray(), indices)
                      ->getResult(0);
    loaded.emplace_back(value, place);
    return;
  }
  AccessOp writer;
  for (RowAccess &one : window.accesses)
    if (one.op.mayWrite())
      writer = one.op;
  Value value =
      LLVM::LoadOp::create(b, loc, window.type, place, window.bytes());
  write(writer, indices, value);
}

void StageRows::move(Value tile, bool toMemory) {
  SmallVector<std::pair<Value, Value>> loaded;
  int64_t rowsAtOnce = warpSize / columns;
  Value column = bitAnd(lane, constant(columns - 1));
  Value firstRow = arith::DivUIOp::create(b, loc, lane, constant(columns));
  bool isDone = false;
  for (Window &window : windows) {
    if (toMemory ? !window.isWritten && !window.isAdded : !window.isRead)
      continue;
    Value own = columnAt(window, tile);
    // Columns that not all iterations of the tile write stay as they are.
    int64_t first = 0, last = window.extra();
    if (toMemory) {
      first = window.extra(), last = 0;
      for (RowAccess &one : window.accesses)
        if (one.op.mayWrite()) {
          first = std::min(first, one.column - window.first);
          last = std::max(last, one.column - window.first);
        }
    }
    Value shifted = first ? add(column, constant(first)) : column;
    if (toMemory && !isDone) {
      synchronizeWarp(b, loc);
      isDone = true;
    }
    int64_t count = toMemory ? columns + last : columnsToLoad(window);
    if (count < columns)
      first = -columns, last = count - columns;
    for (int64_t pass = 0; count >= columns && pass < columns; ++pass)
      moveOne(window, own, toMemory, add(firstRow, constant(pass * rowsAtOnce)),
              shifted, loaded);
    for (int64_t extra = first; extra < last; ++extra)
      moveOne(window, own, toMemory, lane, constant(columns + extra), loaded);
  }
  if (toMemory) {
    // Lanes read what others have written for them.
    if (isDone)
      synchronizeWarp(b, loc);
    return;
  }
  // Other lanes may still read what was there.
  synchronizeWarp(b, loc);
  for (auto [value, place] : loaded)
    LLVM::StoreOp::create(b, loc, value, place,
                          value.getType().getIntOrFloatBitWidth() / 8);
  synchronizeWarp(b, loc);
}

/// One iteration on windows.
SmallVector<Value> StageRows::buildStep(Value tile, Value step,
                                        ValueRange carried) {
  IRMapping clones;
  clones.map(loop.getInductionVar(), add(tile, widen(step)));
  clones.map(loop.getRegionIterArgs(), carried);
  for (Operation &op : loop.getBody()->without_terminator()) {
    Window *window = nullptr;
    int64_t column = 0;
    for (Window &one : windows)
      for (RowAccess &access : one.accesses)
        if (access.op.getOperation() == &op) {
          window = &one;
          column = access.column - one.first;
        }
    if (!window) {
      b.clone(op, clones);
      continue;
    }
    Value place =
        slot(*window, lane, column ? add(step, constant(column)) : step);
    if (isa<LoadComponentsOp>(op)) {
      clones.map(op.getResult(0), LLVM::LoadOp::create(b, loc, window->type,
                                                       place, window->bytes()));
      continue;
    }
    Value value = clones.lookupOrDefault(op.getOperand(0));
    LLVM::StoreOp::create(b, loc, value, place, window->bytes());
  }
  SmallVector<Value> next;
  for (Value value : loop.getYieldedValues())
    next.push_back(clones.lookupOrDefault(value));
  return next;
}

void StageRows::buildTiles(Value end) {
  auto tiles = scf::ForOp::create(
      b, loc, loop.getLowerBound(), end, constant(counterType(), columns),
      loop.getInitArgs(), nullptr, loop.getUnsignedCmp());
  buildBody(tiles, [&](Value tile, ValueRange carried) {
    move(tile, /*toMemory=*/false);
    auto steps = scf::ForOp::create(b, loc, constant(0), constant(columns),
                                    constant(1), carried);
    setCopies(steps, leastColumns);
    buildBody(steps, [&](Value step, ValueRange inner) {
      return buildStep(tile, step, inner);
    });
    move(tile, /*toMemory=*/true);
    return SmallVector<Value>(steps.getResults());
  });
  loop.getInitArgsMutable().assign(tiles.getResults());
}

void StageRows::rewrite() {
  lane = readGrid(b, loc, GridValue::laneId);
  allocate();
  Value end = endOfTiles(compared.getArrayRef(), columns);
  buildTiles(end);
  loop.getLowerBoundMutable().assign(end);
}

WARP_MAKE_SCHEDULE(StageRows)
