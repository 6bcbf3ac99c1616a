//===- UnrollLocals.cpp - Loops over components of long values ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory of a thread is slow beside registers, which have no numbers. Where the
// indices of long composites come from nothing but counters of loops, as those
// of a Fourier transform of fixed length do, the loops are written out: each
// operation is copied with what is known by then and folded. That is tried
// beside the code and taken if no index of theirs is left that is known at run
// time only, and if the code is short and the values fit registers; types of
// which others have such indices stay in memory, and have to be shorter.
// Iterations of a loop that may end early are branches in each other, of which
// the innermost is the last. Where the end is one of two constants by a
// condition (`3 if dim == 2 else 6`), iterations that only one of them has are
// branches, too. A table that such a condition picks is picked by its elements.
//
// Reversed loops also keep what short composites were, iteration by iteration,
// so before a kernel is differentiated these count, too. There, what is known
// at run time only may stay, as the row of a pivot: what counters lead to then
// needs no memory of iterations, if it is most.
//
//===----------------------------------------------------------------------===//

#include "UnrollLocals.h"

#include "IntegerFold.h"
#include "LocalWebs.h"
#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

using namespace mlir;

/// Components that loops carry.
constexpr int64_t mostComponents = 64;
/// Iterations of a loop that may end early.
constexpr int mostBranches = 16;

namespace {

class LoopWriter {
public:
  LoopWriter(FunctionOpInterface function, warp::UnrollFor composites)
      : function(function), b(function.getContext()),
        takesAll(composites == warp::UnrollFor::Any),
        mostOperations(takesAll ? 1024 : 4096) {}

  void run();

private:
  bool counts(Type type) const {
    return takesAll || warp::isLongComposite(type);
  }
  bool isDynamicAccess(Operation *op) const;
  bool hasAccess(Operation *op) const;
  bool comesFromCounters(Value value);
  bool isMadeOfCounters(Value value);
  bool isWorthTrying();
  bool emitBlock(Block &block);
  bool emitLoop(scf::ForOp loop, int64_t first, int64_t end, int64_t step);
  bool emitGuarded(scf::ForOp loop, Value counter,
                   SmallVectorImpl<Value> &carried);
  bool emitBody(scf::ForOp loop, Value counter,
                SmallVectorImpl<Value> &carried);
  Value extract(warp::ExtractOp op, Value source, ValueRange indices);
  bool emitIterations(scf::WhileOp loop, SmallVector<Value> carried, int count,
                      SmallVectorImpl<Value> &results);
  bool emitBranch(scf::IfOp branch);
  bool emitAround(Operation *op);
  bool emit(Operation *op);
  Value constant(Operation *op, const APInt &bits);
  Value known(Operation *op);

  FunctionOpInterface function;
  OpBuilder b;
  IRMapping map;
  /// The operands of indices, and those of them that counters do not determine.
  llvm::DenseSet<Value> followed, others;
  /// Operands that a condition picks among values of counters.
  llvm::DenseSet<Value> picked;
  /// Accesses whose indices come from counters.
  llvm::DenseSet<Operation *> counted;
  bool takesAll;
  /// How many are written at most.
  int64_t mostOperations, written = 0;
};

} // namespace

/// True if an operation accesses a composite at an index of run time.
bool LoopWriter::isDynamicAccess(Operation *op) const {
  if (auto extract = dyn_cast<warp::ExtractOp>(op))
    return counts(extract->getOperand(0).getType()) &&
           warp::isDynamic(extract.getIndices());
  auto insert = dyn_cast<warp::InsertOp>(op);
  return insert && counts(insert.getType()) &&
         warp::isDynamic(insert.getIndices());
}

/// True if an operation has accesses within that are to be written out.
bool LoopWriter::hasAccess(Operation *op) const {
  auto result = op->walk([&](Operation *inner) {
    return (takesAll ? isDynamicAccess(inner) : counted.contains(inner))
               ? WalkResult::interrupt()
               : WalkResult::advance();
  });
  return result.wasInterrupted();
}

/// The type of the composite that an access is of.
static Type accessed(Operation *op) {
  return isa<warp::ExtractOp>(op) ? op->getOperand(0).getType()
                                  : op->getResult(0).getType();
}

//===----------------------------------------------------------------------===//
// Profitability
//===----------------------------------------------------------------------===//

bool LoopWriter::comesFromCounters(Value value) {
  if (!followed.insert(value).second || matchPattern(value, m_Constant()))
    return !others.contains(value);
  bool does = isMadeOfCounters(value);
  if (!does)
    others.insert(value);
  return does;
}

