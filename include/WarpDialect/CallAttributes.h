//===- CallAttributes.h - Functions that stay calls -------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Beside Passes.h, as few passes know of calls.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_CALLATTRIBUTES_H
#define WARPDIALECT_CALLATTRIBUTES_H

#include "llvm/ADT/StringRef.h"

namespace warp::attr {

/// On the kernel: scalar operations beyond which large functions with several
/// calls stay functions; without it all calls are inlined.
constexpr llvm::StringLiteral inlineBudget = "warp.inline_budget";
/// On the kernel: functions that update elements atomically, or print, may
/// stay, too, as each thread does so by itself.
constexpr llvm::StringLiteral keepsUpdates = "warp.keeps_updates";
/// On a function that stays; on the kernel, or entry, that calls some.
constexpr llvm::StringLiteral kept = "warp.kept";
constexpr llvm::StringLiteral keepsCalls = "warp.keeps_calls";

} // namespace warp::attr

#endif // WARPDIALECT_CALLATTRIBUTES_H
