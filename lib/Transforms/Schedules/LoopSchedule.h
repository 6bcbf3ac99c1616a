//===- LoopSchedule.h - Loops in tiles of lanes -----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LOOPSCHEDULE_H
#define WARP_LIB_TRANSFORMS_LOOPSCHEDULE_H

#include "Launch/GpuBlock.h"
#include "Schedules.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/IRMapping.h"

namespace warp {

/// True if a loop surely has fewer iterations.
bool hasFewerTrips(mlir::scf::ForOp loop, int64_t trips);

/// True if a warp can run a loop in tiles of an iteration for each lane: its
/// counter steps by one between bounds that lanes share, and it is not short.
/// Adds the values that lanes must agree on for that.
bool hasWarpTiles(mlir::scf::ForOp loop, const ThreadVariance &variance,
                  llvm::SetVector<mlir::Value> &compared);

/// A schedule that puts tiles of an iteration for each lane in front of a loop.
class LoopSchedule : public LaunchRewrite {
public:
  explicit LoopSchedule(ScheduleSite &site)
      : LaunchRewrite(site), warpSize(site.target.getSubgroupSize()),
        loop(site.loop), b(loop), loc(loop.getLoc()) {}

protected:
  /// The first iteration that is in no full tile of `size` iterations, a power
  /// of two; the first of the loop in a warp with a lane missing, or whose
  /// lanes do not agree.
  mlir::Value endOfTiles(llvm::ArrayRef<mlir::Value> compared, int64_t size);

  /// Builds the body of a new loop, which yields the values that `build`
  /// returns. The loop is in the function by then, whose target decides.
  void
  buildBody(mlir::scf::ForOp made,
            llvm::function_ref<llvm::SmallVector<mlir::Value>(mlir::Value,
                                                              mlir::ValueRange)>
                build);

  mlir::Value constant(mlir::Type type, int64_t value) {
    return mlir::arith::ConstantOp::create(b, loc,
                                           b.getIntegerAttr(type, value));
  }
  mlir::Value constant(int64_t value) {
    return constant(b.getI32Type(), value);
  }
  mlir::Value add(mlir::Value x, mlir::Value y) {
    return mlir::arith::AddIOp::create(b, loc, x, y);
  }
  mlir::Value bitAnd(mlir::Value x, mlir::Value y) {
    return mlir::arith::AndIOp::create(b, loc, x, y);
  }
  mlir::Type counterType() { return loop.getInductionVar().getType(); }
  /// A lane or step as a counter of the loop.
  mlir::Value widen(mlir::Value number) {
    if (counterType() == number.getType())
      return number;
    return mlir::arith::ExtUIOp::create(b, loc, counterType(), number);
  }

  /// Lanes of a warp, and iterations of a tile.
  int64_t warpSize;
  mlir::scf::ForOp loop;
  mlir::OpBuilder b;
  mlir::Location loc;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LOOPSCHEDULE_H
