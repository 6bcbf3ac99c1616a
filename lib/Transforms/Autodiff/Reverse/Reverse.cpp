//===- Reverse.cpp - The adjoint of a kernel ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One thread of a kernel maps array elements to array elements; one thread of
// its adjoint maps gradients of the elements written to gradients of those
// read. It runs after the launch, with the same arguments, and writes only
// gradients. Its body has two sweeps:
//
//   forward   what the kernel computes, without its effects: the values that
//             partial derivatives and control flow need. `replay` clones all of
//             it and leaves it to dead code elimination to drop the rest, so
//             what is needed is never guessed.
//   reverse   operations backwards, each turning cotangents of its results
//             into cotangents of its operands by a rule of Rules.h.
//
// Within a branch or a loop body the two sweeps happen again on a smaller
// scale: the region of the reverse operation replays its block, then walks it
// backwards. So a value is recomputed next to where it is used, and the sweep
// before only recomputes what leaves a region.
//
//   operation               forward                    reverse
//   builtin, value op       cloned                     its rule
//   scf.if                  cloned                     ReverseBranches.cpp
//   scf.for, scf.while      cloned                     ReverseLoops.cpp
//   load, store, atomic     read again, or read where  ReverseMemory.cpp,
//                           the contents were kept:    ReverseExtrema.cpp
//                           ReplayMemory.cpp
//   call                    cloned                     ReverseCalls.cpp
//
// Cotangents are SSA values in a map from primal values; one that is absent is
// zero and costs nothing. A value that cannot be recovered, such as an element
// that the launch overwrote, becomes a marked operation; warp-clean-up-adjoint,
// after dead code is gone, reports the marks that are left.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "Autodiff/SpectralProducts.h"

#include "WarpDialect/TileOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

ReverseBuilder::ReverseBuilder(func::FuncOp primal, func::FuncOp adjoint,
                               const ReverseOptions &options)
    : builder(adjoint.getContext()), options(options), primal(primal),
      adjoint(adjoint), leaves(primal),
      activity(primal, leaves, options.active),
      memory(primal, leaves, activity, options.unique) {}

LogicalResult ReverseBuilder::build() {
  if (options.log)
    memory.trust(options.log->checked);
  if (failed(memory.verify()))
    return failure();
  Block &body = primal.getBody().front();
  builder.setInsertionPointToStart(&adjoint.getBody().front());
  setRecovered(body.getArguments(),
               adjoint.getArguments().take_front(body.getNumArguments()));
  addLog();
  if (failed(replay(body)) || failed(reverse(body)))
    return failure();
  // These are gradients, not the tangents that a derivative of the adjoint
  // would take them for.
  adjoint.walk([](ArrayAtOp at) { at.getGradMutable().clear(); });
  func::ReturnOp::create(builder, primal.getLoc());
  return success();
}

//===----------------------------------------------------------------------===//
// Forward sweep
//===----------------------------------------------------------------------===//

Value ReverseBuilder::recover(Value primal) const {
  Value recovered = values.lookup(primal);
  assert(recovered && "a value of the forward sweep is missing");
  return recovered;
}

SmallVector<Value> ReverseBuilder::recover(ValueRange primals) const {
  return llvm::map_to_vector(primals, [&](Value v) { return recover(v); });
}

void ReverseBuilder::setRecovered(ValueRange primals, ValueRange recovered) {
  for (auto [from, to] : llvm::zip_equal(primals, recovered))
    setRecovered(from, to);
}

LogicalResult ReverseBuilder::replay(Block &block) {
  for (Operation &op : block.without_terminator())
    if (failed(replay(&op)))
      return failure();
  return success();
}

/// True if values that the forward sweep loads again are stored within.
static bool storesScratch(Operation *op) {
  return op->walk([](ScratchStoreOp) { return WalkResult::interrupt(); })
      .wasInterrupted();
}

