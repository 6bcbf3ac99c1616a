//===- MemoryOrder.cpp - Order of a thread's accesses ---------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// True if a write may change, or may have changed, what a load reads. In one
// pass over their common loops, program order tells which comes first. In other
// iterations of a common loop, an index that moves by a constant per iteration
// meets the other's at one distance only, and the sign of the distance tells
// which comes first.
//
//===----------------------------------------------------------------------===//

#include "MemoryClasses.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace warp::autodiff {

bool haveOtherComponents(const Access &a, const Access &b) {
  for (auto [x, y] : llvm::zip(a.component, b.component))
    if (x != y)
      return true;
  return false;
}

/// By how much one index is more than another one, if that is constant.
static std::optional<int64_t> getDistance(const Form &x, const Form &y) {
  std::optional<Form> difference = x - y;
  return difference ? difference->getConstant() : std::nullopt;
}

/// True if the indices can be equal in one pass over the common loops.
static bool mayBeEqual(const Access &a, const Access &b) {
  for (auto [x, y] : llvm::zip_equal(a.indices, b.indices)) {
    if (!x || !y)
      continue;
    if (getDistance(*x, *y).value_or(0) != 0)
      return false;
  }
  return true;
}

bool areApart(const Access &a, const Access &b) {
  return haveOtherComponents(a, b) || !mayBeEqual(a, b);
}

static SmallVector<Operation *> getCommonLoops(Operation *a, Operation *b) {
  SmallVector<Operation *> loops;
  for (Operation *op = a->getParentOp(); op; op = op->getParentOp())
    if (isa<scf::ForOp, scf::WhileOp>(op) && op->isProperAncestor(b))
      loops.push_back(op);
  return loops;
}

/// Sides of one branch exclude each other.
static bool areExclusive(Operation *a, Operation *b) {
  for (Operation *op = a->getParentOp(); op; op = op->getParentOp())
    if (auto branch = dyn_cast<scf::IfOp>(op))
      if (branch->isProperAncestor(b)) {
        auto side = [&](Operation *inner) {
          return branch.getThenRegion().isAncestor(inner->getParentRegion());
        };
        return side(a) != side(b);
      }
  return false;
}

/// True if one dimension keeps the write, any number of iterations of the loop
/// later (`sign` 1) or earlier (-1), away from what is read.
static bool isApartAlong(const Form &read, const Form &write, Operation *loop,
                         int sign) {
  Symbol trip = Symbol::trip(loop);
  std::optional<Form> coefficient = write.coefficientOf(trip);
  std::optional<int64_t> pace =
      coefficient ? coefficient->getConstant() : std::nullopt;
  std::optional<int64_t> distance = getDistance(write, read);
  if (!distance || !pace || !read.without(trip).isDefinedOutside(loop) ||
      !write.without(trip).isDefinedOutside(loop))
    return false;
  if (*pace == 0)
    return *distance != 0;
  // They meet `-distance / pace` iterations away.
  return *distance % *pace != 0 || -*distance / *pace * sign < 1;
}

static bool mayMeet(const Access &read, const Access &write, Operation *loop,
                    int sign) {
  for (auto [x, y] : llvm::zip_equal(read.indices, write.indices))
    if (x && y && isApartAlong(*x, *y, loop, sign))
      return false;
  return true;
}

static bool mayWrite(const Access &read, const Access &write, int sign) {
  if (haveOtherComponents(read, write))
    return false;
  bool isInOrder = sign > 0 ? write.position > read.position
                            : write.position < read.position;
  if (isInOrder && !areExclusive(read.op, write.op) && mayBeEqual(read, write))
    return true;
  return llvm::any_of(getCommonLoops(read.op, write.op), [&](Operation *loop) {
    return mayMeet(read, write, loop, sign);
  });
}

bool mayWriteAfter(const Access &read, const Access &write) {
  return mayWrite(read, write, 1);
}

bool mayWriteBefore(const Access &read, const Access &write) {
  return mayWrite(read, write, -1);
}

//===----------------------------------------------------------------------===//
// Order of writes
//===----------------------------------------------------------------------===//

/// The counted loop that runs a write once in each iteration, or not.
static scf::ForOp getLoopOf(const Access &write) {
  Operation *op = write.op->getParentOp();
  while (op && !isa<scf::ForOp, scf::WhileOp>(op))
    op = op->getParentOp();
  return dyn_cast_or_null<scf::ForOp>(op);
}

/// By how much an index grows with each iteration of a loop; 0 if it does not,
/// or nobody knows.
static int64_t getPace(const std::optional<Form> &index, Operation *loop) {
  Symbol trip = Symbol::trip(loop);
  if (!index || !index->without(trip).isDefinedOutside(loop))
    return 0;
  std::optional<Form> coefficient = index->coefficientOf(trip);
  return coefficient ? coefficient->getConstant().value_or(0) : 0;
}

/// True if a write is to an element before those that the writes of a loop, of
/// which `first` is the first index, come to.
static bool isBeforeAll(const Access &read, const Access &write, unsigned axis,
                        const Form &first, bool isDescending) {
  const std::optional<Form> &index = write.indices[axis];
  if (!index)
    return false;
  std::optional<int64_t> distance = getDistance(*index, first);
  if (!distance || (isDescending ? *distance <= 0 : *distance >= 0))
    return false;
  return llvm::all_of(getCommonLoops(read.op, write.op), [&](Operation *loop) {
    return index->isDefinedOutside(loop) && first.isDefinedOutside(loop);
  });
}

std::optional<WriteOrder> findWriteOrder(const Access &read,
                                         ArrayRef<const Access *> writes) {
  SmallVector<const Access *> later, earlier;
  for (const Access *write : writes) {
    if (mayWriteAfter(read, *write))
      later.push_back(write);
    else if (mayWriteBefore(read, *write))
      earlier.push_back(write);
  }
  scf::ForOp loop = later.empty() ? scf::ForOp() : getLoopOf(*later.front());
  if (!loop || !loop->isProperAncestor(read.op))
    return std::nullopt;
  bool isBefore = later.front()->position < read.position;
  for (const Access *write : later) {
    if (getLoopOf(*write) != loop ||
        (write->position < read.position) != isBefore)
      return std::nullopt;
    // Iterations of the loops around it have elements of their own.
    for (Operation *outer : getCommonLoops(loop, loop))
      if (mayMeet(read, *write, outer, 1) || mayMeet(read, *write, outer, -1))
        return std::nullopt;
  }
  for (auto [axis, value] : llvm::enumerate(read.values)) {
    const std::optional<Form> &index = later.front()->indices[axis];
    int64_t pace = getPace(index, loop);
    if (!value || pace == 0)
      continue;
    bool isDescending = pace < 0;
    bool isInOrder = llvm::all_of(later, [&, axis = axis](const Access *write) {
      return write->indices[axis] && write->indices[axis]->equals(*index);
    });
    Form first = index->without(Symbol::trip(loop));
    isInOrder &= llvm::all_of(earlier, [&, axis = axis](const Access *write) {
      return isBeforeAll(read, *write, axis, first, isDescending);
    });
    if (isInOrder)
      return WriteOrder{value,          later.front()->values[axis],
                        unsigned(axis), later.front()->op,
                        isDescending,   isBefore};
  }
  return std::nullopt;
}

} // namespace warp::autodiff
