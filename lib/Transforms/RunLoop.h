//===- RunLoop.h - Loops over runs of neighbours ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The loop over the neighbours of a point in a hash grid: its condition
// looks for the next run when one has ended, its body goes on by one.
//
//     while (seek(place, end), place < end)
//       body(place)
//       place += 1
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_RUNLOOP_H
#define WARP_LIB_TRANSFORMS_RUNLOOP_H

#include "mlir/Dialect/SCF/IR/SCF.h"

#include "llvm/ADT/Sequence.h"

#include <optional>

namespace warp {

/// A loop as above.
struct RunLoop {
  mlir::scf::WhileOp loop;
  /// Positions of place and end among the body's arguments.
  unsigned place = 0, end = 0;
  /// The value of the last iteration that each argument of the body is when no
  /// run is sought.
  llvm::SmallVector<unsigned> sources;

  mlir::Value next(unsigned argument) {
    return loop.getYieldOp()->getOperand(sources[argument]);
  }
  mlir::Value argument(unsigned i) { return loop.getAfterArguments()[i]; }
  /// The arguments that an iteration changes, the place among them.
  llvm::SmallVector<unsigned> changed() {
    auto all = llvm::seq<unsigned>(0, sources.size());
    return llvm::to_vector(llvm::make_filter_range(
        all, [&](unsigned i) { return next(i) != argument(i); }));
  }
};

std::optional<RunLoop> findRuns(mlir::scf::WhileOp loop);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_RUNLOOP_H
