//===- RunLoop.cpp - Loops over runs of neighbours ------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "RunLoop.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using warp::RunLoop;

/// True if a condition does not hold where place < end.
static bool meansEnd(Value condition, Value place, Value end) {
  Operation *op = condition.getDefiningOp();
  if (auto compare = dyn_cast_or_null<arith::CmpIOp>(op))
    return compare.getPredicate() == arith::CmpIPredicate::sge &&
           compare.getLhs() == place && compare.getRhs() == end;
  if (auto conjunction = dyn_cast_or_null<arith::AndIOp>(op))
    return meansEnd(conjunction.getLhs(), place, end) ||
           meansEnd(conjunction.getRhs(), place, end);
  auto branch = dyn_cast_or_null<scf::IfOp>(op);
  return branch && branch.elseBlock() &&
         matchPattern(branch.elseYield().getOperand(
                          cast<OpResult>(condition).getResultNumber()),
                      m_Zero()) &&
         meansEnd(branch.getCondition(), place, end);
}

/// The argument of a block that a value is; none if it is something else.
static std::optional<unsigned> argumentOf(Value value, Block *block) {
  auto argument = dyn_cast<BlockArgument>(value);
  if (!argument || argument.getOwner() != block)
    return std::nullopt;
  return argument.getArgNumber();
}

/// The argument of a loop that a value passed to its body is, as long as `seek`
/// has nothing to do.
static std::optional<unsigned> sourceOf(Value value, scf::WhileOp loop,
                                        scf::WhileOp seek) {
  auto result = dyn_cast<OpResult>(value);
  if (result && result.getOwner() == seek) {
    Value passed = seek.getConditionOp().getArgs()[result.getResultNumber()];
    auto own = argumentOf(passed, seek.getBeforeBody());
    if (!own)
      return std::nullopt;
    value = seek.getInits()[*own];
  }
  return argumentOf(value, loop.getBeforeBody());
}

std::optional<RunLoop> warp::findRuns(scf::WhileOp loop) {
  RunLoop found{loop, 0, 0, {}};
  Block *before = loop.getBeforeBody();
  scf::ConditionOp condition = loop.getConditionOp();
  auto seek = dyn_cast<scf::WhileOp>(before->front());
  auto goesOn = condition.getCondition().getDefiningOp<arith::CmpIOp>();
  bool isPlain = seek && goesOn && seek->getNextNode() == goesOn &&
                 goesOn->getNextNode() == condition &&
                 goesOn.getPredicate() == arith::CmpIPredicate::slt;
  if (!isPlain)
    return std::nullopt;
  auto place = dyn_cast<OpResult>(goesOn.getLhs());
  auto end = dyn_cast<OpResult>(goesOn.getRhs());
  if (!place || !end || place.getOwner() != seek || end.getOwner() != seek)
    return std::nullopt;
  ValueRange passed = seek.getConditionOp().getArgs();
  if (!meansEnd(seek.getConditionOp().getCondition(),
                passed[place.getResultNumber()], passed[end.getResultNumber()]))
    return std::nullopt;
  llvm::SmallDenseSet<unsigned> covered;
  bool hasPlace = false, hasEnd = false;
  for (auto [i, value] : llvm::enumerate(condition.getArgs())) {
    auto source = sourceOf(value, loop, seek);
    if (!source)
      return std::nullopt;
    found.sources.push_back(*source);
    covered.insert(*source);
    if (value == place && !hasPlace)
      found.place = unsigned(i), hasPlace = true;
    if (value == end && !hasEnd)
      found.end = unsigned(i), hasEnd = true;
  }
  bool isWhole = covered.size() == before->getNumArguments();
  if (!hasPlace || !hasEnd || !isWhole)
    return std::nullopt;
  auto step = found.next(found.place).getDefiningOp<arith::AddIOp>();
  bool goesOnByOne = step && step.getLhs() == found.argument(found.place) &&
                     matchPattern(step.getRhs(), m_One()) &&
                     found.next(found.end) == found.argument(found.end);
  return goesOnByOne ? std::optional(found) : std::nullopt;
}
