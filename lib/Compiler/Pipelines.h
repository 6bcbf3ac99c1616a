//===- Pipelines.h - Named phases of the compiler ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_PIPELINES_H
#define WARP_LIB_COMPILER_PIPELINES_H

#include "warp/Compile.h"

#include "llvm/ADT/StringRef.h"

#include <memory>
#include <optional>

namespace mlir {
class DialectRegistry;
class OpPassManager;
class Pass;
} // namespace mlir

namespace warp {

/// Where a module can stop on its way to the LLVM dialect. Each phase ends
/// with the pass that verifies it.
enum class Phase { Warp, Thread, Launch, Gpu, LLVM };

std::optional<Phase> parsePhase(llvm::StringRef name);

/// Appends warp-specialize with these options.
void addSpecialize(mlir::OpPassManager &pm, const CompileOptions &options);

/// The canonicalizer for IR whose integers have a sign.
std::unique_ptr<mlir::Pass> createWarpCanonicalizer();

/// Appends one phase. That of thread IR expects a specialised kernel.
void addPhase(mlir::OpPassManager &pm, Phase phase);

/// Appends everything up to a phase.
void addPipeline(mlir::OpPassManager &pm, Phase last,
                 const CompileOptions &options);

/// Dialects, extensions and translations that the phases need.
void registerCompilerDialects(mlir::DialectRegistry &registry);

} // namespace warp

#endif // WARP_LIB_COMPILER_PIPELINES_H
