//===- DeadValues.h - Liveness through loops --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_DEADVALUES_H
#define WARP_TRANSFORMS_AUTODIFF_DEADVALUES_H

#include "mlir/IR/Operation.h"

#include "llvm/ADT/DenseSet.h"
#include "llvm/ADT/STLFunctionalExtras.h"

namespace mlir::scf {
class ForOp;
class IfOp;
class WhileOp;
} // namespace mlir::scf

namespace warp::autodiff {

/// The values that given ones depend on. A result of a branch needs only what
/// the branches yield at its place, and a value that a loop carries only what
/// the loop makes of it; so a carried value that is of use to nothing but its
/// own next value is not needed.
class Needs {
public:
  /// Looks at values within an operation only, and takes for granted that
  /// control gets there; what is around it may not be complete yet. Values that
  /// `filter` refuses are neither marked nor followed. `getUses` says what an
  /// operation without regions depends on, if that is not its operands.
  explicit Needs(
      mlir::Operation *within,
      llvm::function_ref<bool(mlir::Value)> filter = nullptr,
      llvm::function_ref<llvm::SmallVector<mlir::Value>(mlir::Operation *)>
          getUses = nullptr)
      : within(within), filter(filter), getUses(getUses) {}

  /// Marks values and all they depend on.
  void mark(mlir::Value value);
  void mark(mlir::ValueRange values);
  /// Marks what an operation uses.
  void markUse(mlir::Operation *op);
  /// The same for those operations in it, or itself, that have effects.
  void markEffects(mlir::Operation *op);

  bool isNeeded(mlir::Value value) const { return needed.contains(value); }
  /// The operation has a result that is needed or holds an operation that is.
  bool isNeeded(mlir::Operation *op) const;

private:
  void push(mlir::Value value);
  void push(mlir::ValueRange values);
  void drain();
  void follow(mlir::Value value);
  void followResult(mlir::OpResult result);
  void followArgument(mlir::BlockArgument argument);
  void reach(mlir::Operation *op);

  mlir::Operation *within;
  llvm::function_ref<bool(mlir::Value)> filter;
  llvm::function_ref<llvm::SmallVector<mlir::Value>(mlir::Operation *)> getUses;
  llvm::DenseSet<mlir::Value> needed;
  llvm::DenseSet<mlir::Operation *> reached;
  llvm::SmallVector<mlir::Value> worklist;
};

/// True if the operation itself does something other than read or compute.
/// Stores to scratch memory count as computing: they matter if a load does.
bool hasOwnEffect(mlir::Operation *op);

/// Erases what neither an effect within the region nor a value in `keep` needs,
/// with results and carried values of the loops and branches inside.
void eraseDead(mlir::Region &region, mlir::ValueRange keep = {});

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_DEADVALUES_H
