//===- MemoryClasses.h - What a kernel does to each array -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H
#define WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H

#include "Activity.h"

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

/// One access of an array element.
struct Access {
  mlir::Operation *op;
  /// Array as the operation names it.
  mlir::Value array;
  /// Indices along the array's leaf, those of views first. Null for indices
  /// that are not a plain value (those of a slice).
  llvm::SmallVector<mlir::Value, 4> indices;
  /// Component or field of the element; different ones do not overlap.
  llvm::SmallVector<mlir::Attribute, 2> component;
  bool isRead = false, isWrite = false;
  /// An atomic sum: the order of several does not matter.
  bool isSum = false;
};

class MemoryClasses {
public:
  MemoryClasses(mlir::FunctionOpInterface function, const ArrayLeaves &leaves,
                const Activity &activity, bool unique);

  /// Reports active arrays whose accesses have no adjoint: reads of what other
  /// threads write.
  mlir::LogicalResult verify() const;

  bool isWritten(unsigned leaf) const;
  /// How to get the value of a load again; the reason if that is impossible.
  Recovery getRecovery(mlir::Operation *load, std::string &why) const;
  /// N if no two threads of a launch of rank up to N touch the same gradient
  /// at this access; 0 if that is not known.
  int64_t getUniqueRank(mlir::Operation *access) const;
  /// The adjoint is right only for launches of one thread.
  bool isOneThread() const { return oneThread; }

private:
  friend class MemoryClassifier;
  llvm::SmallVector<llvm::SmallVector<Access>> accesses;
  llvm::DenseMap<mlir::Operation *, std::pair<unsigned, unsigned>> places;
  const Activity &activity;
  bool unique, oneThread = false;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_MEMORYCLASSES_H
