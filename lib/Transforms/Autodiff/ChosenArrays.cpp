//===- ChosenArrays.cpp - Arrays selected by control flow -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `s = a if c else b; y = s[i]` accesses one of two arrays, and a derivative
// has to know which. Arrays that are no results of control flow have a number
// each. Branches and loops yield the numbers beside the arrays,
//
//   s, n = a, 0 if c else b, 1
//   y = a[i] if n == 0 else b[i]
//
// and an access has a branch for each array that it may be of. Views that the
// array was chosen with are taken again at the access.
//
//===----------------------------------------------------------------------===//

#include "ChosenArrays.h"

#include "Analysis/Forms.h"
#include "Autodiff/DeadValues.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Dominance.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/MapVector.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;

namespace warp::autodiff {

/// The values that one of a branch or a loop may be; none for any other value.
static SmallVector<Value> getSources(Value value) {
  if (auto result = dyn_cast<OpResult>(value)) {
    Operation *op = result.getOwner();
    unsigned i = result.getResultNumber();
    if (auto branch = dyn_cast<scf::IfOp>(op))
      return {branch.thenYield().getOperand(i),
              branch.elseYield().getOperand(i)};
    if (auto loop = dyn_cast<scf::ForOp>(op))
      return {loop.getInitArgs()[i], loop.getYieldedValues()[i]};
    if (auto loop = dyn_cast<scf::WhileOp>(op))
      return {loop.getConditionOp().getArgs()[i]};
    return {};
  }
  auto argument = cast<BlockArgument>(value);
  Operation *op = argument.getOwner()->getParentOp();
  unsigned i = argument.getArgNumber();
  if (auto loop = dyn_cast<scf::ForOp>(op))
    if (i > 0)
      return {loop.getInitArgs()[i - 1], loop.getYieldedValues()[i - 1]};
  if (auto loop = dyn_cast<scf::WhileOp>(op)) {
    if (argument.getOwner() == loop.getBeforeBody())
      return {loop.getInits()[i], loop.getYieldOp().getOperand(i)};
    return {loop.getConditionOp().getArgs()[i]};
  }
  return {};
}

/// True if a value comes out of a branch or is carried by a loop, which need
/// not be complete.
static bool isCarried(Value value) {
  Operation *op = value.getDefiningOp();
  if (!op)
    op = cast<BlockArgument>(value).getOwner()->getParentOp();
  return isa<scf::IfOp, scf::ForOp, scf::WhileOp>(op);
}

static Value getRoot(Value array) {
  while (auto view = array.getDefiningOp<ArrayViewOp>())
    array = view.getArray();
  return array;
}

namespace {

class ArrayNames {
public:
  explicit ArrayNames(Operation *function)
      : function(function), type(IntegerType::get(function->getContext(), 32,
                                                  IntegerType::Signed)) {}
  void run();

private:
  using Arrays = llvm::SetVector<Value>;

  Arrays findArrays(Value chosen) const;
  bool canHaveAt(Value value, Operation *at, const DominanceInfo &order) const;
  Value haveAt(OpBuilder &b, Value value, const DominanceInfo &order,
               Operation *at) const;
  void addNumbers();
  template <typename Values>
  SmallVector<Value> getNumbers(OpBuilder &b, Values &&values);
  Value getNumber(OpBuilder &b, Value array);
  void addNumbers(scf::IfOp branch);
  void addNumbers(scf::ForOp loop);
  void addNumbers(scf::WhileOp loop);
  void noteNumbers(ValueRange arrays, ValueRange numbers);
  SmallVector<Value> expand(OpBuilder &b, AccessOp access,
                            ArrayRef<Value> arrays, const DominanceInfo &order);

