//===- CarryElements.cpp - Elements that a loop updates become values -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `for k in range(n): y[i] = y[i] * x[k]` overwrites in every iteration what
// the derivative of that iteration needs. But one element is a value that the
// loop carries: it is loaded before the loop, stores say what it is from then
// on, and loads use it. How carried values are had again is what reversed loops
// know. The stores stay.
//
// An element qualifies if its indices do not change in the loop and nothing
// else of its array is accessed there, but for other components. It is loaded
// early only if the first iteration accesses it for sure.
//
//===----------------------------------------------------------------------===//

#include "CarryElements.h"

#include "Rules.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

namespace {

/// Rewrites the accesses of one element.
class Carrier {
public:
  Carrier(const Access &element, unsigned leaf, const ArrayLeaves &leaves)
      : element(element), leaf(leaf), leaves(leaves) {}

  /// Gives the loop one more carried value, `start` before it.
  Value carry(scf::ForOp loop, Value start);

private:
  bool isElement(Operation *op) const {
    std::optional<Access> access = getAccess(op);
    return access && leaves.of(access->array).front() == leaf &&
           areSame(*access, element);
  }
  bool holdsStore(Operation *op) const {
    return op
        ->walk([&](StoreOp store) {
          return isElement(store) ? WalkResult::interrupt()
                                  : WalkResult::advance();
        })
        .wasInterrupted();
  }

  /// What the element is at the end of a block.
  Value carry(Block &block, Value current);
  Value carry(Operation *op, Value current);
  Value carry(scf::IfOp branch, Value current);
  Value carry(scf::WhileOp loop, Value start);

  const Access &element;
  unsigned leaf;
  const ArrayLeaves &leaves;
};

} // namespace

Value Carrier::carry(Block &block, Value current) {
  for (Operation &op : llvm::make_early_inc_range(block)) {
    if (op.getNumRegions() != 0) {
      current = carry(&op, current);
    } else if (isElement(&op)) {
      if (auto store = dyn_cast<StoreOp>(op)) {
        current = store.getValue();
        continue;
      }
      op.getResult(0).replaceAllUsesWith(current);
      op.erase();
    }
  }
  return current;
}

Value Carrier::carry(Operation *op, Value current) {
  if (!holdsStore(op)) {
    for (Region &region : op->getRegions())
      for (Block &block : region)
        carry(block, current);
    return current;
  }
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return carry(branch, current);
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return carry(loop, current);
  return carry(cast<scf::WhileOp>(op), current);
}

static void append(Operation *terminator, Value value) {
  terminator->insertOperands(terminator->getNumOperands(), value);
}

/// The results but for the last one, which is new.
static void replaceResults(Operation *old, Operation *extended) {
  old->replaceAllUsesWith(extended->getResults().drop_back());
  old->erase();
}

Value Carrier::carry(scf::IfOp branch, Value current) {
  OpBuilder builder(branch);
  SmallVector<Type> types(branch.getResultTypes());
  types.push_back(current.getType());
  auto extended = scf::IfOp::create(builder, branch.getLoc(), types,
                                    branch.getCondition(), true);
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), branch->getRegions())) {
    if (from.empty()) {
      builder.setInsertionPointToStart(&to.front());
      scf::YieldOp::create(builder, branch.getLoc(), current);
      continue;
    }
    to.takeBody(from);
    append(to.front().getTerminator(), carry(to.front(), current));
  }
  replaceResults(branch, extended);
  return extended->getResults().back();
}

Value Carrier::carry(scf::ForOp loop, Value start) {
  OpBuilder builder(loop);
  SmallVector<Value> inits(loop.getInitArgs());
  inits.push_back(start);
  auto extended = scf::ForOp::create(
      builder, loop.getLoc(), loop.getLowerBound(), loop.getUpperBound(),
      loop.getStep(), inits, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  Block &body = extended.getRegion().front();
  Value current = body.addArgument(start.getType(), loop.getLoc());
  append(body.getTerminator(), carry(body, current));
  replaceResults(loop, extended);
  return extended->getResults().back();
}

Value Carrier::carry(scf::WhileOp loop, Value start) {
  OpBuilder builder(loop);
  SmallVector<Value> inits(loop.getInits());
  inits.push_back(start);
  SmallVector<Type> types(loop.getResultTypes());
  types.push_back(start.getType());
  auto extended =
      scf::WhileOp::create(builder, loop.getLoc(), types, inits);
  Value current = start;
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), loop->getRegions())) {
    to.takeBody(from);
    current = to.front().addArgument(start.getType(), loop.getLoc());
    append(to.front().getTerminator(), carry(to.front(), current));
  }
  replaceResults(loop, extended);
  return extended->getResults().back();
}

