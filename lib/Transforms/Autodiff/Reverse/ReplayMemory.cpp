//===- ReplayMemory.cpp - Recovery of loaded values -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The adjoint of a launch runs after it. A loaded value is in the array
// still, or in a copy from before the launch, in one of both as indices tell
// (Loops/OrderedReads.cpp), or the launch has saved it, or it is in the log of
// a second run (Loops/MemoryLog.cpp).
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "Autodiff/Recording.h"
#include "Autodiff/ValueConditions.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/LoopLikeInterface.h"

using namespace mlir;

namespace warp::autodiff {

/// A loaded value may be in the log or in a copy, and no operand says where.
SmallVector<Value> ReverseBuilder::getReplayUses(Operation *op) const {
  if (Value isWritten = options.ordered.lookup(op)) {
    SmallVector<Value> uses(op->getOperands());
    uses.push_back(isWritten);
    return uses;
  }
  std::string why;
  bool needsOneThread;
  if (logTapes.contains(op) &&
      memory.getRecovery(op, why, needsOneThread) == Recovery::Impossible)
    return {options.log->loads.lookup(op).position};
  return SmallVector<Value>(op->getOperands());
}

Value ReverseBuilder::recoverPreserved(Value array) {
  return rebase(array, [&](Value root) {
    return getHidden(HiddenKind::Preserved, leaves.of(root).front(),
                     root.getType());
  });
}

/// From the array if the launch had written the element before it was read.
void ReverseBuilder::replayOrdered(AccessOp op, Value isWritten) {
  Location loc = op->getLoc();
  SmallVector<Value> indices = recover(op.getIndices());
  Value left = recover(op.getArray());
  if (primal->hasAttr(attr::unrecorded)) {
    auto load =
        LoadOp::create(builder, loc, op->getResultTypes(), left, indices);
    std::string why = "the derivative depends on array '" +
                      leaves.getName(leaves.of(op.getArray()).front()) +
                      "' as it was before the launch, record the launch on a "
                      "`wp.Tape`";
    setRecovered(op.getRead(),
                 expect(builder, recover(isWritten), load->getResult(0), why));
    return;
  }
  Value copy = recoverPreserved(op.getArray());
  auto branch = scf::IfOp::create(builder, loc, op->getResultTypes(),
                                  recover(isWritten), /*withElseRegion=*/true);
  OpBuilder::InsertionGuard guard(builder);
  for (auto [array, block] :
       {std::pair(left, branch.thenBlock()), {copy, branch.elseBlock()}}) {
    builder.setInsertionPointToEnd(block);
    auto load =
        LoadOp::create(builder, loc, op->getResultTypes(), array, indices);
    scf::YieldOp::create(builder, loc, load->getResults());
  }
  setRecovered(op.getRead(), branch.getResults());
}

LogicalResult ReverseBuilder::replayLoad(AccessOp op) {
  if (Value isWritten = options.ordered.lookup(op)) {
    replayOrdered(op, isWritten);
    return success();
  }
  std::string why;
  bool needsOneThread;
  Recovery recovery = memory.getRecovery(op, why, needsOneThread);
  if (recovery == Recovery::Impossible) {
    if (!logTapes.contains(op))
      return replaySaved(op, why);
    replayLogged(op, options.log->loads.lookup(op));
    return success();
  }
  Value array = recovery == Recovery::Preserved
                    ? recoverPreserved(op.getArray())
                    : recover(op.getArray());
  auto load = LoadOp::create(builder, op.getLoc(), op->getResultTypes(), array,
                             recover(op.getIndices()));
  if (needsOneThread)
    load->setAttr(attr::assumesOneThread, builder.getUnitAttr());
  setRecovered(op.getRead(), load->getResults());
  return success();
}

LogicalResult ReverseBuilder::replayUpdate(AccessOp op) {
  if (op->use_empty())
    return success();
  return replaySaved(op, "what an atomic returns within a loop depends on the "
                         "order of threads; move it out of the loop");
}

/// Values that the launch overwrote, or that depend on the order of threads:
/// the augmented kernel keeps it, one value per thread. A loop would have to
/// keep one per iteration; there it is marked with the reason for an error.
LogicalResult ReverseBuilder::replaySaved(Operation *op, StringRef why) {
  Location loc = op->getLoc();
  Type type = op->getResult(0).getType();
  Value array;
  SmallVector<Value> indices;
  bool isSaved = !op->getParentOfType<LoopLikeOpInterface>();
  if (isSaved) {
    array = getHidden(HiddenKind::Saved, memory.getNumber(op),
                      ArrayType::get(type.getContext(), 4, type));
    SmallVector<Type> types(4, builder.getIntegerType(32, true));
    llvm::append_range(indices,
                       TidOp::create(builder, loc, types).getResults());
  } else {
    auto access = cast<AccessOp>(op);
    array = recover(access.getArray());
    indices = recover(access.getIndices());
  }
  auto load = LoadOp::create(builder, loc, type, array, indices);
  if (!isSaved)
    load->setAttr(attr::unrecoverable, builder.getStringAttr(why));
  setRecovered(op->getResult(0), load.getResult());
  return success();
}

/// Adds the arguments that hold what loads in loops have read, in the order in
/// which the recording function has them.
void ReverseBuilder::addLog() {
  if (!options.log)
    return;
  MLIRContext *context = builder.getContext();
  Location loc = primal.getLoc();
  Type number = builder.getIntegerType(64, true);
  Type perThread = ArrayType::get(context, 4, number);
  SmallVector<Type> types(4, builder.getIntegerType(32, true));
  auto thread = TidOp::create(builder, loc, types);
  for (int64_t site = 0; site < options.log->sites; ++site) {
    Value offsets = addHidden(HiddenKind::Offsets, site, perThread);
    logOffsets.push_back(
        LoadOp::create(builder, loc, number, offsets, thread.getResults()));
  }
  // The recording reads those, too.
  for (auto &[op, number] : options.log->returned)
    getHidden(HiddenKind::Saved, number,
              ArrayType::get(context, 4, op->getResult(0).getType()));
  for (auto &[load, logged] : options.log->loads) {
    Type type = load->getResult(0).getType();
    auto hidden =
        HiddenAttr::get(context, HiddenKind::Tape, logged.site, logged.ordinal);
    logTapes[load] =
        autodiff::addHidden(adjoint, hidden, ArrayType::get(context, 2, type));
    metrics.tapeBytesPerTrip += getByteSize(type);
  }
}

void ReverseBuilder::replayLogged(Operation *op, const LoggedLoad &logged) {
  Location loc = op->getLoc();
  Value offset = logOffsets[logged.site];
  SmallVector<Value> sum{offset, recover(logged.position)};
  Value at = AddOp::create(builder, loc, TypeRange(offset.getType()), sum)
                 ->getResult(0);
  at = CastOp::create(builder, loc, builder.getI64Type(), at);
  auto load =
      LoadOp::create(builder, loc, op->getResult(0).getType(),
                     logTapes.lookup(op), getTapeIndices(builder, loc, at));
  setRecovered(op->getResult(0), load.getResult());
}

} // namespace warp::autodiff
