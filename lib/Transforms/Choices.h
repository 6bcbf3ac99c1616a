//===- Choices.h - Notes of scheduling decisions ----------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A pass that chooses between ways to run a kernel leaves a note of it on the
// kernel function, for `Kernel::schedules`: what it is about, how it was
// settled, and why. Nobody but a reader acts on notes.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_CHOICES_H
#define WARP_LIB_TRANSFORMS_CHOICES_H

#include "mlir/IR/Operation.h"

namespace warp {

struct Choice;

namespace attr {
/// The notes, in order.
constexpr llvm::StringLiteral choices = "warp.choices";
} // namespace attr

/// Adds a note to a kernel function. `place` is what the decision is about, if
/// that is not the whole kernel.
void noteChoice(mlir::Operation *function, llvm::StringRef what,
                const llvm::Twine &value, const llvm::Twine &reason,
                mlir::Operation *place = nullptr);

/// The notes of a function.
std::vector<Choice> readChoices(mlir::Operation *function);

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_CHOICES_H
