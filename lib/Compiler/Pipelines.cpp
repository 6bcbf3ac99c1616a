//===- Pipelines.cpp - Pass pipelines -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The passes that run, in which order and why there: for launches, in named
// phases that end with the pass that verifies them, and for derivatives, in
// stages. Only warp-bound-calls and warp-inline-pullbacks run passes of their
// own.
//
//===----------------------------------------------------------------------===//

#include "Pipelines.h"

#include "Targets/Target.h"
#include "Transforms/Autodiff/Derivation.h"
#include "Transforms/WrongRewrites.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/ControlFlow/IR/ControlFlow.h"
#include "mlir/Dialect/Func/Extensions/InlinerExtension.h"
#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/Math/IR/Math.h"
#include "mlir/Dialect/MemRef/IR/MemRef.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Pass/PassManager.h"
#include "mlir/Target/LLVMIR/Dialect/Builtin/BuiltinToLLVMIRTranslation.h"
#include "mlir/Target/LLVMIR/Dialect/LLVMIR/LLVMToLLVMIRTranslation.h"
#include "mlir/Transforms/GreedyPatternRewriteDriver.h"
#include "mlir/Transforms/Passes.h"

#include "llvm/ADT/StringSwitch.h"

using namespace mlir;

std::optional<warp::Phase> warp::parsePhase(StringRef name) {
  return llvm::StringSwitch<std::optional<Phase>>(name)
      .Case("warp", Phase::Warp)
      .Case("thread", Phase::Thread)
      .Case("launch", Phase::Launch)
      .Case("gpu", Phase::Gpu)
      .Case("llvm", Phase::LLVM)
      .Default(std::nullopt);
}

namespace {
/// All canonicalizations but some, from uses up to definitions: the other way
/// round, every change has all that is around the operation looked at again,
/// and long kernels take ten times as long. Regions are single blocks, so
/// nothing of them is left to be simplified.
struct QuickCanonicalizer : PassWrapper<QuickCanonicalizer, OperationPass<>> {
  MLIR_DEFINE_EXPLICIT_INTERNAL_INLINE_TYPE_ID(QuickCanonicalizer)

  QuickCanonicalizer(ArrayRef<std::string> others = {})
      : disabled(warp::wrongRewrites()) {
    llvm::append_range(disabled, others);
  }

  StringRef getArgument() const override { return "canonicalize"; }

  LogicalResult initialize(MLIRContext *context) override {
    RewritePatternSet all(context);
    for (Dialect *dialect : context->getLoadedDialects())
      dialect->getCanonicalizationPatterns(all);
    for (RegisteredOperationName op : context->getRegisteredOperations())
      op.getCanonicalizationPatterns(all, context);
    warp::addRightRewrites(all);
    patterns =
        std::make_shared<FrozenRewritePatternSet>(std::move(all), disabled);
    return success();
  }

  void runOnOperation() override {
    GreedyRewriteConfig config;
    config.setUseTopDownTraversal(false).setRegionSimplificationLevel(
        GreedySimplifyRegionLevel::Disabled);
    (void)applyPatternsGreedily(getOperation(), *patterns, config);
  }

  SmallVector<std::string> disabled;
  std::shared_ptr<FrozenRewritePatternSet> patterns;
};
} // namespace

static std::unique_ptr<Pass>
createQuickCanonicalizer(ArrayRef<std::string> others = {}) {
  return std::make_unique<QuickCanonicalizer>(others);
}

/// Arith's rewrites of a select expect signless integers and make invalid
/// operations of others, so in this phase small branches stay branches.
static std::unique_ptr<Pass> createWarpCanonicalizer() {
  return createQuickCanonicalizer(
      {"(anonymous namespace)::ConvertTrivialIfToSelect"});
}

void warp::addSimplification(OpPassManager &pm) {
  pm.addPass(createWarpCanonicalizer());
  pm.addPass(createCSEPass());
}

//===----------------------------------------------------------------------===//
// Derivatives
//===----------------------------------------------------------------------===//

void warp::addInlining(OpPassManager &pm, bool mayKeep) {
  pm.addPass(createBoundCalls(/*all=*/false, mayKeep));
  pm.addPass(createInlinerPass({}, [](OpPassManager &) {}));
  // Only what could not be inlined, or has a derivative of its own, is left.
  pm.addPass(createSymbolDCEPass());
  addSimplification(pm);
}

void warp::addResolution(OpPassManager &pm, const AutodiffOptions &options) {
  pm.addPass(createResolveDerivatives(
      {/*keepDerivatives=*/true, options.forward, options.singular}));
}

void warp::addPreparation(OpPassManager &pm) {
  addInlining(pm);
  // Rules are about numbers and composites of them.
  pm.addPass(createFlattenStructs());
  // A builtin without a rule of its own is differentiated as its decomposition.
  pm.addPass(createExpandBuiltins());
  addSimplification(pm);
  // Last, on the indices that are left: a value that goes through memory has
  // no derivative on the way, and an element that a loop updates becomes one.
  pm.addPass(createForwardStores());
}

static std::string activeFlags(const warp::AutodiffOptions &options) {
  std::string text;
  for (bool flag : options.active)
    text += flag ? '1' : '0';
  return text;
}

