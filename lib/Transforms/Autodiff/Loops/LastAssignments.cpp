//===- LastAssignments.cpp - Loop values that one iteration assigns -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The nearest of many, the largest, what a ray hits first:
//
//   for k:  d = f(k);  if d < best:  best, normal = d, g(k)
//
// Only one iteration matters to a derivative, but reversed iterations need
// `best` to know which. So the loop also says which one it was, and after it
// that one is computed again:
//
//   for k:  ...  if d < best:  best, last = d, k
//   best, normal = f(last), g(last)
//
// From there the derivative takes its way: what the loop carries is for its
// conditions alone, and nothing is reversed. A minimum or maximum with the
// carried value is such an assignment. Integers that an iteration depends on
// are kept with its number; floats that the loop carries leave it as it is.
//
//===----------------------------------------------------------------------===//

#include "LastAssignments.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "Autodiff/Rules/Rules.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/MapVector.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;

namespace warp::autodiff {

namespace {

/// A carried value that an operation in each iteration may assign.
struct Assignment {
  unsigned number = 0;
  /// A minimum, a maximum, a choice or a branch.
  Operation *op = nullptr;
  Value value;
  /// The first arm of a choice or a branch assigns.
  bool isFirst = true;
};

/// The operations that compute values of one iteration.
struct Slice {
  llvm::SetVector<Operation *> ops;
  /// Integers to be kept.
  llvm::SetVector<Value> kept;
};

class LastAssignments {
public:
  LastAssignments(scf::ForOp loop, const ArrayLeaves &leaves,
                  const llvm::DenseSet<unsigned> &written)
      : loop(loop), leaves(leaves), written(written) {}
  void run();

private:
  std::optional<Assignment> match(unsigned number);
  bool isForConditions(Value carried, Operation *assignment);
  bool collect(Value value, Slice &slice);
  bool mayLoad(Operation *op) const;
  Value isTaken(OpBuilder &b, const Assignment &assignment, Value carried);
  void rewrite(ArrayRef<Assignment> group, const Slice &slice);

