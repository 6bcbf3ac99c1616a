//===- JitListeners.h - JIT listeners: profilers, debuggers -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Plugins of the JIT's linking layer that tell other programs which functions
// have been loaded, and where. None is added unless it is asked for.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_JITLISTENERS_H
#define WARP_LIB_COMPILER_JITLISTENERS_H

#include "llvm/ExecutionEngine/Orc/ObjectLinkingLayer.h"

#include <memory>

namespace warp {

/// Appends functions to /tmp/perf-<pid>.map, from which `perf report` takes
/// names of code that no file has.
std::shared_ptr<llvm::orc::LinkGraphLinkingLayer::Plugin> makePerfMap();

/// Hands objects to debuggers by GDB's interface for JIT compilers, with their
/// lines if they have any.
llvm::Expected<std::shared_ptr<llvm::orc::LinkGraphLinkingLayer::Plugin>>
makeDebuggerListener(llvm::orc::ExecutionSession &session);

} // namespace warp

#endif // WARP_LIB_COMPILER_JITLISTENERS_H
