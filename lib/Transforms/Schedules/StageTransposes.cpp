//===- StageTransposes.cpp - Coalescing of transposed accesses ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Neighbouring threads differ in the last index of the launch. A transposed
// access,
//
//   b[j, i] = a[i, j]
//
// is not coalesced: each thread of a warp touches a line of memory of its own.
// Here a block takes a tile of 32 x 32 indices, several rows of it per thread,
// and stages transposed accesses in shared memory. The tile is padded to 33
// words per row, so that its columns have no bank conflicts:
//
//   load    memory -> thread (i, j) -> tile -> thread (j, i)
//   store   thread (i, j) -> tile -> thread (j, i) -> memory
//
// Barriers stand between writes and reads of the tile, so all threads must come
// there: tiles that cross the border of the launch run index by index. A body
// may load, compute and store, in that order. Threads of a launch are
// independent, so an access by another thread shows only in accesses of this
// thread to the same element: a body stores to each array once.
//
//===----------------------------------------------------------------------===//

#include "GridMapping.h"

#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TilePasses.h"
#include "warp/Schedule.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;
using namespace warp;

/// Indices on a side of a tile, words of its rows, and bytes of all tiles.
constexpr int64_t side = 32, pitch = side + 1, mostBytes = 40 * 1024;

namespace {

class StageTransposes : public GridMapping {
public:
  using GridMapping::GridMapping;

  bool applies() override;
  bool profit() override { return !variant.getSkinny(); }
  Description describe(bool isMade) override {
    if (!isMade)
      return {"transpose_tile", "0", "32 x 32 tiles would be mostly empty"};
    return {"transpose_tile", "32 x 32",
            "transposed access staged through shared memory (coalesced)",
            (loads.empty() ? stores : loads).front()};
  }
  int sizeFacts() const override { return skinnyFact; }
  bool hasIndependentBlocks() const override { return true; }

private:
  /// The positions in the tiles of a thread's elements.
  struct Part {
    SmallVector<IRMapping> maps;
    Values offsets;
  };

  bool isTransposed(AccessOp access);
  bool isTransposed(Operation &op) {
    return llvm::is_contained(loads, &op) || llvm::is_contained(stores, &op);
  }
  Values build() override;
  void findTile(Value &top, Value &left);
  void buildTile(Value top, Value left, Value column, Value row);
  void stageLoads(Part &own, Part &other, Value memory);
  void stageStores(Part &own, Part &other, Value memory);
  void buildBorder(Value top, Value left, Value column, Value row);

  /// Transposed accesses.
  SmallVector<Operation *> loads, stores;
  /// Indices of the dimensions before the last two, and rows of a tile that
  /// threads take at once.
  Values outer;
  int64_t rows = 0;
};

} // namespace

//===----------------------------------------------------------------------===//
// Kernels that qualify
//===----------------------------------------------------------------------===//

/// True if a value is an index, or that and a term that is the same in the
/// whole launch.
static bool follows(Value value, Value index, const ThreadVariance &variance) {
  if (value == index)
    return true;
  Operation *op = value.getDefiningOp();
  if (isa_and_nonnull<arith::ExtSIOp, arith::ExtUIOp>(op))
    return follows(op->getOperand(0), index, variance);
  auto isFixed = [&](Value term) {
    return variance.isUniform(term, Scope::Launch);
  };
  if (!isa_and_nonnull<arith::AddIOp, arith::SubIOp>(op))
    return false;
  return (follows(op->getOperand(0), index, variance) &&
          isFixed(op->getOperand(1))) ||
         (isa<arith::AddIOp>(op) && isFixed(op->getOperand(0)) &&
          follows(op->getOperand(1), index, variance));
}

/// True if a value can be computed for other indices: from these and values
/// from outside of the thread.
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
  if (auto grad = array.getDefiningOp<GradOp>())
    array = grad.getArray();
  auto argument = dyn_cast<BlockArgument>(array);
  auto kernel =
      argument
          ? dyn_cast<FunctionOpInterface>(argument.getOwner()->getParentOp())
          : nullptr;
  return kernel && kernel.getArgAttr(argument.getArgNumber(), attr::packed);
}

/// True if neighbouring threads access different lines, while threads of
/// neighbouring rows access neighbouring elements.
bool StageTransposes::isTransposed(AccessOp access) {
  if (!access || access.getIndices().size() < 2)
    return false;
  const ThreadVariance &variance = site.getVariance();
  Value x = indices()[rank - 1], y = indices()[rank - 2];
  auto followsX = [&](Value index) { return follows(index, x, variance); };
  return isPackedArgument(access.getArray()) &&
         follows(access.getIndices().back(), y, variance) &&
         llvm::any_of(access.getIndices().drop_back(), followsX) &&
         llvm::all_of(access.getIndices(),
                      [&](Value index) { return isIndexMath(index, thread); });
}

