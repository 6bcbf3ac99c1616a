//===- LocalWebs.h - Live ranges that share memory (webs) -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Versions of one variable of a thread: what an insertion makes of a composite,
// what loops carry and branches yield. A version is forwarded along edges, from
// the target of an insertion to its result, from what a loop begins with or
// yields to what it carries. A web is a set of versions that are never needed
// at once, so that one memory holds them all; an edge that leaves a web, or
// begins at a value that is no version, is a copy.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_COMPOSITES_LOCALWEBS_H
#define WARP_TRANSFORMS_COMPOSITES_LOCALWEBS_H

#include "mlir/IR/Operation.h"
#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/EquivalenceClasses.h"
#include "llvm/ADT/MapVector.h"

namespace warp {

/// A version that an operation forwards.
struct LocalEdge {
  mlir::OpOperand *source;
  /// One, or for the condition of a loop what its body gets and its result.
  llvm::SmallVector<mlir::Value, 2> targets;
};

/// The versions of the variables in a function that are to be in memory.
class LocalWebs {
public:
  explicit LocalWebs(mlir::Operation *function);

  /// Edges between versions in memory, in the order of their operations.
  llvm::ArrayRef<LocalEdge> getEdges() const { return edges; }
  /// Versions in memory.
  llvm::ArrayRef<mlir::Value> getVersions() const { return versions; }
  bool isPlaced(mlir::Value value) const { return webs.contains(value); }
  /// Stands for the web of a version.
  mlir::Value getWeb(mlir::Value value) const { return webs.lookup(value); }

private:
  void collect(mlir::Operation *function);
  void select();
  void merge();
  bool merge(llvm::ArrayRef<mlir::Value> members);
  bool conflicts(mlir::Value web) const;
  bool isCopy(const LocalEdge &edge) const;
  void drop(llvm::ArrayRef<mlir::Value> members);

  llvm::SmallVector<LocalEdge, 0> edges;
  llvm::SmallVector<mlir::Value, 0> versions;
  llvm::DenseMap<mlir::Value, mlir::Value> webs;
};

/// True if some index is known only at run time.
bool isDynamic(mlir::ValueRange indices);

/// True if an index known only at run time selects a component of this value,
/// or selected the one in which it differs from the version before it.
bool hasDynamicAccess(mlir::Value version);

} // namespace warp

#endif // WARP_TRANSFORMS_COMPOSITES_LOCALWEBS_H
