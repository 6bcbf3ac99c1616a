//===- GuardArms.cpp - Guarded evaluation of select operands --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `x if f else x / t` computes both arms, and its adjoint sends a cotangent of
// zero into the one that was not chosen. If t is zero there, zero times
// infinity is not zero. So before a kernel is differentiated, a choice whose
// arms hold operations with infinite derivatives becomes a branch, and what
// only one arm uses moves into it. Elsewhere a select is cheaper.
//
//===----------------------------------------------------------------------===//

#include "GuardArms.h"

#include "Autodiff/Activity.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/SetVector.h"

using namespace mlir;

namespace warp::autodiff {

/// Derivatives of these are finite wherever their operands are.
static bool isTame(Operation *op) {
  return llvm::none_of(op->getResultTypes(), hasDerivative) ||
         isa<AddOp, SubOp, MulOp, NegOp, PosOp, WhereOp, MinOp, MaxOp, AbsOp,
             ClampOp, SinOp, CosOp, ConstantOp, ConstructOp, ExtractOp,
             InsertOp, CastOp, DotOp, CrossOp, arith::SelectOp,
             arith::ConstantOp>(op);
}

/// The operations that only arm number `arm` of the choice uses, in program
/// order. The operations are in the block of the choice and can move.
static SmallVector<Operation *> getExclusive(Operation *choice, unsigned arm) {
  llvm::SetVector<Operation *> found;
  Block *block = choice->getBlock();
  auto isOnlyUsedHere = [&](Operation *op) {
    return llvm::all_of(op->getUses(), [&](OpOperand &use) {
      Operation *user = block->findAncestorOpInBlock(*use.getOwner());
      return user == choice ? use.getOperandNumber() == arm
                            : found.contains(user);
    });
  };
  for (Operation *op = choice->getPrevNode(); op; op = op->getPrevNode())
    if (!op->use_empty() && isMemoryEffectFree(op) && !isa<TidOp>(op) &&
        isOnlyUsedHere(op))
      found.insert(op);
  SmallVector<Operation *> ordered = found.takeVector();
  std::reverse(ordered.begin(), ordered.end());
  return ordered;
}

static void makeBranch(Operation *choice,
                       ArrayRef<SmallVector<Operation *>> arms) {
  OpBuilder builder(choice);
  Location loc = choice->getLoc();
  Value condition = choice->getOperand(0);
  if (!isBool(condition.getType()))
    condition = CastOp::create(builder, loc, builder.getI1Type(), condition);
  auto branch = scf::IfOp::create(builder, loc, choice->getResultTypes(),
                                  condition, /*withElseRegion=*/true);
  for (unsigned i : {0, 1}) {
    Block &block = branch->getRegion(i).front();
    for (Operation *op : arms[i])
      op->moveBefore(&block, block.end());
    builder.setInsertionPointToEnd(&block);
    scf::YieldOp::create(builder, loc, choice->getOperand(i + 1));
  }
  choice->getResult(0).replaceAllUsesWith(branch.getResult(0));
  choice->erase();
}

void guardArms(Operation *function) {
  SmallVector<Operation *> choices;
  function->walk([&](Operation *op) {
    if (isa<WhereOp, arith::SelectOp>(op) &&
        hasDerivative(op->getResult(0).getType()))
      choices.push_back(op);
  });
  // A choice within an arm comes before the choice that it is for.
  for (Operation *choice : llvm::reverse(choices)) {
    SmallVector<Operation *> arms[] = {getExclusive(choice, 1),
                                       getExclusive(choice, 2)};
    if (!llvm::all_of(arms[0], isTame) || !llvm::all_of(arms[1], isTame))
      makeBranch(choice, arms);
  }
}

} // namespace warp::autodiff