bool LoopWriter::isMadeOfCounters(Value value) {
  auto all = [&](ValueRange values) {
    return llvm::all_of(values, [&](Value v) {
      bool does = comesFromCounters(v);
      if (picked.contains(v))
        picked.insert(value);
      return does;
    });
  };
  if (auto argument = dyn_cast<BlockArgument>(value)) {
    Operation *around = argument.getOwner()->getParentOp();
    unsigned number = argument.getArgNumber();
    if (auto loop = dyn_cast<scf::WhileOp>(around)) {
      if (takesAll)
        return false;
      return argument.getOwner() == loop.getAfterBody()
                 ? all(loop.getConditionOp().getArgs()[number])
                 : all({loop.getInits()[number],
                        loop.getYieldOp()->getOperand(number)});
    }
    auto loop = dyn_cast<scf::ForOp>(around);
    // An end that a condition picks bounds the counter, no more.
    if (!loop || !comesFromCounters(loop.getUpperBound()) ||
        !all({loop.getLowerBound(), loop.getStep()}))
      return false;
    return number == 0 || all({loop.getInitArgs()[number - 1],
                               loop.getYieldedValues()[number - 1]});
  }
  Operation *def = value.getDefiningOp();
  unsigned number = cast<OpResult>(value).getResultNumber();
  // A condition picks one of two values, which are followed both.
  if (auto where = dyn_cast<warp::WhereOp>(def); where && !takesAll) {
    if (!comesFromCounters(where->getOperand(0)))
      picked.insert(value);
    return all(where->getOperands().drop_front());
  }
  if (auto loop = dyn_cast<scf::ForOp>(def)) {
    if (!comesFromCounters(loop.getUpperBound()))
      return false;
    if (picked.contains(loop.getUpperBound()))
      picked.insert(value);
    return all({loop.getInitArgs()[number], loop.getYieldedValues()[number],
                loop.getLowerBound()});
  }
  return def->getNumRegions() == 0 && isMemoryEffectFree(def) &&
         def->getNumOperands() != 0 && all(def->getOperands());
}

bool LoopWriter::isWorthTrying() {
  int64_t unknown = 0;
  bool fits = true;
  // Composites of these types stay in memory.
  llvm::DenseSet<Type> placed;
  function->walk([&](Operation *op) {
    if (isDynamicAccess(op)) {
      auto extract = dyn_cast<warp::ExtractOp>(op);
      ValueRange indices = extract ? ValueRange(extract.getIndices())
                                   : cast<warp::InsertOp>(op).getIndices();
      if (llvm::all_of(indices, [&](Value index) {
            return comesFromCounters(index) && !picked.contains(index);
          })) {
        counted.insert(op);
      } else {
        ++unknown;
        placed.insert(accessed(op));
      }
    }
    auto loop = dyn_cast<LoopLikeOpInterface>(op);
    if (!loop)
      return;
    int64_t components = 0;
    for (Value carried : loop.getInits())
      if (warp::isComposite(carried.getType()) && counts(carried.getType()))
        components += warp::getComponentCount(carried.getType());
    fits &= components <= mostComponents;
  });
  if (takesAll)
    return fits && !counted.empty() && unknown <= int64_t(counted.size()) / 2;
  // More accesses become constant than stay as they are.
  auto longest = [](auto &&types) {
    int64_t components = 0;
    for (Type type : types)
      components = std::max(components, warp::getComponentCount(type));
    return components;
  };
  SmallVector<Operation *> known(counted.begin(), counted.end());
  for (Operation *op : known)
    if (placed.contains(accessed(op)))
      counted.erase(op);
  int64_t written = longest(llvm::map_range(counted, accessed));
  return fits && written > longest(placed);
}

//===----------------------------------------------------------------------===//
// Writing
//===----------------------------------------------------------------------===//

static std::optional<APInt> constantOf(Value value) {
  APInt bits;
  return matchPattern(value, m_ConstantInt(&bits)) ? std::optional(bits)
                                                   : std::nullopt;
}

static std::optional<int64_t> valueOf(Value value) {
  auto bits = constantOf(value);
  return bits ? std::optional(bits->getSExtValue()) : std::nullopt;
}

