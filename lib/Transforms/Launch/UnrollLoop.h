//===- UnrollLoop.h - Full unrolling of a loop ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_UNROLLLOOP_H
#define WARP_LIB_TRANSFORMS_UNROLLLOOP_H

#include "mlir/Dialect/SCF/IR/SCF.h"

#include <cstdint>
#include <optional>

namespace warp {

/// The number of iterations if a loop begins at a constant and it, the step and
/// the number are known.
std::optional<int64_t> getConstantTrips(mlir::scf::ForOp loop);

/// Puts a copy of the body for each of `getConstantTrips` iterations in the
/// place of a loop, and folds their operations.
void unroll(mlir::scf::ForOp loop);

/// Asks LLVM to make that many copies of a loop's body.
void setCopies(mlir::scf::ForOp loop, int64_t copies);
/// Asks LLVM not to copy a loop's body.
void setRolled(mlir::scf::ForOp loop);
/// Asks LLVM neither to vectorise a loop nor to copy its body.
void setPlain(mlir::scf::ForOp loop);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_UNROLLLOOP_H