  Operation *function;
  /// For numbers.
  Type type;
  llvm::DenseMap<Value, int> constants;
  /// For results of control flow: the number of the array; placeholders for
  /// those that there are not yet.
  llvm::DenseMap<Value, Value> numbers;
};

} // namespace

static SmallVector<Value> getArrays(ValueRange values) {
  SmallVector<Value> arrays;
  for (Value value : values)
    if (isa<ArrayType>(value.getType()))
      arrays.push_back(value);
  return arrays;
}

/// The arrays that one may be, except for those at address 0, which nobody may
/// access.
ArrayNames::Arrays ArrayNames::findArrays(Value chosen) const {
  Arrays found;
  llvm::SetVector<Value> pending;
  pending.insert(chosen);
  for (unsigned i = 0; i < pending.size(); ++i) {
    SmallVector<Value> sources = getSources(pending[i]);
    pending.insert(sources.begin(), sources.end());
    if (!sources.empty())
      continue;
    auto at = pending[i].getDefiningOp<ArrayAtOp>();
    if (!at || getConstantInteger(at.getAddress()) != 0)
      found.insert(pending[i]);
  }
  return found;
}

/// True if a value is there before an operation, or follows from what is.
bool ArrayNames::canHaveAt(Value value, Operation *at,
                           const DominanceInfo &order) const {
  if (order.properlyDominates(value, at))
    return true;
  Operation *op = value.getDefiningOp();
  return op && op->getNumRegions() == 0 && isMemoryEffectFree(op) &&
         llvm::all_of(op->getOperands(), [&](Value operand) {
           return canHaveAt(operand, at, order);
         });
}

Value ArrayNames::haveAt(OpBuilder &b, Value value, const DominanceInfo &order,
                         Operation *at) const {
  if (order.properlyDominates(value, at))
    return value;
  IRMapping made;
  Operation *op = value.getDefiningOp();
  for (Value operand : op->getOperands())
    made.map(operand, haveAt(b, operand, order, at));
  return b.clone(*op, made)->getResult(cast<OpResult>(value).getResultNumber());
}

//===----------------------------------------------------------------------===//
// Numbers
//===----------------------------------------------------------------------===//

Value ArrayNames::getNumber(OpBuilder &b, Value array) {
  Location loc = array.getLoc();
  if (isCarried(array)) {
    Value &number = numbers[array];
    if (!number) {
      OpBuilder::InsertionGuard guard(b);
      b.setInsertionPointToStart(&function->getRegion(0).front());
      number = UnrealizedConversionCastOp::create(b, loc, TypeRange(type),
                                                  ValueRange())
                   .getResult(0);
    }
    return number;
  }
  int number = constants.try_emplace(array, constants.size()).first->second;
  return ConstantOp::create(b, loc, b.getIntegerAttr(type, number));
}

template <typename Values>
SmallVector<Value> ArrayNames::getNumbers(OpBuilder &b, Values &&values) {
  return llvm::map_to_vector(getArrays(values),
                             [&](Value array) { return getNumber(b, array); });
}

/// Says which values are the numbers of arrays.
void ArrayNames::noteNumbers(ValueRange arrays, ValueRange found) {
  for (auto [array, number] : llvm::zip_equal(getArrays(arrays), found)) {
    Value &known = numbers[array];
    if (known) {
      known.replaceAllUsesWith(number);
      known.getDefiningOp()->erase();
    }
    known = number;
  }
}

static void append(Operation *terminator, ValueRange values) {
  terminator->insertOperands(terminator->getNumOperands(), values);
}

/// Moves what is known of the results of an operation to one with more.
static ValueRange replace(Operation *old, Operation *extended,
                          llvm::DenseMap<Value, Value> &numbers) {
  unsigned count = old->getNumResults();
  ValueRange results = extended->getResults();
  for (auto [from, to] :
       llvm::zip_equal(old->getResults(), results.take_front(count))) {
    if (Value number = numbers.lookup(from)) {
      numbers.erase(from);
      numbers[to] = number;
    }
    from.replaceAllUsesWith(to);
  }
  old->erase();
  return results.drop_front(count);
}

void ArrayNames::addNumbers(scf::IfOp branch) {
  OpBuilder b(branch);
  SmallVector<Type> types(branch.getResultTypes());
  types.append(getArrays(branch.getResults()).size(), type);
  auto extended =
      scf::IfOp::create(b, branch.getLoc(), types, branch.getCondition(), true);
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), branch->getRegions())) {
    to.takeBody(from);
    Operation *yield = to.front().getTerminator();
    b.setInsertionPoint(yield);
    append(yield, getNumbers(b, yield->getOperands()));
  }
  unsigned count = branch.getNumResults();
  ValueRange added = replace(branch, extended, numbers);
  noteNumbers(extended.getResults().take_front(count), added);
}

void ArrayNames::addNumbers(scf::ForOp loop) {
  OpBuilder b(loop);
  SmallVector<Value> inits(loop.getInitArgs());
  SmallVector<Value> more = getNumbers(b, loop.getInitArgs());
  llvm::append_range(inits, more);
  auto extended = scf::ForOp::create(b, loop.getLoc(), loop.getLowerBound(),
                                     loop.getUpperBound(), loop.getStep(),
                                     inits, nullptr, loop.getUnsignedCmp());
  extended.getRegion().takeBody(loop.getRegion());
  Block *body = extended.getBody();
  SmallVector<Value> arguments(body->getArguments());
  SmallVector<Value> added;
  for (Value number : more)
    added.push_back(body->addArgument(number.getType(), loop.getLoc()));
  noteNumbers(arguments, added);
  b.setInsertionPoint(body->getTerminator());
  append(body->getTerminator(),
         getNumbers(b, body->getTerminator()->getOperands()));
  unsigned count = loop.getNumResults();
  ValueRange results = replace(loop, extended, numbers);
  noteNumbers(extended.getResults().take_front(count), results);
}

