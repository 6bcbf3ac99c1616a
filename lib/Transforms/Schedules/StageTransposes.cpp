//===- StageTransposes.cpp - Coalescing of transposed accesses ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Neighbouring threads of a launch over a plane differ in the last index, as
// neighbours in memory do. An access with the indices exchanged,
//
//   b[j, i] = a[i, j]
//
// has every thread of a warp in a line of memory of its own. There a block
// takes a square of 32 x 32 indices, a few of one column for each thread. An
// exchanged load is made by the thread that has the element's neighbours, and
// an exchanged store likewise; the square changes hands in the memory of the
// block, in rows of 33 words so that columns do not queue at one bank:
//
//   load    memory -> thread (i, j) -> square -> thread (j, i)
//   store   thread (i, j) -> square -> thread (j, i) -> memory
//
// The threads wait for each other between writing and reading the square, so
// all of them must come there: squares that stick out of the launch are done
// index by index. A body may load, compute and store, in that order. Threads of
// a launch are independent, so that another one makes the access is only seen
// by what this thread does to the same element: it may store to it once.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "Analysis/ThreadVariance.h"
#include "Choices.h"
#include "Launch/EntryBuilder.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;
using warp::EntryBuilder;

/// Indices on a side of a square, words of its rows, and bytes of all squares.
constexpr int64_t side = 32, pitch = side + 1, mostBytes = 40 * 1024;

//===----------------------------------------------------------------------===//
// Kernels that qualify
//===----------------------------------------------------------------------===//

static bool isStore(Operation *op) {
  return isa<warp::StoreComponentsOp>(op);
}

/// Whether a value is an index, or that and something that no thread changes.
static bool follows(Value value, Value index,
                    const warp::ThreadVariance &variance) {
  if (value == index)
    return true;
  Operation *op = value.getDefiningOp();
  if (isa_and_nonnull<arith::ExtSIOp, arith::ExtUIOp>(op))
    return follows(op->getOperand(0), index, variance);
  auto isFixed = [&](Value term) {
    return variance.isUniform(term, warp::Scope::Launch);
  };
  if (!isa_and_nonnull<arith::AddIOp, arith::SubIOp>(op))
    return false;
  return (follows(op->getOperand(0), index, variance) &&
          isFixed(op->getOperand(1))) ||
         (isa<arith::AddIOp>(op) && isFixed(op->getOperand(0)) &&
          follows(op->getOperand(1), index, variance));
}

/// Whether a value can be computed for other indices: from these and what is
/// outside of the thread.
static bool isIndexMath(Value value, Block *thread) {
  Operation *op = value.getDefiningOp();
  if (!op || op->getBlock() != thread)
    return !op || !thread->findAncestorOpInBlock(*op);
  return isPure(op) && op->getNumRegions() == 0 &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return isIndexMath(operand, thread);
         });
}

static bool isPackedArgument(Value array) {
  if (auto grad = array.getDefiningOp<warp::GradOp>())
    array = grad.getArray();
  auto argument = dyn_cast<BlockArgument>(array);
  auto kernel = argument ? dyn_cast<FunctionOpInterface>(
                               argument.getOwner()->getParentOp())
                         : nullptr;
  return kernel &&
         kernel.getArgAttr(argument.getArgNumber(), warp::attr::packed);
}

/// Whether neighbouring threads access elements in different lines, while those
/// below each other access neighbours.
bool EntryBuilder::isTurned(Operation *op,
                            const warp::ThreadVariance &variance) {
  auto access = dyn_cast<warp::AccessOp>(op);
  if (!access || access.getIndices().size() < 2)
    return false;
  Block *thread = threads.getThread();
  Value x = threads.getIndices()[rank - 1], y = threads.getIndices()[rank - 2];
  auto followsX = [&](Value index) { return follows(index, x, variance); };
  return isPackedArgument(access.getArray()) &&
         follows(access.getIndices().back(), y, variance) &&
         llvm::any_of(access.getIndices().drop_back(), followsX) &&
         llvm::all_of(access.getIndices(), [&](Value index) {
           return isIndexMath(index, thread);
         });
}

/// Bytes of squares for an access.
static int64_t countBytes(TypeRange components) {
  int64_t bytes = 0;
  for (Type type : components)
    bytes += side * pitch * llvm::divideCeil(type.getIntOrFloatBitWidth(), 8);
  return bytes;
}

static TypeRange getTypes(Operation *access) {
  if (auto store = dyn_cast<warp::StoreComponentsOp>(access))
    return store.getComponents().getTypes();
  return access->getResultTypes();
}

