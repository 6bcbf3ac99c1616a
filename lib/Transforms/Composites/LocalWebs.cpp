//===- LocalWebs.cpp - Live ranges that share memory (webs) ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LocalWebs.h"

#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"
#include "mlir/Interfaces/LoopLikeInterface.h"
#include "llvm/ADT/SetVector.h"

using namespace mlir;

/// Versions of one variable that are compared with each other.
static constexpr size_t maxVersions = 512;

//===----------------------------------------------------------------------===//
// Edges
//===----------------------------------------------------------------------===//

using Edges = SmallVectorImpl<warp::LocalEdge>;

static void addEdge(Edges &edges, OpOperand &source, ValueRange targets) {
  if (warp::isLongComposite(source.get().getType()))
    edges.push_back({&source, SmallVector<Value, 2>(targets)});
}

static void addEdges(Edges &edges, scf::ForOp loop) {
  for (auto [init, argument, result, yielded] :
       llvm::zip(loop.getInitArgsMutable(), loop.getRegionIterArgs(),
                 loop.getResults(),
                 cast<scf::YieldOp>(loop.getBody()->getTerminator())
                     ->getOpOperands())) {
    // Without an iteration the result is what the loop begins with.
    addEdge(edges, init, {argument, result});
    addEdge(edges, yielded, {argument, result});
  }
}

static void addEdges(Edges &edges, scf::WhileOp loop) {
  for (auto [init, argument, yielded] :
       llvm::zip(loop.getInitsMutable(), loop.getBeforeArguments(),
                 loop.getYieldOp()->getOpOperands())) {
    addEdge(edges, init, argument);
    addEdge(edges, yielded, argument);
  }
  for (auto [passed, argument, result] :
       llvm::zip(loop.getConditionOp().getArgsMutable(),
                 loop.getAfterArguments(), loop.getResults()))
    addEdge(edges, passed, {argument, result});
}

static void addEdges(Edges &edges, scf::IfOp branch) {
  if (!branch.getNumResults())
    return;
  for (scf::YieldOp yield : {branch.thenYield(), branch.elseYield()})
    for (auto [yielded, result] :
         llvm::zip(yield->getOpOperands(), branch.getResults()))
      addEdge(edges, yielded, result);
}

void warp::LocalWebs::collect(Operation *function) {
  function->walk<WalkOrder::PreOrder>([&](Operation *op) {
    if (auto insert = dyn_cast<InsertOp>(op))
      addEdge(edges, insert.getTargetMutable(), insert.getResult());
    else if (auto loop = dyn_cast<scf::ForOp>(op))
      addEdges(edges, loop);
    else if (auto loop = dyn_cast<scf::WhileOp>(op))
      addEdges(edges, loop);
    else if (auto branch = dyn_cast<scf::IfOp>(op))
      addEdges(edges, branch);
  });
}

//===----------------------------------------------------------------------===//
// Values to place
//===----------------------------------------------------------------------===//

bool warp::isDynamic(ValueRange indices) {
  return llvm::any_of(
      indices, [](Value index) { return !matchPattern(index, m_Constant()); });
}

bool warp::hasDynamicAccess(Value version) {
  if (auto insert = version.getDefiningOp<warp::InsertOp>())
    if (isDynamic(insert.getIndices()))
      return true;
  return llvm::any_of(version.getUsers(), [](Operation *user) {
    auto extract = dyn_cast<warp::ExtractOp>(user);
    return extract && isDynamic(extract.getIndices());
  });
}

void warp::LocalWebs::select() {
  llvm::EquivalenceClasses<Value> variables;
  llvm::SetVector<Value> found;
  for (const LocalEdge &edge : edges)
    for (Value target : edge.targets) {
      found.insert(target);
      variables.unionSets(edge.targets.front(), target);
    }
  for (const LocalEdge &edge : edges)
    if (found.contains(edge.source->get()))
      variables.unionSets(edge.source->get(), edge.targets.front());
  llvm::DenseMap<Value, size_t> counts;
  llvm::DenseSet<Value> wanted;
  for (Value version : found) {
    Value variable = variables.getLeaderValue(version);
    ++counts[variable];
    if (hasDynamicAccess(version))
      wanted.insert(variable);
  }
  for (Value version : found) {
    Value variable = variables.getLeaderValue(version);
    if (wanted.contains(variable) && counts[variable] <= maxVersions) {
      versions.push_back(version);
      webs[version] = variable;
    }
  }
  llvm::erase_if(edges, [&](const LocalEdge &edge) {
    return !isPlaced(edge.targets.front());
  });
}

//===----------------------------------------------------------------------===//
// Versions that are needed at once
//===----------------------------------------------------------------------===//

/// True if a value is there when control comes to an operation.
static bool isDefinedBefore(Value value, Operation *op) {
  Operation *definition = value.getDefiningOp();
  if (!definition)
    return value.getParentBlock()->findAncestorOpInBlock(*op);
  Operation *here = definition->getBlock()->findAncestorOpInBlock(*op);
  return here && definition->isBeforeInBlock(here);
}

