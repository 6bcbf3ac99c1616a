//===- Passes.h - Passes of the warp dialect --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

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
/// On an argument of a kernel in phase `launch`: an array without gaps in
/// row-major order; how messages call it.
constexpr llvm::StringLiteral packed = "warp.packed";
constexpr llvm::StringLiteral name = "warp.name";
constexpr llvm::StringLiteral flat = "warp.flat";
constexpr llvm::StringLiteral debug = "warp.debug";
constexpr llvm::StringLiteral fastMath = "warp.fast_math";
constexpr llvm::StringLiteral deterministic = "warp.deterministic";
constexpr llvm::StringLiteral ordered = "warp.ordered";
constexpr llvm::StringLiteral blockDim = "warp.block_dim";
constexpr llvm::StringLiteral large = "warp.large";
/// CPU: threads that are to be lanes of a vector; after warp-widen-threads those
/// that are, if several.
constexpr llvm::StringLiteral lanes = "warp.lanes";
/// CPU: bits of a vector of the processor that code is for.
constexpr llvm::StringLiteral vectorBits = "warp.vector_bits";
/// No array that the kernel writes overlaps another array of the launch.
constexpr llvm::StringLiteral disjoint = "warp.disjoint";
constexpr llvm::StringLiteral threads = "warp.threads";
/// Rough operations of one thread, which the compiler estimates.
constexpr llvm::StringLiteral cost = "warp.cost";
/// On a sum of floats of an adjoint: its terms may be added in any order.
constexpr llvm::StringLiteral anyOrder = "warp.any_order";
/// What follows for the code: one thread runs the launch; GPU: one block.
constexpr llvm::StringLiteral exclusive = "warp.exclusive";
/// GPU: launch indices that one thread takes; 1 without. Threads of the only
/// block of an exclusive launch.
constexpr llvm::StringLiteral items = "warp.items";
/// The function that a launch calls, once warp-emit-entry has made it.
constexpr llvm::StringLiteral entry = "warp.entry";
/// What warp-sum-exactly found out, see include/warp/ExactSums.h. On the kernel:
/// its arrays, the fields of a `SummedArray` each; on an update: where the
/// `SumDescriptor` lies in the parameter block.
constexpr llvm::StringLiteral sums = "warp.sums";
constexpr llvm::StringLiteral sum = "warp.sum";
/// Places that error records refer to by number.
constexpr llvm::StringLiteral sites = "warp.sites";

// What warp-autodiff leaves on the kernel that it differentiates, see
// include/warp/Autodiff.h.
/// Arguments that the primal does not have, one dictionary each: `kind`
/// ("preserved", "saved", "counters", "tangent"), `leaf`, `per_thread`, and
/// for counters `places`, a line of text each.
constexpr llvm::StringLiteral hidden = "warp.hidden";
/// Array leaves whose contents the derivative reads.
constexpr llvm::StringLiteral needed = "warp.needed";
/// Present if the derivative is right for launches of one thread only; the
/// text says why.
constexpr llvm::StringLiteral oneThread = "warp.one_thread";
/// Lines for the user.
constexpr llvm::StringLiteral notices = "warp.notices";
/// Numbers about the code, by name.
constexpr llvm::StringLiteral metrics = "warp.metrics";
/// On a second function: the kernel, changed to save what its adjoint needs.
constexpr llvm::StringLiteral augmented = "warp.augmented";
/// On a function next to an adjoint: it finds how much tape each thread needs.
constexpr llvm::StringLiteral counting = "warp.counting";
/// On a second function: by how much its launch is larger, per dimension.
constexpr llvm::StringLiteral halo = "warp.halo";
/// On a function: the one that is its derivative, in reverse and in forward
/// mode, and the one that is run to get its values again.
constexpr llvm::StringLiteral vjp = "warp.vjp";
constexpr llvm::StringLiteral jvp = "warp.jvp";
constexpr llvm::StringLiteral replay = "warp.replay";
/// How many of the last results are for the derivative alone.
constexpr llvm::StringLiteral residuals = "warp.residuals";
} // namespace attr

#define GEN_PASS_DECL
#include "WarpDialect/Passes.h.inc"

#define GEN_PASS_REGISTRATION
#include "WarpDialect/Passes.h.inc"

} // namespace warp

#endif // WARPDIALECT_PASSES_H
