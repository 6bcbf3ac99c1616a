//===- ThreadsBuilder.h - Code that runs threads of a group -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Shared by warp-emit-entry, which loops over the threads of a range on a CPU,
// and by the schedules that map threads to the grid of a GPU.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_THREADSBUILDER_H
#define WARP_LIB_TRANSFORMS_THREADSBUILDER_H

#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Builders.h"

namespace warp {

constexpr auto noWrap = mlir::arith::IntegerOverflowFlags::nsw |
                        mlir::arith::IntegerOverflowFlags::nuw;

/// Copies the body of `warp.threads` for given indices, and combines what the
/// copies yield.
class ThreadsBuilder {
protected:
  using Values = llvm::SmallVector<mlir::Value>;

  ThreadsBuilder(mlir::FunctionOpInterface kernel, ThreadsOp threads)
      : kernel(kernel), threads(threads), thread(threads.getThread()),
        loc(kernel.getLoc()), b(kernel->getContext()),
        variant(getVariant(kernel)), index32(variant.getIndex32()),
        flat(variant.getFlat()) {}

  mlir::ArrayRef<mlir::BlockArgument> indices() {
    return thread->getArguments().drop_back(threads.getLanes() ? 1 : 0);
  }
  /// Identities of the combinations over the group.
  Values identities(bool inLanes);
  Values combine(mlir::ValueRange sums, mlir::ValueRange terms);
  /// Copies the thread for these indices; with lanes also for a mask. Returns
  /// the values that it yields.
  Values cloneThread(mlir::ValueRange indices, mlir::Value live = {});
  /// Like `cloneThread` for the last copy: moves the operations.
  Values takeThread(mlir::ValueRange indices);
  /// The first `count` indices from a linear index over their extents.
  Values unravel(mlir::Value linear, int count);
  /// Threads of the whole launch, i64.
  mlir::Value countAll();

  // Small arithmetic, in the order of operands.
  mlir::Value constant(mlir::Type type, int64_t value) {
    return mlir::arith::ConstantOp::create(b, loc,
                                           b.getIntegerAttr(type, value));
  }
  mlir::Value cmp(mlir::arith::CmpIPredicate predicate, mlir::Value x,
                  mlir::Value y) {
    return mlir::arith::CmpIOp::create(b, loc, predicate, x, y);
  }
  mlir::Value add(mlir::Value x, mlir::Value y) {
    return mlir::arith::AddIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value sub(mlir::Value x, mlir::Value y) {
    return mlir::arith::SubIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value mul(mlir::Value x, mlir::Value y) {
    return mlir::arith::MulIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value div(mlir::Value x, mlir::Value y) {
    return mlir::arith::DivUIOp::create(b, loc, x, y);
  }
  mlir::Value both(mlir::Value x, mlir::Value y) {
    return mlir::arith::AndIOp::create(b, loc, x, y);
  }
  mlir::Value narrow(mlir::Value x, mlir::Type type);

  mlir::FunctionOpInterface kernel;
  ThreadsOp threads;
  /// The body that is copied.
  mlir::Block *thread;
  mlir::Location loc;
  mlir::OpBuilder b;
  VariantAttr variant;
  bool index32, flat;
  /// Extents of the launch, i32.
  Values dims;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_THREADSBUILDER_H
