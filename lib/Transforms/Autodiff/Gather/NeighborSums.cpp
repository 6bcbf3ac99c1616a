//===- NeighborSums.cpp - Stencil updates around a thread -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Finds the sums of an adjoint that can be turned round, from "my value goes to
// my neighbours" to "my sum comes from my neighbours". For one gradient array:
//
//   index    every access is an addition at `thread index + constant`, where
//   the
//            dimensions of the launch and of the array correspond one to one. A
//            negative index would count from the end, so the branches around
//            have to exclude that. In other dimensions of the array, such as
//            that of a channel, the index is the same in all threads.
//   value    it and the conditions of the branches depend on thread indices,
//            arguments, and on elements that hold, before the launch, what the
//            thread is going to read: elements of arrays that the launch does
//            not write, and those that only this thread writes, later.
//
// Loops are no branches; those of a few trips have been unrolled before.
//
//===----------------------------------------------------------------------===//

#include "NeighborSums.h"

#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "Analysis/Ranges.h"
#include "Analysis/ThreadVariance.h"
#include "Autodiff/DeadValues.h"
#include "GatherGuard.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

/// Keeps sums of an index, an offset and the extents of a launch in 32 bits.
constexpr int64_t maxOffset = 1024;

std::optional<Shift> getShift(Value value) {
  if (!value.getType().isSignedInteger())
    return std::nullopt;
  return getShift(Forms().of(value));
}

std::optional<Shift> getShift(const Form &form) {
  if (form.terms.size() != 1 || form.terms[0].factor != 1 ||
      form.terms[0].product.size() != 1 || std::abs(form.constant) > maxOffset)
    return std::nullopt;
  Symbol symbol = form.terms[0].product[0];
  if (symbol.kind != Symbol::Kind::Thread)
    return std::nullopt;
  return Shift{symbol.number, form.constant};
}

bool isUniform(Value value) {
  if (getConstantInteger(value))
    return true;
  auto adjoint =
      value.getParentRegion()->getParentOfType<FunctionOpInterface>();
  return ThreadVariance(adjoint, /*disjoint=*/true)
      .isUniform(value, Scope::Launch);
}