void warp::addDifferentiation(OpPassManager &pm,
                              const AutodiffOptions &options) {
  DifferentiateKernelOptions derivation;
  derivation.mode = options.winners   ? "winners"
                    : options.forward ? "forward"
                                      : "reverse";
  derivation.active = activeFlags(options);
  derivation.singular = options.singular;
  derivation.width = options.width;
  derivation.unique = options.unique;
  derivation.maxLocalTape = options.maxLocalTape;
  derivation.tape = options.tape;
  pm.addPass(createDifferentiateKernel(derivation));
  // Calls of functions with a derivative of their own are reversed by now.
  pm.addPass(createBoundCalls(/*all=*/true));
  pm.addPass(createInlinePullbacks({derivation.active}));
}

void warp::addTidying(OpPassManager &pm) {
  addSimplification(pm);
  // The forward sweep that reversed loops run again is often the same in each
  // iteration; and a sum that moves out of a loop needs its index outside.
  pm.addPass(createLoopInvariantCodeMotionPass());
  pm.addPass(createSimplifyAdjoint());
  addSimplification(pm);
  // Last: what is left says what the derivative needs.
  pm.addPass(createCleanUpAdjoint());
}

void warp::addGathering(OpPassManager &pm) {
  pm.addPass(createGatherSums());
  addSimplification(pm);
}

void warp::addVerification(OpPassManager &pm) {
  pm.addPass(createVerifyWarp());
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

void warp::addPhase(OpPassManager &pm, Phase phase) {
  switch (phase) {
  case Phase::Warp:
    // While functions are called by name, which derivatives refer to.
    pm.addPass(createResolveDerivatives());
    addInlining(pm, /*mayKeep=*/true);
    pm.addPass(createVerifyWarp());
    return;
  case Phase::Thread:
    // First, so that what the launch decides is folded.
    pm.addPass(createSpecialize());
    // Layout, memory, barriers, in this order; nothing for other kernels.
    pm.addPass(createMaskThreads());
    pm.addPass(createCheckTiles());
    pm.addPass(createApplySchedules({ScheduleStage::tiles}));
    pm.addPass(createScalarizeTiles());
    pm.addPass(createFormLaneLoops());
    pm.addPass(createFuseTiles());
    pm.addPass(createPlaceTiles());
    pm.addPass(createPlanTileMemory());
    pm.addPass(createPlaceBarriers());
    pm.addPass(createLowerTiles());
    pm.addPass(createLowerComposites());
    // Values are signless from here on.
    pm.addPass(createQuickCanonicalizer());
    pm.addPass(createCSEPass());
    // Once conditions are folded, and before costs are estimated.
    pm.addPass(createFoldZeroArguments());
    // Facts about the values that launches decide on, as these find them.
    pm.addPass(createCheckVariance());
    pm.addPass(createVerifyThread());
    return;
  case Phase::Launch:
    // Before any schedule, so that all of them have the same bits.
    pm.addPass(createFuseMultiplyAdd());
    pm.addPass(createFormLaunch());
    // Before lanes: what threads yield, lanes combine; and a launch that one
    // thread runs widens its updates in another way.
    pm.addPass(createPlanUpdates());
    pm.addPass(createCombineOverGroups());
    pm.addPass(createWidenThreads());
    pm.addPass(createVerifyLaunch());
    return;
  case Phase::Gpu:
    pm.addPass(createApplySchedules({ScheduleStage::threads}));
    pm.addPass(createEmitEntry());
    // Masks of full vectors are constants now.
    pm.addPass(createLowerLanes());
    // Iterations that are in no tile of a ring are combined over warps.
    pm.addPass(createApplySchedules({ScheduleStage::updates}));
    pm.addPass(createCombineOverWarps());
    // Needs loops to hoist out of.
    pm.addPass(createLowerSums());
    // Copies of an iteration next to each other; staging leaves alone what
    // has become short, and OrderAccesses brings their loads together.
    pm.addPass(createUnrollLoops());
    pm.addPass(createApplySchedules({ScheduleStage::loads}));
    // Last to move accesses, as no later pass may mix them.
    pm.addPass(createOrderAccesses());
    // The last that knows arrays.
    pm.addPass(createLowerArrays());
    // Has slow paths of its own for roots, before the rest of math is called.
    pm.addPass(createExpandRoots());
    pm.addPass(createLowerMath());
    // Nothing of our own dialect is left to move along.
    pm.addPass(createFormGpuModule());
    pm.addPass(createVerifyGpu());
    return;
  case Phase::LLVM:
    pm.addPass(createConvertToLLVM());
    pm.addPass(createVerifyLLVM());
    return;
  }
}

LogicalResult
warp::addPipeline(OpPassManager &pm, Phase last, StringRef variant,
                  function_ref<LogicalResult(const Twine &)> errorHandler) {
  std::unique_ptr<Pass> specialize = createSpecialize();
  if (failed(specialize->initializeOptions(variant, errorHandler)))
    return failure();
  addPhase(pm, Phase::Warp);
  if (last == Phase::Warp)
    return success();
  pm.addPass(std::move(specialize));
  for (Phase phase : {Phase::Thread, Phase::Launch, Phase::Gpu, Phase::LLVM})
    if (phase <= last)
      addPhase(pm, phase);
  return success();
}

void warp::registerCompilerDialects(DialectRegistry &registry) {
  registry.insert<WarpDialect, arith::ArithDialect, cf::ControlFlowDialect,
                  func::FuncDialect, gpu::GPUDialect, LLVM::LLVMDialect,
                  math::MathDialect, memref::MemRefDialect, scf::SCFDialect>();
  tiles::registerModels(registry);
  autodiff::setDerive(derive);
  func::registerInlinerExtension(registry);
  registerBuiltinDialectTranslation(registry);
  registerLLVMDialectTranslation(registry);
  registerTargetTranslations(registry);
}
