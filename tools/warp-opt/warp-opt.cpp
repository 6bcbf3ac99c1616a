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
#include "WarpDialect/Passes.h"

#include "mlir/Pass/PassManager.h"
#include "mlir/Pass/PassOptions.h"
#include "mlir/Pass/PassRegistry.h"
#include "mlir/Tools/mlir-opt/MlirOptMain.h"
#include "mlir/Transforms/Passes.h"

using namespace mlir;

namespace {

struct PipelineOptions : PassPipelineOptions<PipelineOptions> {
  Option<bool> toWarp{*this, "to-warp", llvm::cl::desc("Stop at warp IR")};
  Option<bool> toThread{*this, "to-thread",
                        llvm::cl::desc("Stop at thread IR")};
  Option<bool> toLaunch{*this, "to-launch",
                        llvm::cl::desc("Stop at launch IR")};
  Option<bool> toGpu{*this, "to-gpu",
                     llvm::cl::desc("Stop before the target's operations")};
  Option<bool> toLLVM{*this, "to-llvm",
                      llvm::cl::desc("Stop at the LLVM dialect")};
  Option<std::string> target{*this, "target", llvm::cl::init("cpu"),
                             llvm::cl::desc("cpu or sm_<number>")};
  Option<int> rank{*this, "rank", llvm::cl::init(1),
                   llvm::cl::desc("Dimensions of the launch")};
  Option<uint64_t> contiguous{*this, "contiguous", llvm::cl::init(0),
                              llvm::cl::desc("Bit i: argument i is packed")};
  Option<bool> index32{*this, "index32", llvm::cl::init(true),
                       llvm::cl::desc("32 bits index everything")};
  Option<bool> flat{*this, "flat", llvm::cl::init(false),
                    llvm::cl::desc("GPU: one linear grid axis")};
  Option<bool> debug{*this, "debug", llvm::cl::init(false),
                     llvm::cl::desc("Check bounds and assertions")};
  Option<bool> fastMath{*this, "fast-math", llvm::cl::init(false),
                        llvm::cl::desc("Approximate")};
  Option<bool> deterministic{*this, "deterministic", llvm::cl::init(false),
                             llvm::cl::desc("Sums have the same bits")};
  Option<bool> ordered{*this, "ordered", llvm::cl::init(false),
                       llvm::cl::desc("They do by one order of updates")};
  Option<bool> large{*this, "large", llvm::cl::init(false),
                     llvm::cl::desc("The launch fills the GPU many times over")};
  Option<bool> disjoint{
      *this, "disjoint", llvm::cl::init(false),
      llvm::cl::desc("No array that is written overlaps another one")};
  Option<int> threads{*this, "threads", llvm::cl::init(16),
                      llvm::cl::desc("Threads that would share a CPU launch")};
  Option<int> blockDim{*this, "block-dim", llvm::cl::init(256),
                       llvm::cl::desc("Threads of a GPU block")};
};

} // namespace

static void addPipeline(OpPassManager &pm, const PipelineOptions &given) {
  warp::CompileOptions options;
  options.target = given.target;
  options.rank = given.rank;
  options.contiguous = given.contiguous;
  options.index32 = given.index32;
  options.flat = given.flat;
  options.debug = given.debug;
  options.fastMath = given.fastMath;
  options.deterministic = given.deterministic;
  options.ordered = given.ordered;
  options.blockDim = given.blockDim;
  options.threads = given.threads;
  options.large = given.large;
  options.disjoint = given.disjoint;
  warp::Phase last = given.toWarp     ? warp::Phase::Warp
                     : given.toThread ? warp::Phase::Thread
                     : given.toLaunch ? warp::Phase::Launch
                     : given.toGpu    ? warp::Phase::Gpu
                                      : warp::Phase::LLVM;
  warp::addPipeline(pm, last, options);
}

int main(int argc, char **argv) {
  if (std::optional<int> status = emitMain(argc, argv))
    return *status;
  registerTransformsPasses();
  warp::registerWarpPasses();
  PassPipelineRegistration<PipelineOptions> pipeline(
      "warp-pipeline",
      "The compiler up to a phase: to-warp, to-thread, to-launch, to-gpu, "
      "to-llvm",
      addPipeline);
  DialectRegistry registry;
  warp::registerCompilerDialects(registry);
  return asMainReturnCode(
      MlirOptMain(argc, argv, "warp pass driver\n", registry));
}
