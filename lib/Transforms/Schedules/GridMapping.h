//===- GridMapping.h - Launch indices of the threads of a grid --*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_GRIDMAPPING_H
#define WARP_LIB_TRANSFORMS_GRIDMAPPING_H

#include "Launch/GpuBlock.h"
#include "Launch/ThreadsBuilder.h"
#include "Schedules.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

namespace warp {

/// A schedule that maps launch indices to threads of a GPU grid. It gives
/// `warp.threads` a body without indices, which every thread of the grid runs
/// and which reads its place in the grid. A launch has one mapping.
class GridMapping : public LaunchRewrite, protected ThreadsBuilder {
public:
  explicit GridMapping(ScheduleSite &site)
      : LaunchRewrite(site), ThreadsBuilder(site.function, site.threads),
        rank(site.threads.getIndices().size()) {}

  void rewrite() final;
  GridMapping *asMapping() final { return this; }

  /// True if blocks are independent and of equal cost, so that they may run in
  /// any order.
  virtual bool hasIndependentBlocks() const { return false; }
  /// True if the code gains by more registers than ptxas grants; asked of
  /// mappings that apply.
  virtual bool needsRegisters(bool isMade) const { return false; }

protected:
  /// Builds the body from `thread`; returns the values that it yields.
  virtual Values build() = 0;

  /// True if threads are plain: one 32-bit index per grid axis, no checks, no
  /// block that works on tiles.
  bool hasPlainThreads() const;
  /// block index * block size + thread index, along one axis.
  mlir::Value gridIndex(Axis axis, mlir::Type type);
  mlir::Value read(GridValue value, Axis axis = Axis::x) {
    return readGrid(b, loc, value, axis);
  }
  /// Creates `scf.if` without results and continues in its branch.
  void enterIf(mlir::Value condition);
  /// Creates a loop and continues in it; returns its induction variable.
  mlir::Value enterLoop(mlir::Value begin, mlir::Value end, mlir::Value step);
  mlir::Value min(mlir::Value x, mlir::Value y) {
    return mlir::arith::MinSIOp::create(b, loc, x, y);
  }
  mlir::Value isLess(mlir::Value x, mlir::Value y) {
    return cmp(mlir::arith::CmpIPredicate::slt, x, y);
  }
  mlir::Value isAtMost(mlir::Value x, mlir::Value y) {
    return cmp(mlir::arith::CmpIPredicate::sle, x, y);
  }
  mlir::Value constant32(int64_t value) {
    return constant(b.getI32Type(), value);
  }

  int64_t rank;
};

/// True if an operation, with all in it, loads and computes; with `loops` it
/// may also loop.
bool onlyLoads(mlir::Operation &op, bool loops);
bool hasLoop(mlir::Operation &op);

/// Copies the operations in `scope` that compute a value, but those that are
/// mapped; returns the copy of the value.
mlir::Value cloneComputation(mlir::OpBuilder &b, mlir::Value value,
                             mlir::Operation &scope, mlir::IRMapping &map);

/// Copies an operation once per index of a thread, so that the code of the
/// indices is interleaved operation by operation.
void cloneInterleaved(mlir::OpBuilder &b, mlir::Operation &op,
                      llvm::MutableArrayRef<mlir::IRMapping> copies);
/// The same, with one copy for all if they agree on the operands.
void cloneShared(mlir::OpBuilder &b, mlir::Operation &op,
                 llvm::MutableArrayRef<mlir::IRMapping> copies);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_GRIDMAPPING_H