void ArrayNames::addNumbers(scf::WhileOp loop) {
  OpBuilder b(loop);
  SmallVector<Value> inits(loop.getInits());
  llvm::append_range(inits, getNumbers(b, loop.getInits()));
  SmallVector<Type> types(loop.getResultTypes());
  types.append(getArrays(loop.getResults()).size(), type);
  auto extended = scf::WhileOp::create(b, loop.getLoc(), types, inits);
  for (auto [to, from] :
       llvm::zip_equal(extended->getRegions(), loop->getRegions())) {
    to.takeBody(from);
    Block &body = to.front();
    SmallVector<Value> arguments(body.getArguments());
    SmallVector<Value> added;
    for (unsigned i = 0, n = getArrays(arguments).size(); i < n; ++i)
      added.push_back(body.addArgument(type, loop.getLoc()));
    noteNumbers(arguments, added);
    Operation *end = body.getTerminator();
    b.setInsertionPoint(end);
    ValueRange passed = end->getOperands();
    append(end, getNumbers(b, isa<scf::ConditionOp>(end) ? passed.drop_front()
                                                         : passed));
  }
  unsigned count = loop.getNumResults();
  ValueRange results = replace(loop, extended, numbers);
  noteNumbers(extended.getResults().take_front(count), results);
}

void ArrayNames::addNumbers() {
  SmallVector<Operation *> ops;
  function->walk([&](Operation *op) {
    bool carries = !getArrays(op->getResults()).empty();
    if (auto loop = dyn_cast<scf::WhileOp>(op))
      carries |= !getArrays(loop.getInits()).empty();
    if (carries && isa<scf::IfOp, scf::ForOp, scf::WhileOp>(op))
      ops.push_back(op);
  });
  for (Operation *op : ops) {
    if (auto branch = dyn_cast<scf::IfOp>(op))
      addNumbers(branch);
    else if (auto loop = dyn_cast<scf::ForOp>(op))
      addNumbers(loop);
    else
      addNumbers(cast<scf::WhileOp>(op));
  }
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// The view of one array that is there of another one.
static Value viewOf(OpBuilder &b, Value view, Value root) {
  auto op = view.getDefiningOp<ArrayViewOp>();
  if (!op)
    return root;
  Value base = viewOf(b, op.getArray(), root);
  Operation *made = b.clone(*op.getOperation());
  made->setOperand(0, base);
  return made->getResult(0);
}

/// The access of one of the arrays; returns its results.
SmallVector<Value> ArrayNames::expand(OpBuilder &b, AccessOp access,
                                      ArrayRef<Value> arrays,
                                      const DominanceInfo &order) {
  Location loc = access.getLoc();
  if (arrays.size() == 1) {
    Value root = haveAt(b, arrays.front(), order, access);
    Value view = viewOf(b, access.getArray(), root);
    Operation *made = b.clone(*access.getOperation());
    auto operand = llvm::find(access->getOperands(), access.getArray());
    made->setOperand(operand - access->getOperands().begin(), view);
    return SmallVector<Value>(made->getResults());
  }
  Value number = numbers.lookup(getRoot(access.getArray()));
  Value which = ConstantOp::create(
      b, loc, b.getIntegerAttr(type, constants.lookup(arrays.front())));
  Value isIt =
      createBuiltin(b, loc, EqOp::getSpec(), {number, which})->getResult(0);
  auto branch = scf::IfOp::create(b, loc, access->getResultTypes(), isIt, true);
  for (Block *side : {branch.thenBlock(), branch.elseBlock()}) {
    OpBuilder::InsertionGuard guard(b);
    if (side->mightHaveTerminator())
      side->getTerminator()->erase();
    b.setInsertionPointToEnd(side);
    bool isThen = side == branch.thenBlock();
    SmallVector<Value> results = expand(
        b, access, isThen ? arrays.take_front() : arrays.drop_front(), order);
    scf::YieldOp::create(b, loc, results);
  }
  return SmallVector<Value>(branch.getResults());
}

void ArrayNames::run() {
  SmallVector<AccessOp> chosen;
  {
    DominanceInfo order(function);
    function->walk([&](AccessOp access) {
      Value root = getRoot(access.getArray());
      if (getSources(root).empty())
        return;
      Arrays arrays = findArrays(root);
      if (!arrays.empty() && llvm::all_of(arrays, [&](Value array) {
            return canHaveAt(array, access, order);
          }))
        chosen.push_back(access);
    });
  }
  if (chosen.empty())
    return;
  addNumbers();
  DominanceInfo order(function);
  for (AccessOp access : chosen) {
    OpBuilder b(access);
    Arrays arrays = findArrays(getRoot(access.getArray()));
    access->replaceAllUsesWith(expand(b, access, arrays.getArrayRef(), order));
    access->erase();
  }
  eraseDead(function->getRegion(0));
}

void nameChosenArrays(Operation *function) { ArrayNames(function).run(); }

} // namespace warp::autodiff
