//===- CarryElements.cpp - Scalar promotion of loop updates ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `for k in range(n): y[i] = y[i] * x[k]` overwrites in every iteration what
// the derivative of that iteration needs. But one element is a value that the
// loop carries: it is loaded before the loop, stores say what it is from then
// on, and loads use it. How carried values are recovered is what reversed loops
// know. The stores stay.
//
// An element qualifies if its indices do not change in the loop and nothing
// else of its array is accessed there, but for other components. It is loaded
// early only if it is accessed for sure: around the loop, or by the body of a
// counted loop that runs.
//
//===----------------------------------------------------------------------===//

#include "CarryElements.h"

#include "CarryValue.h"

#include "Autodiff/Rules/Rules.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "llvm/ADT/SmallPtrSet.h"

using namespace mlir;

namespace warp::autodiff {

namespace {

struct Element {
  Access access;
  unsigned leaf;
};

/// Rewrites the accesses of one element. Which those are is asked beforehand:
/// while a loop gets one more value, nothing can be said about indices.
class ElementCarrier : public ValueCarrier {
public:
  ElementCarrier(const Element &element, ArrayRef<Element> all) {
    for (auto &[access, leaf] : all)
      if (leaf == element.leaf && areSame(access, element.access))
        accesses.insert(access.op);
  }

private:
  bool changes(Operation *op) const override {
    return accesses.contains(op) && cast<AccessOp>(op).mayWrite();
  }
  Value pass(Operation *op, Value current) override {
    if (!accesses.contains(op))
      return current;
    if (changes(op))
      return cast<AccessOp>(op).getWritten().front();
    accesses.erase(op);
    op->getResult(0).replaceAllUsesWith(current);
    op->erase();
    return current;
  }

  llvm::SmallPtrSet<Operation *, 8> accesses;
};

} // namespace

//===----------------------------------------------------------------------===//
// Elements that qualify
//===----------------------------------------------------------------------===//

static bool isOutside(Operation *loop, Value value) {
  return !loop->isAncestor(value.getParentBlock()->getParentOp());
}

/// True if a value can be made outside of the loop: by operations without
/// regions from what is there.
static bool isMadeOutside(Operation *loop, Value value) {
  SmallVector<Value> pending{value};
  DenseSet<Value> seen;
  while (!pending.empty()) {
    Value next = pending.pop_back_val();
    if (isOutside(loop, next) || !seen.insert(next).second)
      continue;
    Operation *op = next.getDefiningOp();
    if (!op || op->getNumRegions() != 0 || !isMemoryEffectFree(op))
      return false;
    llvm::append_range(pending, op->getOperands());
  }
  return true;
}

static bool isInvariant(const Access &access, Operation *loop) {
  auto isMade = [&](Value value) { return isMadeOutside(loop, value); };
  return isMade(access.array) &&
         llvm::all_of(access.indices,
                      [&](auto &index) {
                        return index && index->isDefinedOutside(loop);
                      }) &&
         llvm::all_of(cast<AccessOp>(access.op).getIndices(), isMade);
}

/// All accesses within an operation; none if some may be of any array.
static SmallVector<Element> gather(Operation *op, const ArrayLeaves &leaves) {
  SmallVector<Element> all;
  auto walk = op->walk([&](Operation *inner) {
    std::optional<Access> access = getAccess(inner);
    // Gradients are no elements of arguments, which do not overlap.
    if (access && gradientOwner(access->array))
      return WalkResult::advance();
    auto known = access ? leaves.of(access->array) : SmallVector<unsigned, 1>();
    if (known.size() == 1)
      all.push_back({*access, known.front()});
    return isa<func::CallOp>(inner) || (access && known.size() != 1)
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return walk.wasInterrupted() ? SmallVector<Element>() : all;
}

/// True if something loads it, something stores it, and nothing else accesses
/// what may be the same.
static bool isUpdated(const Element &element, ArrayRef<Element> all) {
  bool isLoaded = false, isStored = false;
  for (auto &[other, leaf] : all) {
    if (leaf != element.leaf || haveOtherComponents(element.access, other))
      continue;
    auto access = dyn_cast<AccessOp>(other.op);
    if (!access || !areSame(element.access, other) || access.isUpdate() ||
        access.getMask())
      return false;
    (access.mayWrite() ? isStored : isLoaded) = true;
  }
  return isLoaded && isStored;
}

/// True if the element is accessed wherever the loop is, even if that does not
/// run.
static bool isSure(const Element &element, Operation *loop,
                   ArrayRef<Element> all) {
  return llvm::any_of(all, [&](const Element &other) {
    return other.leaf == element.leaf &&
           areSame(other.access, element.access) &&
           !loop->isAncestor(other.access.op) &&
           other.access.op->getBlock()->findAncestorOpInBlock(*loop);
  });
}

//===----------------------------------------------------------------------===//
// Elements before a loop
//===----------------------------------------------------------------------===//

/// A value that is made of values outside of the loop, made there.
static Value cloneBefore(OpBuilder &builder, Operation *loop, Value value,
                         IRMapping &clones) {
  if (isOutside(loop, value) || clones.contains(value))
    return clones.lookupOrDefault(value);
  Operation *op = value.getDefiningOp();
  for (Value operand : op->getOperands())
    clones.map(operand, cloneBefore(builder, loop, operand, clones));
  builder.clone(*op, clones);
  return clones.lookup(value);
}

static Value loadHere(OpBuilder &builder, Operation *loop,
                      const Access &access) {
  auto array = cast<ArrayType>(access.array.getType());
  IRMapping clones;
  Value source = cloneBefore(builder, loop, access.array, clones);
  SmallVector<Value> indices;
  for (Value index : access.op->getOperands().take_back(array.getRank()))
    indices.push_back(cloneBefore(builder, loop, index, clones));
  return LoadOp::create(builder, access.op->getLoc(), array.getElementType(),
                        source, indices);
}

/// The element before a loop whose body accesses it for sure, read only if the
/// loop runs at all.
static Value loadIfRuns(scf::ForOp loop, const Access &access) {
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

/// Carries one element through the loop; returns whether there was one.
static bool carryThrough(Operation *loop, ArrayRef<Element> function,
                         const ArrayLeaves &leaves) {
  SmallVector<Element> all = gather(loop, leaves);
  auto counted = dyn_cast<scf::ForOp>(loop);
  for (const Element &element : all) {
    const Access &access = element.access;
    if (!isInvariant(access, loop) || !isUpdated(element, all))
      continue;
    Value start;
    if (isSure(element, loop, function)) {
      OpBuilder builder(loop);
      start = loadHere(builder, loop, access);
    } else if (counted && access.op->getBlock() == counted.getBody()) {
      start = loadIfRuns(counted, access);
    } else {
      continue;
    }
    ElementCarrier(element, all).carry(loop, start);
    return true;
  }
  return false;
}

static bool carryOne(FunctionOpInterface function, const ArrayLeaves &leaves) {
  SmallVector<Element> all = gather(function, leaves);
  return function
      ->walk<WalkOrder::PreOrder>([&](Operation *op) {
        return isa<scf::ForOp, scf::WhileOp>(op) &&
                       carryThrough(op, all, leaves)
                   ? WalkResult::interrupt()
                   : WalkResult::advance();
      })
      .wasInterrupted();
}

void carryElements(FunctionOpInterface function, const ArrayLeaves &leaves) {
  while (carryOne(function, leaves))
    ;
}

} // namespace warp::autodiff
