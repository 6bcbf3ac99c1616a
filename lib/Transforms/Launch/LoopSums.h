//===- LoopSums.h - Loops that are reductions only --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_LOOPSUMS_H
#define WARP_LIB_TRANSFORMS_LOOPSUMS_H

#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {

/// True if a loop carries nothing but sums whose terms may be added in any
/// order: integers, floats that are marked so (`reassoc`), all floats if
/// `anyOrder`. Nothing in the loop looks at a sum.
bool carriesSums(mlir::scf::ForOp loop, bool anyOrder);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_LOOPSUMS_H
