//===- ReverseBranches.cpp - The adjoint of scf.if ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The reverse of a branch tests the condition that the forward sweep computed,
// never a second version of it that might round otherwise. Either side yields
// what it contributes to values outside of it.
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

/// The captures of both sides: which values get a contribution from any.
static SmallVector<Value>
unite(ArrayRef<ReverseBuilder::Captures> sides) {
  llvm::SetVector<Value> values;
  for (const ReverseBuilder::Captures &side : sides)
    for (auto &[value, cotangent] : side)
      values.insert(value);
  return values.takeVector();
}

LogicalResult ReverseBuilder::reverseIf(scf::IfOp op) {
  SmallVector<Value> incoming = llvm::map_to_vector(
      op.getResults(), [&](Value result) { return takeCotangent(result); });
  Location loc = op.getLoc();
  auto draft =
      scf::IfOp::create(builder, loc, TypeRange(),
                        recover(op.getCondition()), /*withElseRegion=*/true);
  // Threads that returned have nothing to reverse of what came after.
  if (Attribute side = op->getAttr(warp::attr::stays))
    draft->setAttr(warp::attr::stays, side);
  OpBuilder::InsertionGuard guard(builder);
  SmallVector<Captures, 2> sides;
  for (auto [from, to] :
       llvm::zip_equal(op->getRegions(), draft->getRegions())) {
    builder.setInsertionPointToStart(&to.front());
    auto side = inScope([&]() -> LogicalResult {
      if (from.empty())
        return success();
      Block &block = from.front();
      if (failed(replay(block)))
        return failure();
      for (auto [value, cotangent] :
           llvm::zip(block.getTerminator()->getOperands(), incoming))
        addCotangent(value, cotangent);
      return reverse(block);
    });
    if (failed(side))
      return failure();
    sides.push_back(std::move(*side));
  }
  finishIf(draft, sides);
  return success();
}

/// Gives the branch results: the contributions of its sides.
void ReverseBuilder::finishIf(scf::IfOp draft, ArrayRef<Captures> sides) {
  SmallVector<Value> captured = unite(sides);
  builder.setInsertionPoint(draft);
  SmallVector<Type> types = llvm::map_to_vector(
      captured, [](Value v) { return differentialType(v.getType()); });
  auto branch = scf::IfOp::create(builder, draft.getLoc(), types,
                                  draft.getCondition(), true);
  if (Attribute side = draft->getAttr(warp::attr::stays))
    branch->setAttr(warp::attr::stays, side);
  for (auto [i, side] : llvm::enumerate(sides)) {
    Region &region = branch->getRegion(i);
    region.takeBody(draft->getRegion(i));
    builder.setInsertionPointToEnd(&region.front());
    if (region.front().mightHaveTerminator())
      region.front().getTerminator()->erase();
    SmallVector<Value> yields;
    for (Value value : captured) {
      auto *found = llvm::find_if(
          side, [&](auto &capture) { return capture.first == value; });
      yields.push_back(found == side.end() ? zeroCotangent(value)
                                           : found->second);
    }
    scf::YieldOp::create(builder, draft.getLoc(), yields);
  }
  draft.erase();
  builder.setInsertionPointAfter(branch);
  for (auto [value, cotangent] : llvm::zip_equal(captured, branch.getResults()))
    addCotangent(value, cotangent);
}

} // namespace warp::autodiff
