//===- WrongRewrites.cpp - Replacements of incorrect LLVM rewrites --------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WrongRewrites.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Transforms/RegionUtils.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;

namespace {

/// Values that a loop forwards to its body and, in the end, to its results.
class HandedOn {
public:
  /// The position of a value; it is added if it is not there.
  unsigned add(Value value) {
    values.insert(value);
    return unsigned(llvm::find(values, value) - values.begin());
  }
  ArrayRef<Value> get() const { return values.getArrayRef(); }

private:
  llvm::SetVector<Value> values;
};

/// A branch that ends the condition of a loop, and is taken where the loop goes
/// on, becomes part of the body.
///
///     while                               while
///       r = if c { a(x) } else { b }  =>    condition c, b, x
///       condition c, r                    do (b', x')
///     do (r')                               body(a(x'))
///       body(r')
struct MoveBranchIntoBody : OpRewritePattern<scf::WhileOp> {
  using OpRewritePattern::OpRewritePattern;

  LogicalResult matchAndRewrite(scf::WhileOp loop,
                                PatternRewriter &rewriter) const override {
    scf::ConditionOp condition = loop.getConditionOp();
    auto branch = dyn_cast_or_null<scf::IfOp>(condition->getPrevNode());
    if (!branch || branch.getCondition() != condition.getCondition() ||
        (branch.elseBlock() &&
         !branch.elseBlock()->without_terminator().empty()))
      return failure();

    HandedOn handedOn;
    // For each result of the loop where it is now, once the loop has ended.
    SmallVector<unsigned> ends;
    for (auto [arg, result] :
         llvm::zip(condition.getArgs(), loop.getResults())) {
      auto made = dyn_cast<OpResult>(arg);
      if (!made || made.getOwner() != branch)
        ends.push_back(handedOn.add(arg));
      else if (result.use_empty())
        ends.push_back(0);
      else
        ends.push_back(handedOn.add(
            branch.elseYield().getOperand(made.getResultNumber())));
    }
    // The operands that the branch takes from the condition, in its order.
    llvm::SetVector<Value> used;
    getUsedValuesDefinedAbove(branch.getThenRegion(), used);
    for (Value result : branch.thenYield().getOperands())
      used.insert(result);
    auto isOfCondition = [&](Value value) {
      return value.getParentBlock() == loop.getBeforeBody();
    };
    SmallVector<std::pair<Value, unsigned>> taken;
    for (Value value : used)
      if (isOfCondition(value))
        taken.push_back({value, handedOn.add(value)});

    Location loc = loop.getLoc();
    SmallVector<Type> types(ValueRange(handedOn.get()).getTypes());
    auto moved = scf::WhileOp::create(rewriter, loc, types, loop.getInits());
    Block *body = rewriter.createBlock(
        &moved.getAfter(), {}, types, SmallVector<Location>(types.size(), loc));
    for (auto [value, at] : taken)
      rewriter.replaceUsesWithIf(value, body->getArgument(at),
                                 [&](OpOperand &use) {
                                   return branch.getThenRegion().isAncestor(
                                       use.getOwner()->getParentRegion());
                                 });
    SmallVector<Value> arguments;
    for (auto [i, arg] : llvm::enumerate(condition.getArgs())) {
      auto made = dyn_cast<OpResult>(arg);
      arguments.push_back(
          made && made.getOwner() == branch
              ? branch.thenYield().getOperand(made.getResultNumber())
              : Value(body->getArgument(ends[i])));
    }
    rewriter.eraseOp(branch.thenYield());
    rewriter.mergeBlocks(branch.thenBlock(), body);
    rewriter.mergeBlocks(loop.getAfterBody(), body, arguments);

    rewriter.setInsertionPoint(condition);
    scf::ConditionOp::create(rewriter, condition.getLoc(),
                             condition.getCondition(), handedOn.get());
    rewriter.eraseOp(condition);
    rewriter.eraseOp(branch);
    rewriter.inlineRegionBefore(loop.getBefore(), moved.getBefore(),
                                moved.getBefore().end());
    for (auto [result, end] : llvm::zip(loop.getResults(), ends))
      if (!result.use_empty())
        rewriter.replaceAllUsesWith(result, moved.getResult(end));
    rewriter.eraseOp(loop);
    return success();
  }
};

} // namespace

void warp::addRightRewrites(RewritePatternSet &patterns) {
  patterns.add<MoveBranchIntoBody>(patterns.getContext());
}
