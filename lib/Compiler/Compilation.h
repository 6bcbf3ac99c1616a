//===- Compilation.h - One run of the compiler ------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_COMPILATION_H
#define WARP_LIB_COMPILER_COMPILATION_H

#include "Context.h"
#include "Pipelines.h"
#include "Target.h"

#include "warp/Compile.h"

#include "llvm/ADT/SmallVector.h"

#include <optional>

namespace llvm {
class LLVMContext;
class Module;
} // namespace llvm

namespace warp {

/// The steps from a module to bytes, in the order in which they are called.
/// Throws `Error`; whatever has been made is freed with the object.
class Compilation {
public:
  Compilation(const Module &source, const CompileOptions &options);
  ~Compilation();

  void lowerTo(Phase last);
  /// Lowers to phase `launch` and says what is plain to see there.
  std::vector<Choice> describeLaunch();
  void translate();
  /// True if the translated module, for a GPU, calls functions that there is
  /// machine code of.
  bool callsAssembled() const;
  /// Goes on with `quickOptions`.
  void compileQuickly();
  void optimizeModule();
  llvm::SmallVector<char, 0> emitCode(bool asText);

  std::string moduleText();
  std::string llvmText();

  /// All but the binary, which LLVM makes.
  Code code;
  /// For a launch of few threads that are soon over: compiled quickly, of use
  /// for no other.
  bool isBrief = false;
  /// Rough operations of one thread.
  double cost = 0;
  int leastBlocks = 0, mostRegisters = 0;
  /// Decisions that passes noted.
  std::vector<Choice> choices;

  /// Stage texts go to the folder that WARP_DUMP names.
  void dump(llvm::StringRef extension);
  void writeStage(llvm::StringRef extension, llvm::StringRef text);
  std::string fileStem();

private:
  /// Milliseconds of a clock.
  static double now();
  /// The folder that stage texts go to; empty for nowhere.
  static llvm::StringRef dumpFolder();
  void time(const std::string &phase, double since);
  /// Runs one phase on the module, which is verified after the last one; on
  /// failure throws with all that is known.
  void runPhase(Phase phase, bool isLast);
  mlir::LogicalResult runPasses(mlir::ModuleOp module, Phase phase);
  std::string textBefore(Phase phase, const std::string &pass);
  void collectFacts(mlir::ModuleOp module);
  /// True if LLVM has to keep the bits of every result of the translated module;
  /// not asked on GPUs.
  bool hasExactFloats() const;

  CompileOptions options;
  std::shared_ptr<Module::Impl> source;
  mlir::OwningOpRef<mlir::ModuleOp> op;
  /// Errors of LLVM's passes.
  std::string llvmErrors;
  // The module must go before its context.
  std::unique_ptr<llvm::LLVMContext> llvmContext;
  std::unique_ptr<llvm::Module> llvmModule;
  std::optional<MachineLease> machine;
};

/// Rough operations of one thread of thread IR; loops count 32 times.
double estimateCost(mlir::ModuleOp module);

/// The text of a module with what `replace` adds for each ` loc(...)`, and
/// without definitions of locations.
std::string replaceLocations(
    llvm::StringRef text,
    llvm::function_ref<void(llvm::StringRef location, std::string &out)>
        replace);

} // namespace warp

#endif // WARP_LIB_COMPILER_COMPILATION_H
