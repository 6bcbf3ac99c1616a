//===- Background.h - Waiting for work in the background --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_BACKGROUND_H
#define WARP_BACKGROUND_H

#include "warp/Export.h"

namespace warp {

/// Waits until all tier-1 code that was asked for is in use.
WARP_API void waitForBackground();
/// Has the task in progress end soon, waits for it, and drops the others and all
/// to come. To be called when the process begins to exit.
WARP_API void stopBackground();

} // namespace warp

#endif // WARP_BACKGROUND_H
