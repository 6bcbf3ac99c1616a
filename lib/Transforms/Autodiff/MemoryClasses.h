//===- MemoryClasses.h - Effects of a kernel on each array ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H
#define WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H

#include "Activity.h"

#include "Analysis/ThreadVariance.h"

#include <vector>

namespace warp::autodiff {

/// How an adjoint, which runs after the launch, gets what a load read.
enum class Recovery {
  /// The element still has that value.
  Reload,
  /// The element had that value before the launch.
  Preserved,
  /// Neither is known.
  Impossible,
};

/// The threads that touch the elements which one thread touches.
enum class Sharing {
  /// No other one.
  Private,
  /// No other one, if the indices are as different as the program assumes.
  Trusted,
  /// All threads touch the same ones: right for launches of one thread.
  Single,
  /// Others.
  Shared,
};

/// One access of an array element.
struct Access {
  mlir::Operation *op = nullptr;
  /// The array that the operation names.
  mlir::Value array;
  /// Position in program order.
  unsigned position = 0;
  /// One per dimension of the leaf; none for an index within a slice.
  std::vector<std::optional<Form>> indices;
  /// The same as values.
  llvm::SmallVector<mlir::Value, 2> values;
  /// Component or field of the element, as far as it is constant.
  llvm::SmallVector<mlir::Attribute, 2> component;
  /// A component that is known only at run time is accessed.
  bool hasUnknownComponent = false;
  bool isWrite = false;
  /// It reads or writes the gradient in the adjoint.
  bool isActive = false;
};

/// The element of a load, store or atomic, from the indices of the operation
/// and of the views on the way to the leaf; none for other operations.
std::optional<Access> getAccess(mlir::Operation *op);

/// True if two accesses are to components that do not overlap.
bool haveOtherComponents(const Access &a, const Access &b);
/// True if two accesses to one leaf are to different elements, or components.
bool areApart(const Access &a, const Access &b);
/// True if they are to the same element and component, with the same values
/// for what the indices are made of.
bool areSame(const Access &a, const Access &b);

/// A loop writes each element of an array once, in the order of one index.
struct WriteOrder {
  /// That index in a load, and what it is in the write of the same iteration.
  mlir::Value read, write;
  unsigned axis = 0;
  /// One of the writes.
  mlir::Operation *writer = nullptr;
  bool isDescending = false;
  /// The write of an iteration comes before the load.
  bool isBefore = false;
};

class MemoryClasses {
public:
  MemoryClasses(mlir::FunctionOpInterface function, const ArrayLeaves &leaves,
                const Activity &activity, bool unique);

  /// Reports active arrays whose accesses have no adjoint: reads of what other
  /// threads write. Finds out whether only one thread may run.
  mlir::LogicalResult verify();

  bool isWritten(unsigned leaf) const;
  /// No element of an array is both read and written by the launch that the
  /// derivative is for.
  bool isApart(unsigned leaf) const;
  /// No two threads touch the same element of an array.
  bool isPrivate(unsigned leaf) const;
  /// All threads touch the same elements of an array.
  bool isCommon(unsigned leaf) const;
  /// Indices don't tell which elements of an array threads touch.
  bool isUnknown(unsigned leaf) const;
  /// Dimensions of the launch that the kernel knows.
  unsigned getThreadDimensions() const { return threadDimensions; }
  /// Active arrays of which indices don't tell whether a thread reads what
  /// another one writes: they come from memory, say.
  llvm::SmallVector<unsigned> findUnknownSharing() const;
  /// Takes for granted that no thread touches what another one writes.
  void trust(const llvm::SmallDenseSet<unsigned> &leaves) { trusted = leaves; }
  /// How to get the value of a load again; the reason if that is impossible.
  /// `needsOneThread` if that is so in a launch of one thread only.
  Recovery getRecovery(mlir::Operation *load, std::string &why,
                       bool &needsOneThread) const;
  /// Set if comparing indices tells whether an element was written before a
  /// load, and if so, nothing has written it since. None for loads that can be
  /// recovered otherwise.
  std::optional<WriteOrder> getWriteOrder(mlir::Operation *load) const;
  /// N if no two threads of a launch of rank up to N touch the same gradient
  /// at this access; 0 if that is not known.
  int64_t getUniqueRank(mlir::Operation *access) const;
  /// Set if the adjoint is right only for launches of one thread: why.
  llvm::StringRef getOneThreadReason() const { return oneThread; }
  /// Ordinal of an access within the function.
  int64_t getNumber(mlir::Operation *op) const { return numbers.lookup(op); }

private:
  void collect(mlir::Operation *op);
  const Access *lookup(mlir::Operation *op, unsigned &leaf) const;
  Sharing getSharing(llvm::ArrayRef<const Access *> accesses) const;
  Sharing getSharing(unsigned leaf, bool onlyActive) const;
  bool mayMeetUnseen(llvm::ArrayRef<const Access *> accesses) const;
  llvm::SmallVector<const Access *> select(unsigned leaf,
                                           bool onlyActive) const;
  bool isOwnedAlong(llvm::ArrayRef<const Access *> accesses, unsigned axis,
                    unsigned dim, bool mayWrap) const;
  unsigned countOwnedDimensions(llvm::ArrayRef<const Access *> accesses,
                                bool mayWrap) const;

  const ArrayLeaves &leaves;
  const Activity &activity;
  /// Arguments are taken to be different arrays, as everywhere in a derivative.
  ThreadVariance variance;
  bool unique;
  llvm::SmallVector<llvm::SmallVector<Access>> accesses;
  llvm::DenseMap<mlir::Operation *, std::pair<unsigned, unsigned>> places;
  llvm::DenseMap<mlir::Operation *, int64_t> numbers;
  /// Accesses of arrays that are not known to be one of the arguments.
  llvm::SmallVector<mlir::Operation *> unknown;
  unsigned position = 0;
  /// Dimensions of the launch that the kernel knows.
  unsigned threadDimensions = 0;
  std::string oneThread;
  llvm::SmallDenseSet<unsigned> trusted;
};

/// True if an element that `read` reads may be written by `write` in the same
/// thread, after or before that.
bool mayWriteAfter(const Access &read, const Access &write);
bool mayWriteBefore(const Access &read, const Access &write);
/// The order in which these writes, and no others of the thread, come to the
/// elements that `read` may read.
std::optional<WriteOrder> findWriteOrder(const Access &read,
                                         llvm::ArrayRef<const Access *> writes);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H