/// Types of the elements of an access.
static TypeRange getTypes(Operation *access) {
  if (auto store = dyn_cast<StoreComponentsOp>(access))
    return store.getComponents().getTypes();
  return access->getResultTypes();
}

static int64_t bytesOf(Type word) {
  return llvm::divideCeil(word.getIntOrFloatBitWidth(), 8);
}

/// Bytes of the tiles for accesses.
static int64_t countBytes(ArrayRef<Operation *> accesses) {
  int64_t bytes = 0;
  for (Operation *access : accesses)
    for (Type type : getTypes(access))
      bytes += side * pitch * bytesOf(type);
  return bytes;
}

/// True if the kernel loads, computes and then stores, to each array once.
static bool isOrdered(Block *thread, bool disjoint) {
  SmallVector<Value> written;
  for (Operation &op : thread->without_terminator()) {
    if (auto store = dyn_cast<StoreComponentsOp>(op)) {
      if (llvm::is_contained(written, store.getArray()) ||
          (!written.empty() && !disjoint))
        return false;
      written.push_back(store.getArray());
    } else if (isa<LoadComponentsOp>(op)) {
      if (!written.empty())
        return false;
    } else if (!isMemoryEffectFree(&op) || hasLoop(op)) {
      return false;
    }
  }
  return true;
}

bool StageTransposes::applies() {
  int64_t blockDim = variant.getBlockDim();
  if (rank < 2 || rank > 3 || !hasPlainThreads() ||
      threads.getNumResults() != 0 || blockDim < 128 ||
      side * side % blockDim != 0 || !isOrdered(thread, variant.getDisjoint()))
    return false;
  for (Operation &op : thread->without_terminator())
    if (isTransposed(dyn_cast<AccessOp>(op)))
      (isa<StoreComponentsOp>(op) ? stores : loads).push_back(&op);
  return loads.size() + stores.size() != 0 && countBytes(loads) <= mostBytes &&
         countBytes(stores) <= mostBytes;
}

//===----------------------------------------------------------------------===//
// Tiles
//===----------------------------------------------------------------------===//

/// The shared-memory side of transposed accesses: a tile for each word of their
/// elements, one after the other.
namespace {
class SharedTiles {
public:
  SharedTiles(OpBuilder &b, Location loc, Value memory)
      : b(b), loc(loc), memory(memory) {}

  /// Stores a word of elements to the next tile.
  void store(ValueRange values, ValueRange offsets) {
    Type word = values.front().getType();
    for (auto [value, offset] : llvm::zip_equal(values, offsets))
      LLVM::StoreOp::create(b, loc, value, address(word, offset),
                            bytesOf(word));
    start += side * pitch * bytesOf(word);
  }
  /// Loads a word of elements from the next tile.
  SmallVector<Value> load(Type word, ValueRange offsets) {
    SmallVector<Value> loaded;
    for (Value offset : offsets)
      loaded.push_back(LLVM::LoadOp::create(b, loc, word, address(word, offset),
                                            bytesOf(word)));
    start += side * pitch * bytesOf(word);
    return loaded;
  }

private:
  Value address(Type word, Value offset) {
    auto flags = LLVM::GEPNoWrapFlags::inbounds;
    Value tile =
        LLVM::GEPOp::create(b, loc, memory.getType(), b.getI8Type(), memory,
                            ArrayRef<LLVM::GEPArg>(int32_t(start)), flags);
    return LLVM::GEPOp::create(b, loc, memory.getType(), word, tile,
                               ArrayRef<LLVM::GEPArg>(offset), flags);
  }

  OpBuilder &b;
  Location loc;
  Value memory;
  int64_t start = 0;
};
} // namespace

/// Copies the index arithmetic of an access, and the access.
static Operation *cloneAccess(OpBuilder &b, Operation *access, Block *thread,
                              IRMapping &map) {
  for (Value index : cast<AccessOp>(access).getIndices())
    cloneComputation(b, index, *thread->getParentOp(), map);
  return b.clone(*access, map);
}

/// Loads the elements of `other`, and reads those of `own` from the tiles.
void StageTransposes::stageLoads(Part &own, Part &other, Value memory) {
  SmallVector<SmallVector<Operation *>> loaded(loads.size());
  for (auto [load, copies] : llvm::zip_equal(loads, loaded))
    for (IRMapping &map : other.maps)
      copies.push_back(cloneAccess(b, load, thread, map));
  SharedTiles to(b, loc, memory), from(b, loc, memory);
  for (ArrayRef<Operation *> copies : loaded)
    for (unsigned i = 0; i < copies.front()->getNumResults(); ++i) {
      auto get = [&](Operation *copy) -> Value { return copy->getResult(i); };
      to.store(llvm::map_to_vector(copies, get), own.offsets);
    }
  synchronizeBlock(b, loc);
  for (Operation *load : loads)
    for (Value result : load->getResults())
      for (auto [map, value] : llvm::zip_equal(
               own.maps, from.load(result.getType(), other.offsets)))
        map.map(result, value);
}

