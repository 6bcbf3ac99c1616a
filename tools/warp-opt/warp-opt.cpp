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
        return errorHandler("no phase '" + name + "'");
      last = *phase;
      return success();
    }
    options += (key + "=" + value + " ").str();
    return success();
  };
  return failure(failed(warp::parseOptions(text, set)) ||
                 failed(warp::addPipeline(pm, last, options, errorHandler)));
}

int main(int argc, char **argv) {
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
