//===- Passes.h - Passes of the warp dialect --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_PASSES_H
#define WARPDIALECT_PASSES_H

#include "mlir/Pass/Pass.h"

namespace warp {

/// Points of the pipeline at which warp-apply-schedules runs.
enum class ScheduleStage {
  /// Operations on tiles, before they have layouts.
  tiles,
  /// The body of `warp.threads`, before there is an entry.
  threads,
  /// Loops of the entry, before updates are combined over warps.
  updates,
  /// Loops of the entry, once they are unrolled.
  loads,
};

/// Attributes of functions and operations that passes leave for later ones.
namespace attr {
/// How the kernel's arguments looked before they were taken apart.
constexpr llvm::StringLiteral argTypes = "warp.arg_types";
/// Names of those arguments.
constexpr llvm::StringLiteral argNames = "warp.arg_names";
/// On a derivative: the kernel that it is of, for messages.
constexpr llvm::StringLiteral primal = "warp.primal";
/// The kind of launch, a `#warp.variant`, from warp-specialize on; how to make
/// it, a `#warp.schedule`. See KernelFunction.h of lib/Transforms.
constexpr llvm::StringLiteral variant = "warp.variant";
constexpr llvm::StringLiteral schedule = "warp.schedule";
/// On an operation: the integer that it gives is not negative.
constexpr llvm::StringLiteral nonNegative = "warp.non_negative";
/// On an argument of a kernel in phase `launch`: an array without gaps in
/// row-major order; how messages call it.
constexpr llvm::StringLiteral packed = "warp.packed";
constexpr llvm::StringLiteral name = "warp.name";
/// On a sum of floats of an adjoint: its terms may be added in any order.
constexpr llvm::StringLiteral anyOrder = "warp.any_order";
/// On a comparison: true for a thread that is not in step with others.
constexpr llvm::StringLiteral inStep = "warp.in_step";
/// The function that a launch calls, once warp-emit-entry has made it.
constexpr llvm::StringLiteral entry = "warp.entry";
/// On an atomic update: how it is to be made, a `#warp.update`.
constexpr llvm::StringLiteral update = "warp.update";
/// Places that error records refer to by number.
constexpr llvm::StringLiteral sites = "warp.sites";

// Attributes that warp-autodiff leaves on the kernel that it differentiates,
// see include/warp/Autodiff.h.
/// On an argument that the primal does not have, a `#warp.hidden`; at the end
/// on the function, a list of them.
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