LogicalResult ReverseBuilder::replay(Operation *op) {
  // An operation without results only has effects.
  if (op->getNumResults() == 0 && !storesScratch(op))
    return success();
  if (auto access = dyn_cast<AccessOp>(op))
    return access.mayWrite() ? replayUpdate(access) : replayLoad(access);
  if (auto access = dyn_cast<TileAccessOp>(op))
    return replayTileAccess(access);
  if (op->getNumRegions() != 0)
    return replayRegions(op);
  if (auto call = dyn_cast<func::CallOp>(op))
    return replayCall(call);
  Operation *clone = op->cloneWithoutRegions();
  clone->setOperands(recover(op->getOperands()));
  builder.insert(clone);
  setRecovered(op->getResults(), clone->getResults());
  replayWide(op);
  return success();
}

/// The value as rules take it: f32 for 16-bit floats.
Value ReverseBuilder::recoverWide(Value primal) {
  if (Value wide = wideValues.lookup(primal))
    return wide;
  return widen(builder, primal.getLoc(), recover(primal));
}

/// Partial derivatives take values unrounded that the program rounds to 16
/// bits: a product of small numbers that is zero in 16 bits has a derivative.
/// Conditions and indices still come from the rounded values.
void ReverseBuilder::replayWide(Operation *op) {
  if (op->getNumResults() != 1 || !isDifferentiable(op))
    return;
  Value result = op->getResult(0);
  Type type = differentialType(result.getType());
  if (!type || type == result.getType())
    return;
  SmallVector<Value> operands = llvm::map_to_vector(
      op->getOperands(), [&](Value operand) { return recoverWide(operand); });
  if (isa<CastOp>(op) && operands[0].getType() == type) {
    wideValues[result] = operands[0];
    return;
  }
  Operation *wide =
      Operation::create(op->getLoc(), op->getName(), type, operands,
                        op->getDiscardableAttrDictionary(),
                        op->getPropertiesStorage(), BlockRange(), 0);
  wideValues[result] = builder.insert(wide)->getResult(0);
}

LogicalResult ReverseBuilder::replayRegions(Operation *op) {
  Operation *clone = op->cloneWithoutRegions();
  clone->setOperands(recover(op->getOperands()));
  builder.insert(clone);
  OpBuilder::InsertionGuard guard(builder);
  for (auto [from, to] : llvm::zip_equal(op->getRegions(), clone->getRegions()))
    for (Block &block : from) {
      Block *copy = builder.createBlock(&to);
      for (BlockArgument argument : block.getArguments())
        setRecovered(argument,
                     copy->addArgument(argument.getType(), argument.getLoc()));
      if (failed(replay(block)))
        return failure();
      Operation *end = block.getTerminator()->cloneWithoutRegions();
      end->setOperands(recover(block.getTerminator()->getOperands()));
      builder.insert(end);
    }
  setRecovered(op->getResults(), clone->getResults());
  return success();
}

//===----------------------------------------------------------------------===//
// Cotangents
//===----------------------------------------------------------------------===//

void ReverseBuilder::addCotangent(Value primal, Value cotangent) {
  if (cotangent && isActive(primal))
    cotangents.add(builder, primal.getLoc(), primal, cotangent);
}

Value ReverseBuilder::takeCotangent(Value primal) {
  return cotangents.take(builder, primal.getLoc(), primal);
}

Value ReverseBuilder::zeroCotangent(Value primal) {
  return zero(builder, primal.getLoc(), differentialType(primal.getType()));
}

Value ReverseBuilder::takeCotangentOrZero(Value primal) {
  Value cotangent = takeCotangent(primal);
  return cotangent ? cotangent : zeroCotangent(primal);
}

FailureOr<ReverseBuilder::Captures>
ReverseBuilder::inScope(function_ref<LogicalResult()> body) {
  Cotangents outer = std::exchange(cotangents, {});
  LogicalResult result = body();
  Captures captures;
  for (Value primal : cotangents.getPrimals())
    captures.emplace_back(primal, takeCotangent(primal));
  cotangents = std::move(outer);
  if (failed(result))
    return failure();
  return captures;
}

//===----------------------------------------------------------------------===//
// Reverse sweep
//===----------------------------------------------------------------------===//

LogicalResult ReverseBuilder::reverse(Block &block) {
  return reverseUpTo(block, block.back().getIterator());
}