/// Whether the kernel loads, computes and then stores, to each array once.
static bool isOrdered(Block *thread, bool disjoint) {
  SmallVector<Value> written;
  for (Operation &op : thread->without_terminator()) {
    if (auto store = dyn_cast<warp::StoreComponentsOp>(op)) {
      if (llvm::is_contained(written, store.getArray()) ||
          (!written.empty() && !disjoint))
        return false;
      written.push_back(store.getArray());
      continue;
    }
    bool isLoad = isa<warp::LoadComponentsOp>(op);
    if (isLoad && !written.empty())
      return false;
    if (!isLoad &&
        (!isMemoryEffectFree(&op) || op.walk([](LoopLikeOpInterface) {
                                         return WalkResult::interrupt();
                                       }).wasInterrupted()))
      return false;
  }
  return true;
}

/// Finds the accesses for which squares pay; whether there are any.
bool EntryBuilder::planTiles() {
  int64_t blockDim = variant.getBlock();
  if (rank < 2 || rank > 3 || flat || !index32 || threads.getNumResults() != 0 ||
      variant.getDebug() || blockDim < 128 ||
      side * side % blockDim != 0 ||
      !isOrdered(threads.getThread(), variant.getDisjoint()))
    return false;
  warp::ThreadVariance variance(kernel);
  int64_t loaded = 0, stored = 0;
  for (Operation &op : threads.getThread()->without_terminator()) {
    if (!isTurned(&op, variance))
      continue;
    turned.insert(&op);
    (isStore(&op) ? stored : loaded) += countBytes(getTypes(&op));
  }
  return !turned.empty() && loaded <= mostBytes && stored <= mostBytes;
}

//===----------------------------------------------------------------------===//
// Squares
//===----------------------------------------------------------------------===//

namespace {

/// Squares of words in the memory of a block, one for each component of some
/// accesses.
class Squares {
public:
  Squares(OpBuilder &b, Location loc, Value memory)
      : b(b), loc(loc), memory(memory) {}

  /// The next square.
  void begin(Type word) {
    this->word = word;
    bytes = llvm::divideCeil(word.getIntOrFloatBitWidth(), 8);
    start = end;
    end += side * pitch * bytes;
  }
  void store(Value value, Value place) {
    LLVM::StoreOp::create(b, loc, value, address(place), bytes);
  }
  Value load(Value place) {
    return LLVM::LoadOp::create(b, loc, word, address(place), bytes);
  }

private:
  Value address(Value place) {
    Value square = LLVM::GEPOp::create(
        b, loc, memory.getType(), b.getI8Type(), memory,
        ArrayRef<LLVM::GEPArg>(int32_t(start)), LLVM::GEPNoWrapFlags::inbounds);
    return LLVM::GEPOp::create(b, loc, memory.getType(), word, square,
                               ArrayRef<LLVM::GEPArg>(place),
                               LLVM::GEPNoWrapFlags::inbounds);
  }

  OpBuilder &b;
  Location loc;
  Value memory;
  Type word;
  int64_t bytes = 0, start = 0, end = 0;
};

} // namespace

/// Copies the index arithmetic of an access, and the access.
static Operation *cloneAccess(OpBuilder &b, Operation *access, Block *thread,
                              IRMapping &map) {
  SmallVector<Operation *> needed;
  std::function<void(Value)> collect = [&](Value value) {
    Operation *op = value.getDefiningOp();
    if (!op || op->getBlock() != thread || llvm::is_contained(needed, op))
      return;
    for (Value operand : op->getOperands())
      collect(operand);
    needed.push_back(op);
  };
  for (Value index : cast<warp::AccessOp>(access).getIndices())
    collect(index);
  for (Operation *op : needed)
    if (!map.contains(op->getResult(0)))
      b.clone(*op, map);
  return b.clone(*access, map);
}

/// The indices of a whole square; `own` maps those of a thread's items, `other`
/// those whose exchanged elements it moves.
void EntryBuilder::buildSquare(MutableArrayRef<IRMapping> own,
                               MutableArrayRef<IRMapping> other,
                               ArrayRef<Value> ownPlaces,
                               ArrayRef<Value> otherPlaces, Value memory) {
  Block *thread = threads.getThread();
  auto list = [&](bool stores) {
    SmallVector<Operation *> found;
    for (Operation &op : thread->without_terminator())
      if (turned.contains(&op) && isStore(&op) == stores)
        found.push_back(&op);
    return found;
  };
  SmallVector<Operation *> loads = list(false), stores = list(true);

  SmallVector<SmallVector<Operation *>> loaded;
  for (Operation *load : loads) {
    loaded.emplace_back();
    for (IRMapping &map : other)
      loaded.back().push_back(cloneAccess(b, load, thread, map));
  }
  Squares in(b, loc, memory), out(b, loc, memory);
  for (auto [load, copies] : llvm::zip_equal(loads, loaded))
    for (auto [i, type] : llvm::enumerate(load->getResultTypes())) {
      in.begin(type);
      for (auto [copy, place] : llvm::zip_equal(copies, ownPlaces))
        in.store(copy->getResult(i), place);
    }
  if (!loads.empty())
    warp::synchronizeBlock(b, loc);
  Squares back(b, loc, memory);
  for (Operation *load : loads)
    for (Value result : load->getResults()) {
      back.begin(result.getType());
      for (auto [map, place] : llvm::zip_equal(own, otherPlaces))
        map.map(result, back.load(place));
    }
  // The squares are used again.
  if (!loads.empty() && !stores.empty())
    warp::synchronizeBlock(b, loc);

  for (Operation &op : thread->without_terminator())
    if (!turned.contains(&op))
      for (IRMapping &map : own)
        b.clone(op, map);

  for (Operation *store : stores)
    for (Value component :
         cast<warp::StoreComponentsOp>(store).getComponents()) {
      out.begin(component.getType());
      for (auto [map, place] : llvm::zip_equal(own, ownPlaces))
        out.store(map.lookupOrDefault(component), place);
    }
  if (!stores.empty())
    warp::synchronizeBlock(b, loc);
  Squares from(b, loc, memory);
  for (Operation *store : stores) {
    SmallVector<SmallVector<Value>> values(other.size());
    for (Type type : getTypes(store)) {
      from.begin(type);
      for (auto [list, place] : llvm::zip_equal(values, otherPlaces))
        list.push_back(from.load(place));
    }
    for (auto [map, list] : llvm::zip_equal(other, values)) {
      auto copy = cast<warp::StoreComponentsOp>(
          cloneAccess(b, store, thread, map));
      copy.getComponentsMutable().assign(list);
    }
  }
}