bool NeighborIndex::operator==(const NeighborIndex &other) const {
  if (!fixed || !other.fixed || fixed == other.fixed)
    return fixed == other.fixed && dimension == other.dimension;
  std::optional<int64_t> number = getConstantInteger(fixed);
  return number && number == getConstantInteger(other.fixed);
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

namespace {

class Finder {
public:
  Finder(func::FuncOp adjoint, const llvm::DenseSet<Operation *> &borders)
      : adjoint(adjoint), borders(borders), leaves(adjoint) {}

  SmallVector<NeighborSums> find(unsigned &rank);

private:
  bool collect();
  std::optional<ArrayMemory> getMemory(Value array) const;
  std::optional<SmallVector<std::optional<Shift>>>
  getElement(Operation *op) const;
  bool isOwn(Operation *op) const;
  bool mayComeBefore(Operation *write, Operation *read) const;
  bool readsInitialValue(AccessOp load);
  bool isRecomputable(Operation *op);
  bool areBranchesAround(Operation *op) const;
  std::optional<NeighborSum> parse(AccumulateOp op,
                                   SmallVector<NeighborIndex, 4> &indices);
  bool add(AccumulateOp op, SmallVectorImpl<NeighborSums> &groups);

  func::FuncOp adjoint;
  const llvm::DenseSet<Operation *> &borders;
  ArrayLeaves leaves;
  unsigned rank = 0;
  /// The operations that add to, or otherwise change, an array.
  std::map<ArrayMemory, SmallVector<Operation *>> writes;
  std::map<ArrayMemory, SmallVector<Operation *>> reads;
  DenseMap<Operation *, unsigned> positions;
  DenseMap<Operation *, bool> recomputable;
};

} // namespace

std::optional<ArrayMemory> Finder::getMemory(Value array) const {
  Value owner = gradientOwner(array);
  SmallVector<unsigned, 1> found = leaves.of(owner ? owner : array);
  if (found.size() != 1)
    return std::nullopt;
  return ArrayMemory{found.front(), bool(owner)};
}

/// Lists accesses by array. False if an operation may do what is not known.
bool Finder::collect() {
  unsigned position = 0;
  return !adjoint.getBody()
              .walk<WalkOrder::PreOrder>([&](Operation *op) {
                positions[op] = position++;
                if (auto tid = dyn_cast<TidOp>(op)) {
                  bool isUsual = llvm::all_of(tid.getResultTypes(), [](Type t) {
                    return t.isSignedInteger(32);
                  });
                  if (!isUsual || (rank && rank != tid.getNumResults()))
                    return WalkResult::interrupt();
                  rank = tid.getNumResults();
                }
                bool isRead = isPlainRead(op);
                if (!isRead && (!hasOwnEffect(op) || isa<AssertOp>(op)))
                  return WalkResult::advance();
                for (Value operand : op->getOperands()) {
                  if (!isa<ArrayType>(operand.getType()))
                    continue;
                  std::optional<ArrayMemory> memory = getMemory(operand);
                  if (!memory)
                    return WalkResult::interrupt();
                  (isRead ? reads : writes)[*memory].push_back(op);
                }
                return isa<AccessOp, PrintfOp>(op) ? WalkResult::advance()
                                                   : WalkResult::interrupt();
              })
              .wasInterrupted() &&
         rank > 0;
}

/// The indices of a direct access of an array, as far as they are of the form
/// that counts; none for other accesses.
std::optional<SmallVector<std::optional<Shift>>>
Finder::getElement(Operation *op) const {
  auto access = dyn_cast<AccessOp>(op);
  if (!access || access.getArray().getDefiningOp<ArrayViewOp>())
    return std::nullopt;
  SmallVector<std::optional<Shift>> shifts;
  for (Value index : access.getIndices()) {
    shifts.push_back(getShift(index));
    if (shifts.back() && !isNonNegative(index, op->getBlock()))
      shifts.back() = std::nullopt;
  }
  return shifts;
}

/// True if all dimensions of the launch are among the indices, so that other
/// threads access other elements.
bool Finder::isOwn(Operation *op) const {
  auto element = getElement(op);
  if (!element)
    return false;
  SmallVector<bool> isThere(rank);
  for (const std::optional<Shift> &shift : *element)
    if (shift)
      isThere[shift->dimension] = true;
  return llvm::all_of(isThere, [](bool there) { return there; });
}

/// True if a thread that gets to `read` may have been at `write`. Neither is in
/// a loop that the other one is in.
bool Finder::mayComeBefore(Operation *write, Operation *read) const {
  if (positions.lookup(write) > positions.lookup(read))
    return false;
  for (Operation *op = read; op != adjoint; op = op->getParentOp()) {
    auto branch = dyn_cast<scf::IfOp>(op->getParentOp());
    Operation *other =
        branch ? branch->getRegion(0).findAncestorOpInRegion(*write) : nullptr;
    if (!branch ||
        (!other && !branch->getRegion(1).findAncestorOpInRegion(*write)))
      continue;
    return (op->getParentRegion() == &branch->getRegion(0)) == bool(other);
  }
  return true;
}

/// True if two accesses of an array differ in an index that is a constant.
static bool areApart(AccessOp one, AccessOp other) {
  return llvm::any_of(llvm::zip(one.getIndices(), other.getIndices()),
                      [](auto indices) {
                        auto [a, b] = indices;
                        std::optional<int64_t> x = getConstantInteger(a);
                        std::optional<int64_t> y = getConstantInteger(b);
                        return x && y && *x >= 0 && *y >= 0 && *x != *y;
                      });
}

/// True if a load gives what is there before the launch.
bool Finder::readsInitialValue(AccessOp load) {
  std::optional<ArrayMemory> memory = getMemory(load.getArray());
  if (!memory)
    return false;
  ArrayRef<Operation *> changes = writes[*memory];
  if (changes.empty())
    return true;
  if (!isOwn(load) || !areBranchesAround(load))
    return false;
  auto element = getElement(load);
  return llvm::all_of(changes, [&](Operation *write) {
    return getElement(write) == element && isOwn(write) &&
           (areApart(cast<AccessOp>(write), load) ||
            !mayComeBefore(write, load));
  });
}

bool Finder::areBranchesAround(Operation *op) const {
  while ((op = op->getParentOp()) != adjoint)
    if (!isa<scf::IfOp>(op))
      return false;
  return true;
}

/// True if the operation itself, without its operands, gives the same when it
/// is done for the thread before the launch.
bool Finder::isRecomputable(Operation *op) {
  auto [found, isNew] = recomputable.try_emplace(op, false);
  if (!isNew)
    return found->second;
  bool result = !op->walk([&](Operation *inner) {
                     if (isPlainRead(inner))
                       return readsInitialValue(cast<AccessOp>(inner))
                                  ? WalkResult::advance()
                                  : WalkResult::interrupt();
                     // Other effects of a branch are left out.
                     bool isDropped = inner != op && inner->use_empty() &&
                                      inner->getNumRegions() == 0;
                     bool isBranch = isa<scf::IfOp>(inner);
                     return isDropped || isBranch || isMemoryEffectFree(inner)
                                ? WalkResult::advance()
                                : WalkResult::interrupt();
                   }).wasInterrupted();
  return recomputable[op] = result;
}

llvm::SetVector<Operation *> getSlice(Operation *op) {
  llvm::SetVector<Operation *> slice;
  SmallVector<Operation *> pending;
  auto follow = [&](Operation *user, Operation *within) {
    for (Value operand : user->getOperands()) {
      Operation *definition = operand.getDefiningOp();
      if (definition && !within->isAncestor(definition) &&
          slice.insert(definition))
        pending.push_back(definition);
    }
  };
  follow(op, op);
  for (Operation *parent = op->getParentOp(); isa<scf::IfOp>(parent);
       parent = parent->getParentOp())
    if (Operation *condition = parent->getOperand(0).getDefiningOp())
      if (slice.insert(condition))
        pending.push_back(condition);
  while (!pending.empty()) {
    Operation *next = pending.pop_back_val();
    next->walk([&](Operation *inner) { follow(inner, next); });
  }
  return slice;
}

//===----------------------------------------------------------------------===//
// Sums
//===----------------------------------------------------------------------===//

/// The sum if it is of that form, and the indices of the element.
std::optional<NeighborSum>
Finder::parse(AccumulateOp op, SmallVector<NeighborIndex, 4> &indices) {
  auto element = getElement(op);
  if (!element || !areBranchesAround(op))
    return std::nullopt;
  NeighborSum sum{op, SmallVector<int64_t, 3>(rank)};
  SmallVector<bool> isThere(rank);
  for (auto [shift, index] : llvm::zip_equal(*element, op.getIndices())) {
    if (!shift) {
      if (!isUniform(index) || !isSpeculatable(index))
        return std::nullopt;
      indices.push_back({0, index});
      continue;
    }
    if (isThere[shift->dimension])
      return std::nullopt;
    isThere[shift->dimension] = true;
    indices.push_back({shift->dimension, nullptr});
    sum.offsets[shift->dimension] = shift->offset;
  }
  if (!llvm::all_of(isThere, [](bool there) { return there; }))
    return std::nullopt;
  for (Operation *needed : getSlice(op))
    if (!isRecomputable(needed))
      return std::nullopt;
  return sum;
}

/// Adds a sum to those with the same fixed indices; false if it is of another
/// form than they are: dimensions correspond in one way.
bool Finder::add(AccumulateOp op, SmallVectorImpl<NeighborSums> &groups) {
  SmallVector<NeighborIndex, 4> indices;
  std::optional<NeighborSum> sum = parse(op, indices);
  if (!sum)
    return false;
  NeighborSums *own = nullptr;
  for (NeighborSums &group : groups) {
    for (auto [one, other] : llvm::zip_equal(group.indices, indices))
      if (!one.fixed != !other.fixed || one.dimension != other.dimension)
        return false;
    if (group.indices == indices)
      own = &group;
  }
  if (!own)
    own = &groups.emplace_back(NeighborSums{op.getArray(), indices, {}});
  own->sums.push_back(std::move(*sum));
  return true;
}

SmallVector<NeighborSums> Finder::find(unsigned &launchRank) {
  SmallVector<NeighborSums> result;
  if (!collect())
    return result;
  launchRank = rank;
  for (auto &[memory, operations] : writes) {
    if (!memory.isGradient || reads.count(memory))
      continue;
    SmallVector<NeighborSums> groups;
    bool isAtomic = false;
    bool areAll = llvm::all_of(operations, [&](Operation *operation) {
      auto op = dyn_cast<AccumulateOp>(operation);
      isAtomic |= op && op.getUnique().value_or(0) < rank;
      return op && (borders.contains(op) || add(op, groups));
    });
    if (areAll && isAtomic)
      llvm::append_range(result, groups);
  }
  return result;
}

SmallVector<NeighborSums>
findNeighborSums(func::FuncOp adjoint,
                 const llvm::DenseSet<Operation *> &borders, unsigned &rank) {
  return Finder(adjoint, borders).find(rank);
}

} // namespace warp::autodiff