LogicalResult ReverseBuilder::reverseUpTo(Block &block, Block::iterator end) {
  for (Operation &op : llvm::reverse(llvm::make_range(block.begin(), end))) {
    if (isOnlySource(&op))
      return reverseAsWinner(cast<AccessOp>(op));
    if (failed(reverse(&op)))
      return failure();
  }
  return success();
}

LogicalResult ReverseBuilder::reverse(Operation *op) {
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return reverseIf(branch);
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return reverseFor(*this, loop);
  if (auto loop = dyn_cast<scf::WhileOp>(op))
    return reverseWhile(*this, loop);
  if (auto access = dyn_cast<AccessOp>(op))
    return reverseAccess(access);
  if (auto call = dyn_cast<func::CallOp>(op))
    return reverseCall(call);
  if (isTileOp(op))
    return reverseTile(*this, op);
  // Exchanges between threads around it are refused where they are read.
  if (isa<BarrierOp>(op))
    return success();
  if (auto extract = dyn_cast<ExtractOp>(op))
    if (addSlots(extract))
      return success();
  if (auto load = dyn_cast<ScratchLoadOp>(op))
    return reverseScratchLoad(load);
  return reverseByRule(op);
}

/// Constant indices say which components a cotangent belongs to.
bool ReverseBuilder::addSlots(ExtractOp op) {
  std::optional<int64_t> first = getFirstSlot(op);
  if (!first)
    return false;
  Value cotangent = takeCotangent(op.getResult());
  if (!cotangent || !isActive(op.getSource()))
    return true;
  Location loc = op.getLoc();
  Type type = cotangent.getType();
  if (!isComposite(type)) {
    cotangents.addSlot(builder, loc, op.getSource(), *first, cotangent);
    return true;
  }
  for (int64_t i = 0, e = getComponentCount(type); i < e; ++i) {
    Value part =
        ExtractOp::create(builder, loc, getElementScalar(type), cotangent,
                          getSlotIndices(builder, loc, type, i));
    cotangents.addSlot(builder, loc, op.getSource(), *first + i, part);
  }
  return true;
}

RuleContext ReverseBuilder::getContext(Operation *op) {
  RuleContext context{builder, op->getLoc(), options.singular};
  if (options.singular == Singular::Report)
    context.report = [this, op](Value isSingular) {
      countSingular(op->getLoc(), isSingular);
    };
  context.turnsMatter = !op->hasAttr(completeAttrName);
  return context;
}

LogicalResult ReverseBuilder::reverseByRule(Operation *op) {
  SmallVector<Value> cots = llvm::map_to_vector(
      op->getResults(), [&](Value result) { return takeCotangent(result); });
  SmallVector<bool> wanted = llvm::map_to_vector(
      op->getOperands(), [&](Value operand) { return isActive(operand); });
  if (!llvm::any_of(cots, [](Value g) { return bool(g); }) ||
      !llvm::is_contained(wanted, true))
    return success();
  SmallVector<Value> operands, results;
  for (Value operand : op->getOperands())
    operands.push_back(recoverWide(operand));
  for (Value result : op->getResults())
    results.push_back(needsResults(op) ? recoverWide(result) : Value());
  RuleContext context = getContext(op);
  auto grads = pullback(context, op, operands, results, cots, wanted);
  if (failed(grads))
    return failure();
  for (auto [operand, grad] : llvm::zip_equal(op->getOperands(), *grads))
    addCotangent(operand, grad);
  return success();
}

/// Memory in which the adjoint of a loop keeps its values has no gradient.
LogicalResult ReverseBuilder::reverseScratchLoad(ScratchLoadOp op) {
  if (!takeCotangent(op.getResult()) || !isActive(op.getResult()))
    return success();
  return op.emitError("the adjoint of an adjoint does not go through values "
                      "that a loop keeps: use 'wp.hessian' of the function");
}

void ReverseBuilder::countSingular(Location loc, Value isSingular) {
  auto counters = getHidden(HiddenKind::Counters, -1,
                            ArrayType::get(builder.getContext(), 1,
                                           builder.getIntegerType(32, true)));
  countOne(builder, loc, isSingular, counters, singularPlaces);
}

} // namespace warp::autodiff