/// Writes the elements of `own` to the tiles, and stores those of `other`.
void StageTransposes::stageStores(Part &own, Part &other, Value memory) {
  SharedTiles to(b, loc, memory), from(b, loc, memory);
  for (Operation *store : stores)
    for (Value word : cast<StoreComponentsOp>(store).getComponents()) {
      auto get = [&](IRMapping &map) { return map.lookupOrDefault(word); };
      to.store(llvm::map_to_vector(own.maps, get), own.offsets);
    }
  synchronizeBlock(b, loc);
  for (Operation *store : stores) {
    SmallVector<Values> words;
    for (Type type : getTypes(store))
      words.push_back(from.load(type, other.offsets));
    for (auto [i, map] : llvm::enumerate(other.maps)) {
      auto get = [&](const Values &word) { return word[i]; };
      cast<StoreComponentsOp>(cloneAccess(b, store, thread, map))
          .getComponentsMutable()
          .assign(llvm::map_to_vector(words, get));
    }
  }
}

/// A tile that the launch has all indices of.
void StageTransposes::buildTile(Value top, Value left, Value column,
                                Value row) {
  auto type = LLVM::LLVMArrayType::get(
      b.getI8Type(), std::max(countBytes(loads), countBytes(stores)));
  Value memory = makeShared(b, loc, site.function->getParentOfType<ModuleOp>(),
                            type, "transpose_tiles");
  Part own, other;
  auto append = [&](Part &part, Value y, Value x) {
    Values mapped(outer);
    mapped.append({add(top, y), add(left, x)});
    part.maps.emplace_back().map(indices(), mapped);
  };
  for (int64_t i = 0; i < side; i += rows) {
    Value below = add(row, constant32(i));
    append(own, below, column);
    append(other, column, below);
    own.offsets.push_back(add(mul(below, constant32(pitch)), column));
    other.offsets.push_back(add(mul(column, constant32(pitch)), below));
  }
  if (!loads.empty())
    stageLoads(own, other, memory);
  // Stores use the same memory.
  if (!loads.empty() && !stores.empty())
    synchronizeBlock(b, loc);
  for (Operation &op : thread->without_terminator())
    if (!isTransposed(op))
      cloneInterleaved(b, op, own.maps);
  if (!stores.empty())
    stageStores(own, other, memory);
}

/// A tile at the border of the launch, index by index.
void StageTransposes::buildBorder(Value top, Value left, Value column,
                                  Value row) {
  Value width = dims[rank - 1], height = dims[rank - 2];
  Value x = add(left, column);
  enterIf(isLess(x, width));
  Value end = min(add(top, constant32(side)), height);
  Values mapped(outer);
  mapped.append({enterLoop(add(top, row), end, constant32(rows)), x});
  takeThread(mapped);
}

/// First indices of the block's tile. Blocks that run together are neighbours
/// in the dimension in which they store consecutive elements.
void StageTransposes::findTile(Value &top, Value &left) {
  Value width = dims[rank - 1], height = dims[rank - 2];
  auto count = [&](Value extent) {
    return div(add(extent, constant32(side - 1)), constant32(side));
  };
  bool down = !stores.empty();
  Value block = read(GridValue::blockId);
  auto next = [&](Value extent) {
    Value rest = div(block, extent);
    Value number = sub(block, mul(rest, extent));
    block = rest;
    return number;
  };
  Value first = next(count(down ? height : width));
  Value second = rank == 2 ? block : next(count(down ? width : height));
  left = mul(down ? second : first, constant32(side));
  top = mul(down ? first : second, constant32(side));
  if (rank == 3)
    outer.push_back(block);
}

StageTransposes::Values StageTransposes::build() {
  setSchedule(site.function,
              getSchedule(site.function).withTransposeTile(side));
  rows = variant.getBlockDim() / side;
  Value column = read(GridValue::threadId, Axis::x);
  Value row = read(GridValue::threadId, Axis::y);
  Value top, left;
  findTile(top, left);
  auto fits = [&](Value start, Value extent) {
    return isAtMost(add(start, constant32(side)), extent);
  };
  Value whole = both(fits(left, dims[rank - 1]), fits(top, dims[rank - 2]));
  auto branch = scf::IfOp::create(b, loc, whole, /*withElseRegion=*/true);
  b.setInsertionPointToStart(branch.thenBlock());
  buildTile(top, left, column, row);
  b.setInsertionPointToStart(branch.elseBlock());
  buildBorder(top, left, column, row);
  return {};
}

WARP_MAKE_SCHEDULE(StageTransposes)
