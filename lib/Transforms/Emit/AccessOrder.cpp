//===- AccessOrder.cpp - Order of a thread's own accesses -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads are independent, so the loop over them is marked parallel, and LLVM
// vectorises it without asking whether arrays overlap. But it draws too much
// from that mark: it also moves interleaved accesses (components of one
// element, say) of one thread across each other,
//
//   a = x[i][0];  y[i][1] = 7;  b = x[i][1]
//
// where `x` and `y` may be the same array. So the mark is set only if no two
// loads that may be combined have a write between them, and no two writes an
// access. Loads of what was just stored are replaced first; after that, the
// usual kernel (loads, arithmetic, stores) is rarely refused.
//
// Updates of an entry that runs alone, `x[i + 1] += v`, meet those of other
// threads, but one update of neighbouring threads touches neighbouring
// elements. Lanes that perform it together do not meet, and which of two
// updates comes first is open.
//
//===----------------------------------------------------------------------===//

#include "AccessOrder.h"

#include "Analysis/ArrayOrigins.h"
#include "ArrayLowering.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;

//===----------------------------------------------------------------------===//
// Forwarding
//===----------------------------------------------------------------------===//

static void forwardStores(Block &block) {
  warp::StoreComponentsOp last;
  for (Operation &op : llvm::make_early_inc_range(block)) {
    if (auto store = dyn_cast<warp::StoreComponentsOp>(op)) {
      last = store;
      continue;
    }
    auto load = dyn_cast<warp::LoadComponentsOp>(op);
    if (!load) {
      if (!isMemoryEffectFree(&op))
        last = nullptr;
      continue;
    }
    if (!last || last.getArray() != load.getArray() ||
        !llvm::equal(last.getIndices(), load.getIndices()))
      continue;
    load.replaceAllUsesWith(SmallVector<Value>(last.getComponents()));
    load.erase();
  }
}

void warp::forwardStores(Operation *entry) {
  SmallVector<Block *> blocks;
  entry->walk([&](Block *block) { blocks.push_back(block); });
  for (Block *block : blocks)
    ::forwardStores(*block);
}

//===----------------------------------------------------------------------===//
// Order
//===----------------------------------------------------------------------===//

namespace {
struct Access {
  bool isWrite;
  /// The array that views were taken of.
  Value root;
  Value array;
  SmallVector<Value, 2> indices;
};
} // namespace

/// Whether the next thread's index is this one plus 1.
static bool hasUnitStep(Value index) {
  Operation *op = index.getDefiningOp();
  if (auto trunc = dyn_cast_or_null<arith::TruncIOp>(op))
    return trunc.getOverflowFlags() != arith::IntegerOverflowFlags::none;
  if (isa_and_nonnull<arith::AddIOp>(op))
    return hasUnitStep(op->getOperand(0)) || hasUnitStep(op->getOperand(1));
  if (isa_and_nonnull<arith::SubIOp>(op))
    return hasUnitStep(op->getOperand(0));
  return false;
}

/// Whether every thread reads or writes one number next to its neighbour's, so
/// that there is nothing to combine.
static bool isDense(const Access &access) {
  auto type = cast<warp::ArrayType>(access.array.getType());
  return access.array == access.root && warp::isScalar(type.getElementType()) &&
         !access.indices.empty() && hasUnitStep(access.indices.back());
}

static bool mayCombine(const Access &a, const Access &b) {
  return a.isWrite == b.isWrite && a.root == b.root &&
         !(isDense(a) && isDense(b));
}

/// Kernels with more accesses are not worth the search.
constexpr size_t maxAccesses = 256;

/// Accesses in the order of execution. A loop counts as two iterations, which
/// is what LLVM would see of it, unrolled.
static void collect(Region &region, bool updates,
                    SmallVectorImpl<Access> &accesses) {
  for (Block &block : region)
    for (Operation &op : block) {
      if (accesses.size() > maxAccesses)
        return;
      auto access = dyn_cast<warp::AccessOp>(op);
      for (bool isWrite : {false, true}) {
        bool counts = access && (updates || !access.isUpdate());
        if (counts && (isWrite ? access.mayWrite() : access.mayRead()))
          accesses.push_back({isWrite, warp::rootOf(access.getArray()),
                              access.getArray(),
                              SmallVector<Value, 2>(access.getIndices())});
      }
      for (int i = 0; i < (isa<LoopLikeOpInterface>(op) ? 2 : 1); ++i)
        for (Region &nested : op.getRegions())
          collect(nested, updates, accesses);
    }
}

bool warp::keepsOrderInVectors(Operation *entry, bool updates) {
  SmallVector<Access> accesses;
  collect(entry->getRegion(0), updates, accesses);
  if (accesses.size() > maxAccesses)
    return false;
  for (size_t last = 0; last < accesses.size(); ++last) {
    bool seenRead = false, seenWrite = false;
    for (size_t i = last; i-- > 0;) {
      const Access &first = accesses[i];
      bool inTheWay = accesses[last].isWrite ? seenRead || seenWrite
                                             : seenWrite;
      if (inTheWay && mayCombine(first, accesses[last]))
        return false;
      seenRead |= !first.isWrite;
      seenWrite |= first.isWrite;
    }
  }
  return true;
}

//===----------------------------------------------------------------------===//
// Updates
//===----------------------------------------------------------------------===//

/// Whether a value is the same for all threads.
static bool isUniform(Value value, int depth = 4) {
  Operation *op = value.getDefiningOp();
  if (!op || depth == 0)
    return false;
  if (op->hasTrait<OpTrait::ConstantLike>() || isa<warp::ParameterOp>(op))
    return true;
  return isa<warp::DimOp, arith::AddIOp, arith::SubIOp, arith::MulIOp>(op) &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return isUniform(operand, depth - 1);
         });
}

/// Whether an index is that of the loop over threads, whose body is `loop`,
/// plus something that is the same for all.
static bool followsThreads(Value index, Block *loop, int depth = 4) {
  Operation *op = index.getDefiningOp();
  if (!op || depth == 0)
    return false;
  auto follows = [&](unsigned i) {
    return followsThreads(op->getOperand(i), loop, depth - 1);
  };
  if (auto trunc = dyn_cast<arith::TruncIOp>(op))
    return trunc.getOverflowFlags() != arith::IntegerOverflowFlags::none &&
           trunc.getIn() == loop->getArgument(0);
  if (isa<arith::AddIOp>(op))
    return (follows(0) && isUniform(op->getOperand(1))) ||
           (follows(1) && isUniform(op->getOperand(0)));
  return isa<arith::SubIOp>(op) && follows(0) &&
         isUniform(op->getOperand(1));
}

bool warp::updatesNeighbours(Operation *entry) {
  WalkResult result = entry->walk([&](AtomicComponentsOp op) {
    Value array = op.getArray();
    auto type = cast<ArrayType>(array.getType());
    Block *loop =
        entry->getRegion(0).findAncestorBlockInRegion(*op->getBlock());
    // A wrapped index could meet the last ones.
    bool apart = rootOf(array) == array && isScalar(type.getElementType()) &&
                 loop->getNumArguments() == 1 && !op.getIndices().empty() &&
                 followsThreads(op.getIndices().back(), loop) &&
                 isNonNegative(op.getIndices().back(), op->getBlock());
    return apart ? WalkResult::advance() : WalkResult::interrupt();
  });
  return !result.wasInterrupted();
}