/// True if a use may come after an operation, either in this iteration or in
/// a later one of a loop around both.
static bool mayComeAfter(Value value, Operation *use, Operation *op) {
  for (Operation *here = op; here; here = here->getParentOp()) {
    Block *block = here->getBlock();
    Operation *there = block ? block->findAncestorOpInBlock(*use) : nullptr;
    if (!there)
      continue;
    bool isLater = here != there && here->isBeforeInBlock(there);
    if (here == there && use != here)
      isLater = here == op || !isa<scf::IfOp>(here);
    for (Operation *loop = here->getParentOp(); loop && !isLater;
         loop = loop->getParentOp()) {
      if (loop->isProperAncestor(value.getParentBlock()->getParentOp()) ||
          loop == value.getParentBlock()->getParentOp())
        break;
      isLater = isa<LoopLikeOpInterface>(loop);
    }
    return isLater;
  }
  return true;
}

/// True if a version is needed after an operation has written its memory.
static bool isNeeded(Value version, Operation *op) {
  if (!isDefinedBefore(version, op))
    return false;
  return llvm::any_of(version.getUses(), [&](OpOperand &use) {
    // An operation forwards all its values at once.
    if (use.getOwner() == op)
      return !isa<warp::InsertOp>(op);
    return mayComeAfter(version, use.getOwner(), op);
  });
}

/// True if an operation that writes the next version of a variable forwards
/// this one to another.
static bool isHandedOnElsewhere(Value version, OpOperand &source) {
  return llvm::any_of(version.getUses(), [&](OpOperand &use) {
    return use.getOwner() == source.getOwner() && &use != &source;
  });
}

bool warp::LocalWebs::isCopy(const LocalEdge &edge) const {
  Value source = edge.source->get();
  return !isPlaced(source) || llvm::any_of(edge.targets, [&](Value target) {
    return getWeb(target) != getWeb(source);
  });
}

bool warp::LocalWebs::conflicts(Value web) const {
  SmallVector<Value> members;
  for (Value version : versions)
    if (getWeb(version) == web)
      members.push_back(version);
  llvm::DenseMap<Operation *, unsigned> positions;
  for (const LocalEdge &edge : edges) {
    if (getWeb(edge.targets.front()) != web)
      continue;
    Operation *op = edge.source->getOwner();
    // Two variables of one loop or branch have a memory each.
    auto [known, isNew] =
        positions.try_emplace(op, edge.source->getOperandNumber());
    if (!isNew && known->second != edge.source->getOperandNumber())
      return true;
    if (!isa<InsertOp>(op) && !isCopy(edge))
      continue;
    for (Value version : members) {
      bool isTarget = llvm::is_contained(edge.targets, version);
      if (isTarget ? isHandedOnElsewhere(version, *edge.source)
                   : isNeeded(version, op))
        return true;
    }
  }
  return false;
}

bool warp::LocalWebs::merge(ArrayRef<Value> members) {
  Value web = getWeb(members.front());
  SmallVector<std::pair<Value, Value>> before;
  for (Value member : members) {
    Value other = getWeb(member);
    if (other == web)
      continue;
    for (Value version : versions)
      if (getWeb(version) == other) {
        before.push_back({version, other});
        webs[version] = web;
      }
  }
  if (before.empty() || !conflicts(web))
    return true;
  for (auto [version, old] : before)
    webs[version] = old;
  return false;
}

void warp::LocalWebs::drop(ArrayRef<Value> members) {
  for (Value member : members)
    webs.erase(member);
  llvm::erase_if(versions, [&](Value version) { return !isPlaced(version); });
  llvm::erase_if(edges, [&](const LocalEdge &edge) {
    return !isPlaced(edge.targets.front());
  });
}

void warp::LocalWebs::merge() {
  llvm::SetVector<Value> variables;
  for (Value version : versions)
    variables.insert(getWeb(version));
  SmallVector<Value> dropped;
  for (Value variable : variables) {
    if (!conflicts(variable))
      continue;
    SmallVector<Value> members;
    for (Value version : versions)
      if (getWeb(version) == variable)
        members.push_back(version);
    for (Value member : members)
      webs[member] = member;
    bool fits = true;
    llvm::DenseSet<Value> all(members.begin(), members.end());
    for (const LocalEdge &edge : edges)
      if (all.contains(edge.targets.front()))
        fits &= merge(edge.targets);
    for (const LocalEdge &edge : edges) {
      Value source = edge.source->get();
      if (all.contains(edge.targets.front()) && isPlaced(source))
        merge({edge.targets.front(), source});
    }
    for (Value member : members)
      fits &= getWeb(member) != member || !conflicts(member);
    if (!fits)
      llvm::append_range(dropped, members);
  }
  drop(dropped);
}

warp::LocalWebs::LocalWebs(Operation *function) {
  collect(function);
  select();
  merge();
}
