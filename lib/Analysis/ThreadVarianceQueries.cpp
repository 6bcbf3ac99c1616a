//===- ThreadVarianceQueries.cpp - Queries of the divergence analysis -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Queries that combine the facts of ThreadVariance.cpp about single values.
//
//===----------------------------------------------------------------------===//

#include "GridReads.h"
#include "ThreadVariance.h"

#include "mlir/Interfaces/SideEffectInterfaces.h"

using namespace mlir;
using warp::Agreement;
using warp::Scope;
using warp::ThreadVariance;

Agreement ThreadVariance::agreement(uint16_t sources, Scope scope) const {
  uint16_t differing = AnyIndex | Own | Place | Run;
  if (scope == Scope::Group)
    differing = AnyIndex | Own | Run;
  if (scope == Scope::Lanes)
    differing = lastIndex | Own;
  if (sources & differing)
    return Agreement::No;
  return sources & Moment ? Agreement::InStep : Agreement::Yes;
}

Agreement ThreadVariance::agreement(Value value, Scope scope) const {
  return agreement(get(value).sources, scope);
}

Agreement ThreadVariance::agreement(Symbol symbol, Scope scope) const {
  switch (symbol.kind) {
  case Symbol::Kind::Thread:
    return agreement(uint16_t(1 << symbol.number), scope);
  case Symbol::Kind::Trip:
    return Agreement::InStep;
  case Symbol::Kind::Extent:
  case Symbol::Kind::Opaque:
    return agreement(symbol.getValue(), scope);
  }
  llvm_unreachable("no such symbol");
}

bool ThreadVariance::isUniformIfEqual(Value value,
                                      llvm::SetVector<Value> &ifEqual) const {
  SmallVector<Value> pending{value};
  DenseSet<Value> seen;
  while (!pending.empty()) {
    Value next = pending.pop_back_val();
    State state = get(next);
    if (varies(state))
      return false;
    if ((state.sources & ~Place) == 0 || !seen.insert(next).second)
      continue;
    Operation *op = next.getDefiningOp();
    if (!op) {
      auto argument = cast<BlockArgument>(next);
      // The index of another dimension than the last.
      if (isa<ThreadsOp>(argument.getOwner()->getParentOp())) {
        ifEqual.insert(next);
        continue;
      }
      auto loop = dyn_cast<scf::ForOp>(argument.getOwner()->getParentOp());
      if (!loop || argument != loop.getInductionVar())
        return false;
      ifEqual.insert(next);
      pending.append({loop.getStep(), loop.getLowerBound()});
    } else if (getGridRead(next)) {
      ifEqual.insert(next);
    } else if (isPure(op) && op->getNumRegions() == 0) {
      for (Value operand : llvm::reverse(op->getOperands()))
        pending.push_back(operand);
    } else {
      return false;
    }
  }
  return true;
}

std::optional<int64_t>
ThreadVariance::strideIfEqual(Value value, scf::ForOp loop,
                              llvm::SetVector<Value> &ifEqual) const {
  Symbol trip = Symbol::trip(loop);
  const Form &whole = form(value);
  std::optional<Form> coefficient = whole.coefficientOf(trip);
  std::optional<int64_t> stride =
      coefficient ? coefficient->getConstant() : std::nullopt;
  if (!stride)
    return std::nullopt;
  llvm::SetVector<Value> needed;
  SmallVector<Value> parts;
  if (*stride == 0) {
    parts.push_back(value);
  } else {
    for (const Term &term : whole.without(trip).terms)
      for (Symbol symbol : term.product) {
        auto outer = dyn_cast_or_null<scf::ForOp>(symbol.getLoop());
        parts.push_back(outer ? outer.getInductionVar() : symbol.getValue());
      }
  }
  for (Value part : parts)
    if (!part || !isUniformIfEqual(part, needed))
      return std::nullopt;
  if (needed.contains(loop.getInductionVar()))
    return std::nullopt;
  ifEqual.insert_range(needed);
  return stride;
}

std::optional<int64_t> ThreadVariance::step(Value value) const {
  int64_t step = get(value).step;
  return step == noStep ? std::nullopt : std::optional(step);
}

SmallVector<Value, 3> ThreadVariance::decisionsOf(Operation *op) {
  if (auto branch = dyn_cast<scf::IfOp>(op))
    return {branch.getCondition()};
  if (auto loop = dyn_cast<scf::ForOp>(op))
    return {loop.getLowerBound(), loop.getUpperBound(), loop.getStep()};
  if (auto loop = dyn_cast<scf::WhileOp>(op))
    return {loop.getConditionOp().getCondition()};
  return {};
}

bool ThreadVariance::isDivergent(Operation *op, Scope scope) const {
  return llvm::any_of(decisionsOf(op), [&](Value decision) {
    return !isUniform(decision, scope);
  });
}

bool ThreadVariance::tellThreadsApart(ArrayRef<const Form *> indices,
                                      unsigned dim, bool mayWrap) const {
  Symbol thread = Symbol::thread(dim);
  uint64_t factor = 0;
  int64_t low = 0, high = 0;
  for (const Form *index : indices) {
    std::optional<Form> coefficient = index->coefficientOf(thread);
    auto own = coefficient ? coefficient->getConstant() : std::nullopt;
    if (!own || *own == 0 || (!mayWrap && index->terms.size() > 1))
      return false;
    for (const Term &term : index->without(thread).terms)
      for (Symbol symbol : term.product)
        if (agreement(symbol, Scope::Launch) != Agreement::Yes)
          return false;
    std::optional<Form> distance = *index - *indices.front();
    auto offset = distance ? distance->getConstant() : std::nullopt;
    if (!offset)
      return false;
    factor = *own < 0 ? -uint64_t(*own) : uint64_t(*own);
    low = std::min(low, *offset);
    high = std::max(high, *offset);
  }
  return !indices.empty() && uint64_t(high) - uint64_t(low) < factor &&
         (mayWrap || indices.front()->constant + low >= 0);
}
