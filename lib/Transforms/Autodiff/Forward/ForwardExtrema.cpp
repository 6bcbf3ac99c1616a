//===- ForwardExtrema.cpp - Tangents of atomic minima and maxima ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Several threads may update one element, and the launch has to end before the
// extremum among their values is known. So a second launch computes the values
// again, without writing any, and the thread that finds its own in the array
// assigns its tangents. Among several with that value the first one does, as in
// reverse mode: it claims the element by an exchange. The value that the first
// launch left in the twin is overwritten, unless the array had the extremum
// before.
//
// That is right if the second launch reads what the first one read. A kernel
// that reads what it writes is an error here.
//
//===----------------------------------------------------------------------===//

#include "Autodiff/Reverse/Cotangents.h"
#include "Forward.h"
#include "Autodiff/MemoryClasses.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

static bool isExtremum(Operation *op) {
  auto access = dyn_cast<AccessOp>(op);
  auto kind = access ? access.getCombination() : std::nullopt;
  return kind == AtomicKind::min || kind == AtomicKind::max;
}

void splitExtrema(func::FuncOp kernel) {
  SmallVector<AtomicOp> atomics;
  kernel.walk([&](AtomicOp op) {
    Type type = op.getValue().getType();
    if (isExtremum(op) && isComposite(type) && differentialType(type))
      atomics.push_back(op);
  });
  for (AtomicOp op : atomics) {
    OpBuilder builder(op);
    Location loc = op.getLoc();
    Type type = op.getValue().getType(), scalar = getElementScalar(type);
    int64_t rank = cast<ArrayType>(op.getArray().getType()).getRank();
    Type part = ArrayType::get(op.getContext(), rank, scalar);
    SmallVector<Value> old;
    for (int64_t i = 0, n = getComponentCount(type); i < n; ++i) {
      auto at = getSlotIndices(builder, loc, type, i);
      Value view = ComponentViewOp::create(builder, loc, part, op.getArray(),
                                           at, StringAttr());
      Value value =
          ExtractOp::create(builder, loc, scalar, op.getValue(), at);
      old.push_back(AtomicOp::create(builder, loc, scalar, op.getKind(), value,
                                     view, op.getIndices()));
    }
    if (!op->use_empty())
      op.getOld().replaceAllUsesWith(
          ConstructOp::create(builder, loc, type, old).getResult());
    op->erase();
  }
}

/// For an array's elements: one integer for each component, null if there is no
/// such type.
static Type getClaimType(Type element) {
  if (!isScalar(element) && !isa<VecType, MatType>(element))
    return {};
  Type integer = IntegerType::get(element.getContext(), 32,
                                  IntegerType::SignednessSemantics::Signed);
  return isScalar(element) ? integer : withElementScalar(element, integer);
}

void ForwardBuilder::collectUpdates() {
  updates.resize(leaves.size());
  claims.resize(leaves.size());
  primal.walk([&](Operation *op) {
    if (auto call = dyn_cast<func::CallOp>(op)) {
      auto callee = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
          call, call.getCalleeAttr());
      if (callee.isExternal())
        return;
      for (auto [operand, parameter] :
           llvm::zip_equal(call.getOperands(), callee.getArguments()))
        if (isa<ArrayType>(operand.getType()) && findWrite(parameter))
          for (unsigned leaf : leaves.of(operand))
            updates[leaf].push_back(op);
    }
    std::optional<Access> access = getAccess(op);
    if (!access || !access->isWrite)
      return;
    for (unsigned leaf : leaves.of(access->array)) {
      updates[leaf].push_back(op);
      if (claims[leaf] || twins[leaf].empty() || !isExtremum(op))
        continue;
      auto twin = cast<ArrayType>(twins[leaf][0].getType());
      if (Type element = getClaimType(twin.getElementType()))
        claims[leaf] = addHidden(
            dual, HiddenAttr::get(dual.getContext(), HiddenKind::Claims, leaf),
            ArrayType::get(dual.getContext(), twin.getRank(), element));
    }
  });
}

static InFlightDiagnostic refuse(Operation *op) {
  return op->emitError(
      "the tangent of an atomic minimum or maximum of several threads is found "
      "after the launch, ");
}

/// Rejects arrays that do not hold any more what the first launch read.
LogicalResult ForwardBuilder::checkRead(Operation *op, Value array) {
  auto read = leaves.of(array);
  if (rootOf(array).getDefiningOp<ArrayAtOp>())
    return success();
  if (read.empty())
    return refuse(op) << "but which array this accesses is not known; use two "
                         "launches";
  for (unsigned leaf : read) {
    if (updates[leaf].empty())
      continue;
    InFlightDiagnostic error = refuse(op)
                               << "but this reads '" << leaves.getName(leaf)
                               << "', which the launch changes; use two "
                                  "launches";
    error.attachNote(updates[leaf][0]->getLoc()) << "changed here";
    return error;
  }
  return success();
}