/// The least and the greatest of the constants that a value is one of.
static std::optional<std::pair<int64_t, int64_t>> rangeOf(Value value) {
  if (auto number = valueOf(value))
    return std::pair(*number, *number);
  if (auto cast = value.getDefiningOp<warp::CastOp>()) {
    Value operand = cast->getOperand(0);
    bool isSame = operand.getType().isInteger(
        value.getType().isIndex() ? 64
                                  : value.getType().getIntOrFloatBitWidth());
    return isSame ? rangeOf(operand) : std::nullopt;
  }
  auto where = value.getDefiningOp<warp::WhereOp>();
  if (!where)
    return std::nullopt;
  auto first = rangeOf(where->getOperand(1)),
       second = rangeOf(where->getOperand(2));
  if (!first || !second)
    return std::nullopt;
  return std::pair(std::min(first->first, second->first),
                   std::max(first->second, second->second));
}

/// One iteration; `carried` are its values, and then those of the next one.
bool LoopWriter::emitBody(scf::ForOp loop, Value counter,
                          SmallVectorImpl<Value> &carried) {
  map.map(loop.getInductionVar(), counter);
  map.map(loop.getRegionIterArgs(), ArrayRef<Value>(carried));
  if (!emitBlock(*loop.getBody()))
    return false;
  for (auto [value, yielded] :
       llvm::zip_equal(carried, loop.getYieldedValues()))
    value = map.lookupOrDefault(yielded);
  return true;
}

/// The same, if the counter is below the end of the loop.
bool LoopWriter::emitGuarded(scf::ForOp loop, Value counter,
                             SmallVectorImpl<Value> &carried) {
  Location loc = loop.getLoc();
  Value end = map.lookupOrDefault(loop.getUpperBound());
  Value holds =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, counter, end);
  auto branch = scf::IfOp::create(b, loc, loop.getResultTypes(), holds,
                                  /*withElse=*/!carried.empty());
  written += 2;
  OpBuilder::InsertionGuard guard(b);
  if (!carried.empty()) {
    b.setInsertionPointToStart(branch.elseBlock());
    scf::YieldOp::create(b, loc, carried);
  }
  b.setInsertionPointToStart(branch.thenBlock());
  if (!emitBody(loop, counter, carried))
    return false;
  if (!carried.empty()) {
    b.setInsertionPointToEnd(branch.thenBlock());
    scf::YieldOp::create(b, loc, carried);
  }
  carried.assign(branch.getResults().begin(), branch.getResults().end());
  return true;
}

/// The iterations up to the greatest end that the loop may have.
bool LoopWriter::emitLoop(scf::ForOp loop, int64_t first, int64_t end,
                          int64_t step) {
  SmallVector<Value> carried = llvm::map_to_vector(
      loop.getInitArgs(), [&](Value v) { return map.lookupOrDefault(v); });
  Type type = loop.getInductionVar().getType();
  int64_t least = rangeOf(map.lookupOrDefault(loop.getUpperBound()))->first;
  for (int64_t i = first; i < end; i += step) {
    Value counter =
        arith::ConstantOp::create(b, loop.getLoc(), b.getIntegerAttr(type, i));
    if (!(i < least ? emitBody(loop, counter, carried)
                    : emitGuarded(loop, counter, carried)))
      return false;
  }
  map.map(loop.getResults(), carried);
  return true;
}

/// The iterations of a loop from one with these values on: the next one is
/// within the branch of this one, unless what it depends on is known.
bool LoopWriter::emitIterations(scf::WhileOp loop, SmallVector<Value> carried,
                                int count, SmallVectorImpl<Value> &results) {
  if (count > mostBranches)
    return false;
  auto lookUp = [&](ValueRange values) {
    return llvm::map_to_vector(values,
                               [&](Value v) { return map.lookupOrDefault(v); });
  };
  auto condition = loop.getConditionOp();
  map.map(loop.getBeforeArguments(), carried);
  if (!emitBlock(*loop.getBeforeBody()))
    return false;
  SmallVector<Value> passed = lookUp(condition.getArgs());
  Value holds = map.lookupOrDefault(condition.getCondition());
  std::optional<int64_t> isKnown = valueOf(holds);
  if (isKnown && *isKnown == 0) {
    results.assign(passed.begin(), passed.end());
    return true;
  }
  auto emitRest = [&](SmallVectorImpl<Value> &rest) {
    map.map(loop.getAfterArguments(), passed);
    return emitBlock(*loop.getAfterBody()) &&
           emitIterations(loop, lookUp(loop.getYieldOp()->getOperands()),
                          count + 1, rest);
  };
  if (isKnown)
    return emitRest(results);
  auto branch = scf::IfOp::create(b, loop.getLoc(), loop.getResultTypes(),
                                  holds, /*withElse=*/true);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loop.getLoc(), passed);
  b.setInsertionPointToStart(branch.thenBlock());
  SmallVector<Value> rest;
  if (!emitRest(rest))
    return false;
  scf::YieldOp::create(b, loop.getLoc(), rest);
  results.assign(branch.getResults().begin(), branch.getResults().end());
  return true;
}

