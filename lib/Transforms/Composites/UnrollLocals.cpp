//===- UnrollLocals.cpp - Loops over components of long values ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Memory of a thread is slow beside registers, which have no numbers. Where the
// indices of long composites come from nothing but counters of loops, as those
// of a Fourier transform of fixed length do, the loops are written out: each
// operation is copied with what is known by then and folded. That is tried
// beside the code and taken if no index is left that is known at run time only,
// and if the code is short and the values fit registers. Iterations of a loop
// that may end early are branches in each other, of which the innermost is the
// last.
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
  bool hasDynamicAccess(Operation *op) const;
  bool comesFromCounters(Value value);
  bool isMadeOfCounters(Value value);
  bool isWorthTrying();
  bool emitBlock(Block &block);
  bool emitLoop(scf::ForOp loop, int64_t first, int64_t count, int64_t step);
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

bool LoopWriter::hasDynamicAccess(Operation *op) const {
  auto result = op->walk([&](Operation *inner) {
    return isDynamicAccess(inner) ? WalkResult::interrupt()
                                  : WalkResult::advance();
  });
  return result.wasInterrupted();
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
    return llvm::all_of(values, [&](Value v) { return comesFromCounters(v); });
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
    if (!loop ||
        !all({loop.getLowerBound(), loop.getUpperBound(), loop.getStep()}))
      return false;
    return number == 0 || all({loop.getInitArgs()[number - 1],
                               loop.getYieldedValues()[number - 1]});
  }
  Operation *def = value.getDefiningOp();
  unsigned number = cast<OpResult>(value).getResultNumber();
  if (auto loop = dyn_cast<scf::ForOp>(def))
    return all({loop.getInitArgs()[number], loop.getYieldedValues()[number],
                loop.getLowerBound(), loop.getUpperBound()});
  return def->getNumRegions() == 0 && isMemoryEffectFree(def) &&
         def->getNumOperands() != 0 && all(def->getOperands());
}

bool LoopWriter::isWorthTrying() {
  int64_t unknown = 0;
  bool fits = true;
  function->walk([&](Operation *op) {
    if (isDynamicAccess(op)) {
      auto extract = dyn_cast<warp::ExtractOp>(op);
      ValueRange indices = extract ? ValueRange(extract.getIndices())
                                   : cast<warp::InsertOp>(op).getIndices();
      if (llvm::all_of(indices,
                       [&](Value index) { return comesFromCounters(index); }))
        counted.insert(op);
      else
        ++unknown;
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
  int64_t most = takesAll ? int64_t(counted.size()) / 2 : 0;
  return fits && !counted.empty() && unknown <= most;
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

bool LoopWriter::emitLoop(scf::ForOp loop, int64_t first, int64_t count,
                          int64_t step) {
  SmallVector<Value> carried = llvm::map_to_vector(
      loop.getInitArgs(), [&](Value v) { return map.lookupOrDefault(v); });
  Type type = loop.getInductionVar().getType();
  for (int64_t i = 0; i < count; ++i) {
    Value counter = arith::ConstantOp::create(
        b, loop.getLoc(), b.getIntegerAttr(type, first + i * step));
    map.map(loop.getInductionVar(), counter);
    map.map(loop.getRegionIterArgs(), carried);
    if (!emitBlock(*loop.getBody()))
      return false;
    carried = llvm::map_to_vector(loop.getYieldedValues(), [&](Value v) {
      return map.lookupOrDefault(v);
    });
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
  bool accesses = op->getNumRegions() != 0 && hasDynamicAccess(op);
  auto isFollowed = [&](Value argument) { return followed.contains(argument); };
  if (auto loop = dyn_cast<scf::ForOp>(op);
      loop && accesses &&
      llvm::any_of(loop.getBody()->getArguments(), isFollowed)) {
    auto first = numberOf(loop.getLowerBound()),
         end = numberOf(loop.getUpperBound()), step = numberOf(loop.getStep());
    if (first && end && step && *step > 0 &&
        *end - *first <= mostOperations * *step)
      return emitLoop(
          loop, *first,
          std::max<int64_t>(0, llvm::divideCeilSigned(*end - *first, *step)),
          *step);
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
