//===- InStep.h - Lockstep loops of lanes -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_INSTEP_H
#define WARP_LIB_TRANSFORMS_INSTEP_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// Takes out of a kernel whose threads are not in step what has lanes in step:
/// a thread alone makes its own trips, and none that it has to skip.
void leaveStep(mlir::FunctionOpInterface kernel);

/// True if threads that are in step would update the same element, as
/// warp-plan-updates has found.
bool updatesInStep(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_INSTEP_H
