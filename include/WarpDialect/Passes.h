//===- Passes.h - Passes of the warp dialect --------------------*- C++ -*-===//

#ifndef WARPDIALECT_PASSES_H
#define WARPDIALECT_PASSES_H

#include "mlir/Pass/Pass.h"

namespace warp {

/// Attributes that warp-specialize leaves on the kernel function, for the
/// passes after it.
namespace attr {
/// How the kernel's arguments looked before they were taken apart.
constexpr llvm::StringLiteral argTypes = "warp.arg_types";
/// Names of those arguments.
constexpr llvm::StringLiteral argNames = "warp.arg_names";
/// Facts of the launch.
constexpr llvm::StringLiteral target = "warp.target";
constexpr llvm::StringLiteral rank = "warp.rank";
constexpr llvm::StringLiteral contiguous = "warp.contiguous";
constexpr llvm::StringLiteral index32 = "warp.index32";
/// On the parameter itself: an integer that `contiguous` says is not negative.
constexpr llvm::StringLiteral nonNegative = "warp.non_negative";
constexpr llvm::StringLiteral flat = "warp.flat";
constexpr llvm::StringLiteral debug = "warp.debug";
constexpr llvm::StringLiteral fastMath = "warp.fast_math";
constexpr llvm::StringLiteral blockDim = "warp.block_dim";
constexpr llvm::StringLiteral large = "warp.large";
constexpr llvm::StringLiteral threads = "warp.threads";
/// Rough operations of one thread, which the compiler estimates.
constexpr llvm::StringLiteral cost = "warp.cost";
/// What follows for the code: one thread runs the launch.
constexpr llvm::StringLiteral exclusive = "warp.exclusive";
/// GPU: launch indices that one thread takes; 1 without.
constexpr llvm::StringLiteral items = "warp.items";
/// The function that a launch calls, once warp-lower-launch has made it.
constexpr llvm::StringLiteral entry = "warp.entry";
/// Places that error records refer to by number.
constexpr llvm::StringLiteral sites = "warp.sites";
} // namespace attr

#define GEN_PASS_DECL
#include "WarpDialect/Passes.h.inc"

#define GEN_PASS_REGISTRATION
#include "WarpDialect/Passes.h.inc"

} // namespace warp

#endif // WARPDIALECT_PASSES_H