std::optional<LogicalResult> ForwardBuilder::runForWinners(Operation *op) {
  if (isa<PrintfOp, AssertOp>(op))
    return success();
  if (isa<func::CallOp>(op)) {
    for (Value operand : op->getOperands())
      if (isa<ArrayType>(operand.getType()) && failed(checkRead(op, operand)))
        return failure();
    return std::nullopt;
  }
  std::optional<Access> access = getAccess(op);
  if (!access)
    return std::nullopt;
  if (!access->isWrite) {
    if (failed(checkRead(op, access->array)))
      return failure();
    return std::nullopt;
  }
  if (gradientOwner(access->array) && op->use_empty())
    return success();
  if (leaves.of(access->array).empty())
    return checkRead(op, access->array);
  if (op->getNumResults() != 0 && !op->getResult(0).use_empty())
    return refuse(op) << "but what this atomic returns depends on the order of "
                         "threads; use two launches";
  if (isExtremum(op) && directions[0].contains(access->array))
    return assignWinner(cast<AccessOp>(op));
  return success();
}

/// Rejects elements that the launch changes in other ways, too.
LogicalResult ForwardBuilder::checkUpdates(AccessOp op, unsigned leaf) {
  for (Operation *other : updates[leaf]) {
    auto access = dyn_cast<AccessOp>(other);
    if ((access && access.getCombination() == op.getCombination()) ||
        areApart(*getAccess(op), *getAccess(other)))
      continue;
    InFlightDiagnostic error =
        refuse(op) << "but '" << leaves.getName(leaf)
                   << "' is changed in another way, too; use two launches";
    error.attachNote(other->getLoc()) << "changed here";
    return error;
  }
  return success();
}

/// The argument for claims, seen through the views that the array was made by.
Value ForwardBuilder::claimsOf(Value array) {
  auto op = array.getDefiningOp<ArrayViewOp>();
  if (!op)
    return claims[leaves.of(array).front()];
  Value base = claimsOf(op.getArray());
  Type element = cast<ArrayType>(base.getType()).getElementType();
  if (isa<ComponentViewOp>(op.getOperation()))
    element = getClaimType(cast<ArrayType>(array.getType()).getElementType());
  Operation *view = op->clone();
  view->setOperands(lookup(op->getOperands()));
  view->setOperand(0, base);
  view->getResult(0).setType(
      ArrayType::get(builder.getContext(),
                     cast<ArrayType>(array.getType()).getRank(), element));
  builder.insert(view);
  return view->getResult(0);
}

LogicalResult ForwardBuilder::assignWinner(AccessOp op) {
  Location loc = op.getLoc();
  Value updating = op.getWritten().front();
  Type type = updating.getType();
  auto leaf = leaves.of(op.getArray());
  if (leaf.size() != 1 || !claims[leaf[0]])
    return refuse(op) << "for arrays of numbers, vectors and matrices; launch "
                         "one thread, or use such an array";
  if (failed(checkUpdates(op, leaf[0])))
    return failure();
  Value array = values.lookup(op.getArray());
  Value value = values.lookup(updating);
  SmallVector<Value> indices = lookup(op.getIndices());
  auto open = [&](Value condition) {
    auto branch = scf::IfOp::create(builder, loc, condition, false);
    builder.setInsertionPointToStart(branch.thenBlock());
  };
  OpBuilder::InsertionGuard guard(builder);
  Value left = LoadOp::create(builder, loc, type, array, indices);
  open(isLeft(builder, loc, left, value));
  Value claim = claimsOf(op.getArray());
  Type integer = cast<ArrayType>(claim.getType()).getElementType();
  auto number = [&](int64_t n) -> Value {
    return ConstantOp::create(builder, loc,
                              cast<TypedAttr>(IntegerAttr::get(integer, n)));
  };
  Value before = AtomicOp::create(builder, loc, integer, AtomicKind::exch,
                                  number(1), claim, indices);
  open(createBuiltin(builder, loc, "eq", {before, number(0)})->getResult(0));
  for (TangentMap &tangents : directions)
    StoreOp::create(builder, loc, getTangentOrZero(updating, tangents),
                    tangents.lookup(op.getArray()), indices);
  return success();
}

} // namespace warp::autodiff
