//===- JitListener.h - JIT event listeners ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_JITLISTENER_H
#define WARP_JITLISTENER_H

#include "warp/Export.h"

namespace warp {

/// Programs that are told which code for the CPU is loaded, and where: perf by
/// /tmp/perf-<pid>.map, debuggers by GDB's interface for JIT compilers.
enum class JitListener { None, Perf, Debugger };

/// Throws if code has been loaded already.
WARP_API void setJitListener(JitListener listener);

} // namespace warp

#endif // WARP_JITLISTENER_H
