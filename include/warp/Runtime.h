//===- Runtime.h - Everything the runtime offers ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_RUNTIME_H
#define WARP_RUNTIME_H

#include "warp/Compile.h"
#include "warp/Device.h"
#include "warp/Error.h"
#include "warp/Kernel.h"
#include "warp/KernelCache.h"
#include "warp/Launch.h"
#include "warp/Memory.h"
#include "warp/SavedModule.h"
#include "warp/Sequences.h"
#include "warp/ThreadPool.h"

#endif // WARP_RUNTIME_H