//===----------------------------------------------------------------------===//
// Elements that qualify
//===----------------------------------------------------------------------===//

static bool isInvariant(const Access &access, scf::ForOp loop) {
  return llvm::all_of(access.indices, [&](auto &index) {
    return index && llvm::all_of(index->terms, [&](auto &term) {
             return loop.isDefinedOutsideOfLoop(term.first);
           });
  });
}

/// An access of the loop's body whose element can be carried; the index of its
/// leaf in `leaf`.
static std::optional<Access>
findElement(scf::ForOp loop, const ArrayLeaves &leaves, unsigned &leaf) {
  SmallVector<std::pair<Access, unsigned>> all;
  auto gather = loop.walk([&](Operation *op) {
    if (isa<func::CallOp>(op))
      return WalkResult::interrupt();
    std::optional<Access> access = getAccess(op);
    if (!access)
      return WalkResult::advance();
    auto known = leaves.of(access->array);
    if (known.size() != 1)
      return WalkResult::interrupt();
    all.emplace_back(*access, known.front());
    return WalkResult::advance();
  });
  if (gather.wasInterrupted())
    return std::nullopt;
  for (auto &[access, number] : all) {
    if (access.op->getBlock() != loop.getBody() || !isInvariant(access, loop))
      continue;
    bool isLoaded = false, isStored = false, isAlone = true;
    for (auto &[other, otherLeaf] : all) {
      if (otherLeaf != number || haveOtherComponents(access, other))
        continue;
      isAlone &= areSame(access, other) && isa<LoadOp, StoreOp>(other.op);
      isLoaded |= isa<LoadOp>(other.op);
      isStored |= isa<StoreOp>(other.op);
    }
    if (isAlone && isLoaded && isStored) {
      leaf = number;
      return access;
    }
  }
  return std::nullopt;
}

/// A value that is made of values outside of the loop, made there.
static Value cloneBefore(OpBuilder &builder, scf::ForOp loop, Value value) {
  if (loop.isDefinedOutsideOfLoop(value))
    return value;
  Operation *op = value.getDefiningOp();
  SmallVector<Value> operands;
  for (Value operand : op->getOperands())
    operands.push_back(cloneBefore(builder, loop, operand));
  Operation *clone = op->cloneWithoutRegions();
  clone->setOperands(operands);
  return builder.insert(clone)->getResult(
      cast<OpResult>(value).getResultNumber());
}

static Value loadHere(OpBuilder &builder, scf::ForOp loop,
                      const Access &access) {
  auto array = cast<ArrayType>(access.array.getType());
  Value source = cloneBefore(builder, loop, access.array);
  SmallVector<Value> indices;
  for (Value index : access.op->getOperands().take_back(array.getRank()))
    indices.push_back(cloneBefore(builder, loop, index));
  return LoadOp::create(builder, access.op->getLoc(), array.getElementType(),
                        source, indices);
}

/// The element before the loop, read only if the loop runs at all.
static Value loadBefore(scf::ForOp loop, const Access &access) {
  OpBuilder builder(loop);
  Location loc = access.op->getLoc();
  auto low = getConstantInteger(loop.getLowerBound());
  auto high = getConstantInteger(loop.getUpperBound());
  if (low && high && *low < *high)
    return loadHere(builder, loop, access);
  Type type = cast<ArrayType>(access.array.getType()).getElementType();
  auto less = loop.getUnsignedCmp() ? arith::CmpIPredicate::ult
                                    : arith::CmpIPredicate::slt;
  Value runs = arith::CmpIOp::create(builder, loc, less, loop.getLowerBound(),
                                     loop.getUpperBound());
  auto branch =
      scf::IfOp::create(builder, loc, type, runs, /*withElseRegion=*/true);
  builder.setInsertionPointToStart(branch.thenBlock());
  scf::YieldOp::create(builder, loc, loadHere(builder, loop, access));
  builder.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(builder, loc, zero(builder, loc, type));
  return branch.getResult(0);
}

/// Carries one element of one loop; returns whether there was one.
static bool carryOne(FunctionOpInterface function, const ArrayLeaves &leaves) {
  auto visit = [&](scf::ForOp loop) {
    unsigned leaf;
    std::optional<Access> element = findElement(loop, leaves, leaf);
    if (!element)
      return WalkResult::advance();
    Value start = loadBefore(loop, *element);
    Carrier(*element, leaf, leaves).carry(loop, start);
    return WalkResult::interrupt();
  };
  return function->walk<WalkOrder::PreOrder>(visit).wasInterrupted();
}

void carryElements(FunctionOpInterface function, const ArrayLeaves &leaves) {
  while (carryOne(function, leaves))
    ;
}

} // namespace warp::autodiff