EntryBuilder::Values EntryBuilder::buildTiles() {
  Type i32 = b.getI32Type();
  int64_t blockDim = variant.getBlock();
  int64_t rows = blockDim / side, items = side / rows;
  auto read = [&](warp::GridValue value, warp::Axis axis) {
    return warp::readGrid(b, loc, value, axis);
  };
  Value column = read(warp::GridValue::threadId, warp::Axis::x);
  Value row = read(warp::GridValue::threadId, warp::Axis::y);
  Value width = dims[rank - 1], height = dims[rank - 2];
  auto count = [&](Value extent) {
    return div(add(extent, constant(i32, side - 1)), constant(i32, side));
  };
  // Blocks that run together lie side by side where they store.
  bool down = llvm::any_of(turned, isStore);
  Value block = blockIndex();
  auto next = [&](Value extent) {
    Value rest = div(block, extent);
    Value place = sub(block, mul(rest, extent));
    block = rest;
    return place;
  };
  Value first = next(count(down ? height : width));
  Value second = rank == 2 ? block : next(count(down ? width : height));
  Value left = mul(down ? second : first, constant(i32, side));
  Value top = mul(down ? first : second, constant(i32, side));
  Values outer;
  if (rank == 3)
    outer.push_back(block);
  auto fits = [&](Value start, Value extent) {
    return cmp(arith::CmpIPredicate::sle, add(start, constant(i32, side)),
               extent);
  };
  Value whole =
      arith::AndIOp::create(b, loc, fits(left, width), fits(top, height));

  int64_t bytes[2] = {0, 0};
  for (Operation &op : threads.getThread()->without_terminator())
    if (turned.contains(&op))
      bytes[isStore(&op)] += countBytes(getTypes(&op));
  auto type = LLVM::LLVMArrayType::get(b.getI8Type(),
                                       std::max(bytes[0], bytes[1]));
  Value memory = warp::makeShared(b, loc, kernel->getParentOfType<ModuleOp>(),
                                  type, "squares");
  auto branch = scf::IfOp::create(b, loc, whole, /*withElseRegion=*/true);
  warp::setSchedule(entry, warp::getSchedule(entry).withTransposeTile(side));

  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  SmallVector<IRMapping> own(items), other(items);
  Values ownPlaces, otherPlaces;
  auto place = [&](IRMapping &map, Value y, Value x) {
    Values indices(outer);
    indices.append({add(top, y), add(left, x)});
    map.map(threads.getIndices(), indices);
  };
  for (int64_t i = 0; i < items; ++i) {
    Value below = add(row, constant(i32, i * rows));
    place(own[i], below, column);
    place(other[i], column, below);
    ownPlaces.push_back(add(mul(below, constant(i32, pitch)), column));
    otherPlaces.push_back(add(mul(column, constant(i32, pitch)), below));
  }
  buildSquare(own, other, ownPlaces, otherPlaces, memory);

  b.setInsertionPointToStart(branch.elseBlock());
  Value x = add(left, column);
  auto inside = scf::IfOp::create(
      b, loc, cmp(arith::CmpIPredicate::slt, x, width), /*withElse=*/false);
  b.setInsertionPointToStart(inside.thenBlock());
  Value bottom =
      arith::MinSIOp::create(b, loc, add(top, constant(i32, side)), height);
  auto loop = scf::ForOp::create(b, loc, add(top, row), bottom,
                                 constant(i32, rows));
  b.setInsertionPointToStart(loop.getBody());
  Values indices(outer);
  indices.append({loop.getInductionVar(), x});
  takeThread(indices);
  return {};
}