/// A side that is known.
bool LoopWriter::emitBranch(scf::IfOp branch) {
  bool holds = *valueOf(map.lookupOrDefault(branch.getCondition())) != 0;
  Region &side = holds ? branch.getThenRegion() : branch.getElseRegion();
  if (side.empty())
    return true;
  if (!emitBlock(side.front()))
    return false;
  for (auto [result, yielded] : llvm::zip_equal(
           branch.getResults(), side.front().getTerminator()->getOperands()))
    map.map(result, map.lookupOrDefault(yielded));
  return true;
}

/// Control flow that stays, around what is written.
bool LoopWriter::emitAround(Operation *op) {
  SmallVector<Value> operands = llvm::map_to_vector(
      op->getOperands(), [&](Value v) { return map.lookupOrDefault(v); });
  OperationState state(op->getLoc(), op->getName(), operands,
                       op->getResultTypes(), op->getAttrs());
  for (unsigned i = 0; i < op->getNumRegions(); ++i)
    state.addRegion();
  Operation *made = b.create(state);
  map.map(op->getResults(), made->getResults());
  for (auto [from, to] :
       llvm::zip_equal(op->getRegions(), made->getRegions())) {
    if (from.empty())
      continue;
    OpBuilder::InsertionGuard guard(b);
    Block &old = from.front();
    SmallVector<Location> places(old.getNumArguments(), op->getLoc());
    Block *block = b.createBlock(&to, to.end(), old.getArgumentTypes(), places);
    map.map(old.getArguments(), block->getArguments());
    if (!emitBlock(old))
      return false;
    b.clone(*old.getTerminator(), map);
  }
  return true;
}

Value LoopWriter::constant(Operation *op, const APInt &bits) {
  auto type = cast<IntegerType>(op->getResult(0).getType());
  IntegerAttr attribute = b.getIntegerAttr(type, bits);
  if (type.isSignless())
    return arith::ConstantOp::create(b, op->getLoc(), attribute);
  return warp::ConstantOp::create(b, op->getLoc(), attribute);
}

/// The facts about a value once the operands are known.
Value LoopWriter::known(Operation *op) {
  StringRef name = op->getName().stripDialect();
  SmallVector<Value> x = llvm::map_to_vector(
      op->getOperands(), [&](Value v) { return map.lookupOrDefault(v); });
  if (op->getNumResults() != 1 || x.empty() ||
      op->getName().getDialectNamespace() != "warp")
    return nullptr;
  auto first = constantOf(x[0]);
  if (name == "where" && first)
    return first->isZero() ? x[2] : x[1];
  if (name == "bit_and" && x[0].getType().isInteger(1))
    for (unsigned i : {0, 1})
      if (auto bit = constantOf(x[i]))
        return bit->isZero() ? x[i] : x[1 - i];
  auto type = dyn_cast<IntegerType>(op->getResult(0).getType());
  if (!type || !first)
    return nullptr;
  if (name == "unot" && type.isInteger(1))
    return constant(op, ~*first);
  if (isa<warp::CastOp>(op))
    return type.getWidth() == first->getBitWidth() ? constant(op, *first)
                                                   : Value();
  auto second = x.size() == 2 ? constantOf(x[1]) : std::nullopt;
  if (!second || x[0].getType() != x[1].getType())
    return nullptr;
  warp::IntegerFold fold{*first, *second, x[0].getType().isUnsignedInteger()};
  std::optional<APInt> bits =
      type.getWidth() == 1 ? fold.compare(name) : fold.divide(name);
  for (auto next : {&warp::IntegerFold::shift, &warp::IntegerFold::combine})
    if (!bits && type.getWidth() == first->getBitWidth())
      bits = (fold.*next)(name);
  return bits ? constant(op, *bits) : Value();
}

/// An element of a composite that a condition picks: the condition picks one of
/// two elements, which are known if those of constants are.
Value LoopWriter::extract(warp::ExtractOp op, Value source,
                          ValueRange indices) {
  Location loc = op.getLoc();
  ++written;
  if (auto where = source.getDefiningOp<warp::WhereOp>()) {
    Value first = extract(op, where->getOperand(1), indices),
          second = extract(op, where->getOperand(2), indices);
    if (first == second)
      return first;
    OperationState state(loc, where->getName(),
                         {where->getOperand(0), first, second},
                         op->getResultTypes());
    return b.create(state)->getResult(0);
  }
  auto made = warp::ExtractOp::create(b, loc, op.getResult().getType(), source,
                                      indices);
  SmallVector<Value> folded;
  if (failed(b.tryFold(made, folded)) || folded.empty())
    return made;
  made->erase();
  return folded.front();
}

