//===- Pipelines.h - Named phases of the compiler ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_PIPELINES_H
#define WARP_LIB_COMPILER_PIPELINES_H

#include "mlir/Support/LLVM.h"

#include "llvm/ADT/STLFunctionalExtras.h"
#include "llvm/ADT/StringRef.h"
#include "llvm/ADT/Twine.h"

#include <memory>
#include <optional>

namespace mlir {
class DialectRegistry;
class ModuleOp;
class OpPassManager;
class Pass;
} // namespace mlir

namespace warp {

struct AutodiffOptions;

/// The stops of a module on its way to the LLVM dialect. Each phase ends
/// with the pass that verifies it.
enum class Phase { Warp, Thread, Launch, Gpu, LLVM };

std::optional<Phase> parsePhase(llvm::StringRef name);

/// Appends one phase.
void addPhase(mlir::OpPassManager &pm, Phase phase);

/// Appends everything up to a phase, for the variant that the text of
/// warp-specialize's options describes.
mlir::LogicalResult addPipeline(
    mlir::OpPassManager &pm, Phase last, llvm::StringRef variant,
    llvm::function_ref<mlir::LogicalResult(const llvm::Twine &)> errorHandler);

/// Removes what rewrites leave behind: constants to fold, code said twice.
void addSimplification(mlir::OpPassManager &pm);

/// BoundCalls.cpp: bounds what copies of called functions make of a kernel.
/// all: those that are marked to stay, too. mayKeep: in code for a launch,
/// where functions may stay calls.
std::unique_ptr<mlir::Pass> createBoundCalls(bool all = false,
                                             bool mayKeep = false);

// Stages of a derivative, which `derive` runs in this order.

/// Inlines functions that have no derivative of their own, and simplifies.
/// mayKeep: those of a launch, of which large ones may stay.
void addInlining(mlir::OpPassManager &pm, bool mayKeep = false);
/// Makes what `warp.vjp` and `warp.jvp` ask for.
void addResolution(mlir::OpPassManager &pm, const AutodiffOptions &options);
void addPreparation(mlir::OpPassManager &pm);
void addDifferentiation(mlir::OpPassManager &pm,
                        const AutodiffOptions &options);
void addTidying(mlir::OpPassManager &pm);
/// Checks that a derivative is legal warp IR.
void addVerification(mlir::OpPassManager &pm);

/// Takes the sums of an adjoint apart from the rest, and simplifies both.
void addGathering(mlir::OpPassManager &pm);

/// KeptDerivatives.cpp: marks the functions that stay calls in the derivatives
/// of a long kernel, and takes the marks off what has become of it: a launch
/// chooses anew.
void markKeptDerivatives(mlir::ModuleOp module);
void unmarkKeptDerivatives(mlir::ModuleOp module);

/// Autodiff.cpp: from a kernel with the functions that it calls to its
/// derivative. The caller has the context's lock.
mlir::LogicalResult derive(mlir::ModuleOp module,
                           const AutodiffOptions &options);

/// Dialects, extensions and translations that the phases need.
void registerCompilerDialects(mlir::DialectRegistry &registry);

} // namespace warp

#endif // WARP_LIB_COMPILER_PIPELINES_H
