//===- GatherGuard.h - Bounds of gathered contributions ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A term of a gathered sum is there if the thread that it comes from is in the
// launch and passes the branches around the addition. Both are mostly about
// where the thread is, in each dimension by itself; so a guard keeps the least
// index and upper bounds that all threads have in common. The inner loop of
// a launch keeps two comparisons, with any number of branches.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_GATHERGUARD_H
#define WARP_TRANSFORMS_AUTODIFF_GATHERGUARD_H

#include "GatherBuilder.h"

#include "mlir/IR/Builders.h"

#include <functional>

namespace warp::autodiff {

/// Writes operations of the kernel that gathers.
struct GatherEmitter {
  mlir::OpBuilder b;
  mlir::Location loc;
  TidOp tid;
  /// Computes a value of the adjoint that is the same in all threads, before
  /// all that differs. Asked again it gives the same.
  std::function<mlir::Value(mlir::Value)> makeUniform;
  /// The index from which on a comparison with a bound does not hold, by the
  /// bound and what is added to the index.
  std::map<std::pair<void *, int64_t>, mlir::Value> limits;

  template <typename Builtin>
  mlir::Value make(mlir::Type type, llvm::ArrayRef<mlir::Value> args) {
    return Builtin::create(b, loc, mlir::TypeRange(type), args)->getResult(0);
  }
  mlir::Value limitOf(mlir::Value bound, int64_t distance);
  /// A number of the type of thread indices.
  mlir::Value number(int64_t value);
  mlir::Value truth(bool value);
  /// True if a thread index is at least that.
  mlir::Value isAtLeast(unsigned dimension, int64_t bound);
  /// The conjunction; null stands for true.
  mlir::Value both(mlir::Value left, mlir::Value right);
};

/// A condition on the thread that a sum comes from.
class Guard {
public:
  /// Computes a value of the adjoint for that thread.
  using Clone = llvm::function_ref<mlir::Value(mlir::Value)>;

  /// Always true; `rank` is the number of thread indices.
  explicit Guard(unsigned rank) : least(rank, 0), bounds(rank) {}
  /// It is within the extents of a launch.
  explicit Guard(llvm::ArrayRef<mlir::Value> extents)
      : Guard(extents.size()) {
    this->extents.assign(extents.begin(), extents.end());
  }

  /// And a condition of the adjoint, which can be computed anywhere, holds or
  /// does not.
  void add(GatherEmitter &emitter, mlir::Value condition, bool holds,
           Clone clone);

  /// True if all that is true of the thread `back` steps before this one; null
  /// if it always is. This one is at most `halo` steps beyond the extents.
  mlir::Value build(GatherEmitter &emitter, llvm::ArrayRef<int64_t> back,
                    llvm::ArrayRef<int64_t> halo) const;
  /// The part of that which is about some dimensions.
  mlir::Value build(GatherEmitter &emitter, llvm::ArrayRef<int64_t> back,
                    llvm::ArrayRef<int64_t> halo, unsigned first,
                    unsigned end) const;
  /// True if there is nothing but that.
  bool isAboutIndices() const { return !rest; }
  /// True if another guard says the same of a dimension.
  bool agrees(const Guard &other, unsigned dimension) const {
    return least[dimension] == other.least[dimension] &&
           bounds[dimension] == other.bounds[dimension] &&
           extents == other.extents;
  }

private:
  bool addComparison(GatherEmitter &emitter, mlir::Operation *op, bool holds);

  Offsets least;
  /// By dimension: the index is less than each of these values.
  llvm::SmallVector<llvm::SmallVector<mlir::Value, 2>, 3> bounds;
  llvm::SmallVector<mlir::Value, 3> extents;
  mlir::Value rest;
};

/// True if a value can be computed where the adjoint does not need it.
bool isSpeculatable(mlir::Value value);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_GATHERGUARD_H
