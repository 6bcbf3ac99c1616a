//===- Batches.cpp - Batched linear systems of CPU blocks -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The factor of a small matrix is a chain of pivots, in which vectors are idle
// most of the time. Blocks do not wait for each other, so as many as a vector
// has lanes go through the kernel together: each of its parts between factors
// and solves is a loop over them, and these are one call for all. That needs
// memory for each of the blocks. A value that a block uses later is computed
// again, or is kept there, too, if that cannot be done.
//
//===----------------------------------------------------------------------===//

#include "Batches.h"

#include "Analysis/Forms.h"
#include "KernelFunction.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;
using warp::Batches;
using warp::SystemCalls;

/// Bytes of a worker's stack, and of a cache line.
constexpr int64_t mostBytes = 512 << 10, line = 64;

/// True if blocks may run an operation in turn, with others in between: not if
/// it may wait for another block, or has memory of the thread.
static bool mayTakeTurns(Operation *op) {
  if (isa<scf::WhileOp, warp::ScratchOp, warp::AtomicCasOp>(op))
    return false;
  if (auto call = dyn_cast<warp::LibraryCallOp>(op))
    return call.getNumResults() == 0;
  if (isa<warp::AtomicComponentsOp>(op))
    return op->use_empty();
  return true;
}

/// Finds the numbers that parts have from parts before them and cannot compute
/// again; fails if memory has no form of one.
class KeptNumbers {
public:
  KeptNumbers(ArrayRef<warp::BatchPart> parts, Block *block) : block(block) {
    for (auto [i, part] : llvm::enumerate(parts))
      for (Operation *op : part.ops)
        partOf[op] = i;
  }

  LogicalResult find(ArrayRef<warp::BatchPart> parts) {
    for (auto [i, part] : llvm::enumerate(parts))
      for (Operation *op : part.ops)
        if (!warp::isRepeated(op))
          op->walk([&](Operation *inner) {
            for (Value operand : inner->getOperands())
              visit(operand, i);
          });
    return success(llvm::all_of(found, [](Value value) {
      Type type = value.getType();
      return type.isF32() || type.isF64() || type.isInteger(32) ||
             type.isInteger(64);
    }));
  }
  ArrayRef<Value> get() const { return found.getArrayRef(); }

private:
  void visit(Value value, size_t part) {
    Operation *op = value.getDefiningOp();
    if (!op || op->getBlock() != block)
      return;
    if (warp::isRepeated(op))
      for (Value operand : op->getOperands())
        visit(operand, part);
    else if (partOf.lookup(op) != part)
      found.insert(value);
  }

  Block *block;
  llvm::DenseMap<Operation *, size_t> partOf;
  llvm::SetVector<Value> found;
};

/// True if an operation after the calls reads the factor.
static bool isFactorUsed(const SystemCalls &calls, Block *block) {
  int64_t bytes = warp::getByteSize(calls.real);
  int64_t end = calls.out + calls.n * calls.n * bytes;
  auto isLater = [&](Operation *user) {
    Operation *op = block->findAncestorOpInBlock(*user);
    return !op || calls.last->isBeforeInBlock(op);
  };
  WalkResult result = block->walk([&](warp::ArrayAtOp array) {
    auto memory = array.getAddress().getDefiningOp<warp::BlockMemoryOp>();
    auto count = array.getExtents().size() == 1
                     ? warp::getConstantInteger(array.getExtents()[0])
                     : std::nullopt;
    if (!memory || !count)
      return WalkResult::interrupt();
    auto type = cast<warp::ArrayType>(array.getType());
    int64_t first = memory.getOffset();
    int64_t behind = first + *count * warp::getByteSize(type.getElementType());
    if (behind <= calls.out || first >= end)
      return WalkResult::advance();
    for (Operation *user : array->getUsers()) {
      bool isAddress = isa<warp::PointerOp>(user);
      if (isAddress ? llvm::any_of(user->getUsers(), isLater) : isLater(user))
        return WalkResult::interrupt();
    }
    return WalkResult::advance();
  });
  return result.wasInterrupted();
}

static SmallVector<warp::BatchPart> cut(Block *block) {
  SmallVector<warp::BatchPart> parts(1);
  for (Operation &op : block->without_terminator()) {
    std::optional<SystemCalls> calls = warp::findSystemCall(&op);
    if (!calls) {
      parts.back().ops.push_back(&op);
      continue;
    }
    // Pure operations in between may be computed before or after.
    bool follows = parts.size() > 1 && llvm::all_of(parts.back().ops, isPure);
    if (follows && parts[parts.size() - 2].calls->append(*calls))
      continue;
    parts.emplace_back().calls = calls;
    parts.emplace_back();
  }
  return parts;
}

bool warp::isRepeated(Operation *op) {
  return isPure(op) && op->getNumRegions() == 0;
}

std::optional<Batches> warp::findBatches(FunctionOpInterface kernel,
                                         ThreadsOp threads) {
  auto memory = kernel->getAttrOfType<IntegerAttr>(warp::attr::blockBytes);
  if (!memory || getTarget(kernel).isSimt() || getVariant(kernel).getDebug() ||
      threads.getLanes() || threads.getNumResults() != 0)
    return std::nullopt;
  Block *block = threads.getThread();
  Batches batches;
  batches.parts = cut(block);
  if (batches.parts.size() == 1)
    return std::nullopt;
  WalkResult turns = block->walk([](Operation *op) {
    return mayTakeTurns(op) ? WalkResult::advance() : WalkResult::interrupt();
  });
  KeptNumbers numbers(batches.parts, block);
  if (turns.wasInterrupted() || failed(numbers.find(batches.parts)))
    return std::nullopt;
  int64_t ownBytes = llvm::alignTo(memory.getInt(), 8);
  for (Value value : numbers.get()) {
    batches.kept[value] = ownBytes;
    ownBytes += 8;
  }
  // An odd number of lines, so that blocks lie in different sets of a cache.
  batches.blockBytes = llvm::alignTo(ownBytes, line) | line;
  int64_t scratch = 0;
  for (BatchPart &part : batches.parts)
    if (part.calls) {
      if ((part.calls->steps & SystemCalls::factors) &&
          isFactorUsed(*part.calls, block))
        part.calls->steps |= SystemCalls::keeps;
      scratch = std::max(scratch, part.calls->getScratchBytes());
    }
  batches.bytes = Batches::width * batches.blockBytes + scratch;
  if (batches.bytes > mostBytes)
    return std::nullopt;
  return batches;
}