  scf::ForOp loop;
  const ArrayLeaves &leaves;
  const llvm::DenseSet<unsigned> &written;
};

} // namespace

//===----------------------------------------------------------------------===//
// Finding them
//===----------------------------------------------------------------------===//

std::optional<Assignment> LastAssignments::match(unsigned number) {
  Value carried = loop.getRegionIterArg(number);
  Value next = loop.getYieldedValues()[number];
  auto result = dyn_cast<OpResult>(next);
  if (!result || !differentialType(next.getType()) ||
      result.getOwner()->getBlock() != loop.getBody() ||
      loop.getResult(number).use_empty())
    return std::nullopt;
  Operation *op = result.getOwner();
  auto assigns = [&](Value first, Value second) -> std::optional<Assignment> {
    if ((first == carried) == (second == carried))
      return std::nullopt;
    bool isFirst = second == carried;
    return Assignment{number, op, isFirst ? first : second, isFirst};
  };
  if (auto branch = dyn_cast<scf::IfOp>(op)) {
    unsigned i = result.getResultNumber();
    return assigns(branch.thenYield().getOperand(i),
                   branch.elseYield().getOperand(i));
  }
  if (isa<WhereOp>(op))
    return assigns(op->getOperand(1), op->getOperand(2));
  if (isa<MinOp, MaxOp>(op) && isScalar(next.getType()))
    return assigns(op->getOperand(0), op->getOperand(1));
  return std::nullopt;
}

/// True if a carried value is compared and assigned, and not used otherwise.
bool LastAssignments::isForConditions(Value carried, Operation *assignment) {
  return llvm::all_of(carried.getUsers(), [&](Operation *user) {
    if (user == assignment || assignment->isProperAncestor(user))
      return user == assignment || isa<scf::YieldOp>(user);
    return user->getNumRegions() == 0 && user->getNumResults() != 0 &&
           llvm::none_of(user->getResultTypes(), [](Type type) {
             return bool(differentialType(type));
           });
  });
}

/// True if an element has its value after the loop, too.
bool LastAssignments::mayLoad(Operation *op) const {
  auto load = dyn_cast<LoadOp>(op);
  if (!load)
    return false;
  auto leaf = leaves.of(load.getArray());
  return leaf.size() == 1 && !written.contains(leaf.front());
}

/// Collects what computes a value in an iteration, in order.
bool LastAssignments::collect(Value value, Slice &slice) {
  if (!loop->isAncestor(value.getParentRegion()->getParentOp()) ||
      value == loop.getInductionVar())
    return true;
  bool isReal = bool(differentialType(value.getType()));
  Operation *op = value.getDefiningOp();
  if (!op || op->getNumRegions() != 0 ||
      (!isMemoryEffectFree(op) && !mayLoad(op))) {
    bool mayKeep = value.getParentBlock() == loop.getBody() &&
                   isa<IntegerType>(value.getType()) && !isReal;
    if (mayKeep)
      slice.kept.insert(value);
    return mayKeep;
  }
  if (!llvm::all_of(op->getOperands(),
                    [&](Value operand) { return collect(operand, slice); }))
    return false;
  slice.ops.insert(op);
  return true;
}

//===----------------------------------------------------------------------===//
// Computing them again
//===----------------------------------------------------------------------===//

/// True if this iteration assigns; the code is after the assignment.
Value LastAssignments::isTaken(OpBuilder &b, const Assignment &assignment,
                               Value carried) {
  Operation *op = assignment.op;
  Location loc = op->getLoc();
  if (isa<MinOp, MaxOp>(op))
    return createBuiltin(b, loc, isa<MinOp>(op) ? "lt" : "gt",
                         {assignment.value, carried})
        ->getResult(0);
  Value condition = op->getOperand(0);
  if (assignment.isFirst)
    return condition;
  Value yes = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  return arith::XOrIOp::create(b, loc, condition, yes);
}

static void fill(OpBuilder &b, Location loc, Block *block, ValueRange values) {
  if (block->mightHaveTerminator())
    block->getTerminator()->erase();
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToEnd(block);
  scf::YieldOp::create(b, loc, values);
}

void LastAssignments::rewrite(ArrayRef<Assignment> group, const Slice &slice) {
  Location loc = group.front().op->getLoc();
  OpBuilder b(loop);
  auto boolean = [&](bool value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getBoolAttr(value));
  };
  // True if there was one, its counter, and integers of that iteration; before
  // the first they are not used.
  SmallVector<Value> inits(loop.getInitArgs());
  unsigned first = inits.size();
  inits.push_back(boolean(false));
  inits.push_back(loop.getLowerBound());
  for (Value value : slice.kept) {
    Type type = value.getType();
    inits.push_back(
        type.isSignlessInteger()
            ? Value(
                  arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, 0)))
            : Value(ConstantOp::create(b, loc, b.getIntegerAttr(type, 0))));
  }
  auto extended = scf::ForOp::create(b, loop.getLoc(), loop.getLowerBound(),
                                     loop.getUpperBound(), loop.getStep(),
                                     inits, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  Block *body = extended.getBody();
  SmallVector<Value> before;
  for (Value init : ArrayRef(inits).drop_front(first))
    before.push_back(body->addArgument(init.getType(), loc));
  b.setInsertionPoint(body->getTerminator());
  Value taken = isTaken(b, group.front(),
                        extended.getRegionIterArg(group.front().number));
  SmallVector<Value> now{boolean(true), extended.getInductionVar()};
  llvm::append_range(now, slice.kept);
  auto note = scf::IfOp::create(b, loc, TypeRange(ValueRange(before)), taken,
                                /*withElseRegion=*/true);
  fill(b, loc, note.thenBlock(), now);
  fill(b, loc, note.elseBlock(), before);
  body->getTerminator()->insertOperands(first, note.getResults());

  b.setInsertionPointAfter(extended);
  ValueRange last = extended.getResults().drop_front(first);
  SmallVector<Type> types;
  SmallVector<Value> none;
  for (const Assignment &one : group) {
    none.push_back(extended.getInitArgs()[one.number]);
    types.push_back(none.back().getType());
  }
  auto again = scf::IfOp::create(b, loc, types, last[0], true);
  fill(b, loc, again.elseBlock(), none);
  b.setInsertionPointToStart(again.thenBlock());
  IRMapping made;
  made.map(extended.getInductionVar(), last[1]);
  for (auto [value, result] : llvm::zip_equal(slice.kept, last.drop_front(2)))
    made.map(value, result);
  for (Operation *op : slice.ops)
    b.clone(*op, made);
  fill(b, loc, again.thenBlock(),
       llvm::map_to_vector(group, [&](const Assignment &one) {
         return made.lookupOrDefault(one.value);
       }));
  for (auto [i, result] : llvm::enumerate(loop.getResults())) {
    Value replacement = extended.getResult(i);
    for (auto [one, found] : llvm::zip_equal(group, again.getResults()))
      if (one.number == i)
        replacement = found;
    result.replaceAllUsesWith(replacement);
  }
  loop.erase();
  loop = extended;
}

void LastAssignments::run() {
  // Values of one condition share the iteration.
  llvm::MapVector<std::pair<Operation *, int>, SmallVector<Assignment>> groups;
  for (unsigned i = 0; i < loop.getNumResults(); ++i)
    if (auto found = match(i);
        found && isForConditions(loop.getRegionIterArg(i), found->op))
      groups[{found->op, found->isFirst}].push_back(*found);
  for (auto &[key, group] : groups) {
    Slice slice;
    if (llvm::all_of(group, [&](const Assignment &one) {
          return collect(one.value, slice);
        }))
      rewrite(group, slice);
  }
}

void computeLastAssignments(func::FuncOp function) {
  ArrayLeaves leaves(function);
  llvm::DenseSet<unsigned> written;
  bool isKnown = true;
  function.walk([&](Operation *op) {
    auto access = dyn_cast<AccessOp>(op);
    isKnown &= !isCallWithArrays(op);
    if (!access || !access.mayWrite())
      return;
    auto leaf = leaves.of(access.getArray());
    isKnown &= leaf.size() == 1;
    written.insert(leaf.begin(), leaf.end());
  });
  if (!isKnown)
    return;
  SmallVector<scf::ForOp> loops;
  function.walk([&](scf::ForOp loop) { loops.push_back(loop); });
  for (scf::ForOp loop : loops)
    LastAssignments(loop, leaves, written).run();
}

} // namespace warp::autodiff