bool LoopWriter::emit(Operation *op) {
  if (Value value = known(op)) {
    map.map(op->getResult(0), value);
    return true;
  }
  auto numberOf = [&](Value value) {
    return valueOf(map.lookupOrDefault(value));
  };
  if (auto branch = dyn_cast<scf::IfOp>(op);
      branch && numberOf(branch.getCondition()))
    return emitBranch(branch);
  bool accesses = op->getNumRegions() != 0 && hasAccess(op);
  auto isFollowed = [&](Value argument) { return followed.contains(argument); };
  if (auto loop = dyn_cast<scf::ForOp>(op);
      loop && accesses &&
      llvm::any_of(loop.getBody()->getArguments(), isFollowed)) {
    auto first = numberOf(loop.getLowerBound()),
         step = numberOf(loop.getStep());
    auto ends = rangeOf(map.lookupOrDefault(loop.getUpperBound()));
    if (first && ends && step && *step > 0) {
      bool isOpen = ends->first != ends->second;
      int64_t most = isOpen ? mostBranches : mostOperations;
      if (ends->second - *first <= most * *step && !(isOpen && takesAll))
        return emitLoop(loop, *first, ends->second, *step);
    }
  }
  if (auto loop = dyn_cast<scf::WhileOp>(op);
      loop && accesses && !takesAll &&
      llvm::any_of(loop.getAfterArguments(), isFollowed)) {
    SmallVector<Value> results,
        inits = llvm::map_to_vector(
            loop.getInits(), [&](Value v) { return map.lookupOrDefault(v); });
    if (!emitIterations(loop, inits, 0, results))
      return false;
    map.map(loop.getResults(), results);
    return true;
  }
  if (accesses)
    return emitAround(op);
  if (auto access = dyn_cast<warp::ExtractOp>(op); access && !takesAll) {
    Value source = map.lookupOrDefault(access->getOperand(0));
    SmallVector<Value> indices = llvm::map_to_vector(
        access.getIndices(), [&](Value v) { return map.lookupOrDefault(v); });
    if (source.getDefiningOp<warp::WhereOp>() && !warp::isDynamic(indices)) {
      map.map(access.getResult(), extract(access, source, indices));
      return written <= mostOperations;
    }
  }
  // The result for an earlier copy of the same operation does not hold for this
  // one.
  op->walk([&](Block *block) {
    map.erase(block);
    for (BlockArgument argument : block->getArguments())
      map.erase(argument);
  });
  Operation *made = b.clone(*op, map);
  made->walk([&](Operation *) { ++written; });
  SmallVector<Value> folded;
  if (made->getNumResults() != 0 && made->getNumRegions() == 0 &&
      succeeded(b.tryFold(made, folded)) && !folded.empty()) {
    map.map(op->getResults(), folded);
    made->erase();
    --written;
  } else if (counted.contains(op) && isDynamicAccess(made)) {
    return false;
  }
  return written <= mostOperations;
}

bool LoopWriter::emitBlock(Block &block) {
  return llvm::all_of(block.without_terminator(),
                      [&](Operation &op) { return emit(&op); });
}

//===----------------------------------------------------------------------===//
// All
//===----------------------------------------------------------------------===//

static void drop(Block &block) {
  block.dropAllReferences();
  block.dropAllDefinedValueUses();
  block.erase();
}

void LoopWriter::run() {
  if (!isWorthTrying())
    return;
  Block &entry = function.getFunctionBody().front();
  Block *made = b.createBlock(&function.getFunctionBody());
  if (!emitBlock(entry))
    return drop(*made);
  Operation *end = entry.getTerminator();
  for (OpOperand &operand : end->getOpOperands())
    operand.set(map.lookupOrDefault(operand.get()));
  // The old operations go, in a block of their own.
  Block *old = b.createBlock(&function.getFunctionBody());
  old->getOperations().splice(old->end(), entry.getOperations(), entry.begin(),
                              end->getIterator());
  entry.getOperations().splice(end->getIterator(), made->getOperations());
  made->erase();
  drop(*old);
}

void warp::unrollLocals(FunctionOpInterface function, UnrollFor composites) {
  LoopWriter(function, composites).run();
}
