//===- HoistHandles.h - Hoisting of handle lookups --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_LAUNCH_HOISTHANDLES_H
#define WARP_TRANSFORMS_LAUNCH_HOISTHANDLES_H

#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// On a CPU, finds slots of handles that are arguments of a kernel, and reads
/// words of them, before loops instead of in each iteration. Such handles were
/// checked at the launch, and nothing writes slots while a kernel runs.
void hoistHandles(mlir::FunctionOpInterface kernel);

} // namespace warp

#endif // WARP_TRANSFORMS_LAUNCH_HOISTHANDLES_H
