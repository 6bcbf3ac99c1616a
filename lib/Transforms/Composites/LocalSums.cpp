//===- LocalSums.cpp - Sparse updates of long composites ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An adjoint adds a number to a component by adding a composite of zeros with
// that number. Where there are many components, only that one is added to.
//
//===----------------------------------------------------------------------===//

#include "PlaceLocals.h"

#include "LocalWebs.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

/// An insertion into zeros.
static warp::InsertOp getSingle(Value value) {
  auto insert = value.getDefiningOp<warp::InsertOp>();
  auto zero =
      insert ? insert.getTarget().getDefiningOp<warp::ConstructOp>() : nullptr;
  return zero && zero->getNumOperands() == 0 ? insert : nullptr;
}

/// Takes the terms of a sum apart, in their order.
static void collectTerms(Operation *sum, SmallVectorImpl<Value> &terms) {
  for (Value term : sum->getOperands()) {
    auto inner = term.getDefiningOp<warp::AddOp>();
    if (inner && term.hasOneUse() && inner->getBlock() == sum->getBlock() &&
        inner->getOperand(0).getType() == inner->getOperand(1).getType())
      collectTerms(inner, terms);
    else
      terms.push_back(term);
  }
}

void warp::addInPlace(FunctionOpInterface function) {
  SmallVector<warp::AddOp> sums;
  function.walk([&](warp::AddOp op) {
    if (warp::isLongComposite(op->getResult(0).getType()) &&
        op->getOperand(0).getType() == op->getOperand(1).getType())
      sums.push_back(op);
  });
  // The outermost first.
  for (warp::AddOp op : llvm::reverse(sums)) {
    // A part of one that has been replaced.
    if (op->use_empty()) {
      op->erase();
      continue;
    }
    SmallVector<Value> terms;
    collectTerms(op, terms);
    if (llvm::none_of(terms, getSingle))
      continue;
    OpBuilder b(op);
    auto add = [&](Value x, Value y) {
      return warp::AddOp::create(b, op.getLoc(), TypeRange(x.getType()),
                                 ValueRange{x, y})
          ->getResult(0);
    };
    Value sum;
    for (Value term : terms)
      if (!getSingle(term))
        sum = sum ? add(sum, term) : term;
    for (Value term : terms)
      if (warp::InsertOp one = getSingle(term)) {
        if (!sum) {
          sum = term;
          continue;
        }
        Value old = warp::ExtractOp::create(
            b, op.getLoc(), one.getValue().getType(), sum, one.getIndices());
        sum = warp::InsertOp::create(b, op.getLoc(), add(old, one.getValue()),
                                     sum, one.getIndices());
      }
    op->getResult(0).replaceAllUsesWith(sum);
    op->erase();
  }
  function.walk([](warp::InsertOp op) {
    if (op->use_empty())
      op->erase();
  });
}
