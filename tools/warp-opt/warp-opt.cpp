//===- warp-opt.cpp - Runs passes on warp IR ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Two ways to use it:
//
//   warp-opt in.mlir --warp-lower-arrays ...            any passes
//   warp-opt in.mlir --warp-pipeline="to-llvm rank=2"   phases of the compiler
//   warp-opt in.mlir --warp-emit=ptx --warp-options=target=sm_90,rank=2
//                                                       what the library emits
//
//===----------------------------------------------------------------------===//

#include "EmitMain.h"

#include "Pipelines.h"
#include "Transforms/Variant.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Pass/PassManager.h"
#include "mlir/Pass/PassRegistry.h"
#include "mlir/Tools/mlir-opt/MlirOptMain.h"
#include "mlir/Transforms/Passes.h"

#include "llvm/Support/raw_ostream.h"

using namespace mlir;

/// Options are `to-<phase>` and those of warp-specialize.
static LogicalResult
addPipeline(OpPassManager &pm, StringRef text,
            function_ref<LogicalResult(const Twine &)> errorHandler) {
  warp::Phase last = warp::Phase::LLVM;
  std::string options;
  auto set = [&](StringRef key, StringRef value) {
    StringRef name = key;
    if (name.consume_front("to-")) {
      std::optional<warp::Phase> phase = warp::parsePhase(name);
      if (!phase)
        return errorHandler("no phase '" + name +
                            "', there are: warp, thread, launch, gpu, llvm");
      last = *phase;
      return success();
    }
    options += (key + "=" + value + " ").str();
    return success();
  };
  return failure(failed(warp::parseOptions(text, set)) ||
                 failed(warp::addPipeline(pm, last, options, errorHandler)));
}

/// Printed before the options of MLIR and LLVM.
static constexpr StringLiteral usage =
    R"(warp-opt: run passes and phases of the compiler on IR

  warp-opt IN.mlir --warp-pipeline="to-PHASE [KEY=VALUE ...]"
      the compiler up to a phase: warp, thread, launch, gpu, llvm;
      keys are those of --warp-specialize, such as rank=2 or target=sm_90
  warp-opt IN.mlir --warp-emit=STAGE [--warp-options=KEY[=VALUE],...]
      the text that the library emits: warp, thread, launch, gpu, llvm, ptx,
      asm, times, parameters, fingerprint, regions, adjoint, tangent
  warp-opt IN.mlir --warp-NAME ...
      single passes, listed below with all other options

)";

/// Says how to use the tool where it is asked, or where an option that takes a
/// stage has none.
static void printUsage(int argc, char **argv) {
  for (StringRef argument : ArrayRef(argv, argc).drop_front())
    if (argument == "--help" || argument == "-help" || argument == "-h" ||
        argument == "--warp-emit")
      return void(llvm::outs() << usage);
}

int main(int argc, char **argv) {
  printUsage(argc, argv);
  if (std::optional<int> status = emitMain(argc, argv))
    return *status;
  registerTransformsPasses();
  warp::registerWarpPasses();
  warp::registerWarpTilePasses();
  registerPassPipeline(
      "warp-pipeline",
      "The compiler up to a phase: to-warp, to-thread, to-launch, to-gpu, "
      "to-llvm",
      addPipeline,
      [](function_ref<void(const detail::PassOptions &)>) {});
  DialectRegistry registry;
  warp::registerCompilerDialects(registry);
  return asMainReturnCode(
      MlirOptMain(argc, argv, "warp pass driver\n", registry));
}
