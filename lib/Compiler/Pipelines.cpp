//===- Pipelines.cpp - Named phases of the compiler -----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Pipelines.h"

#include "Target.h"

#include "WarpDialect/Passes.h"
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
#include "mlir/Target/LLVMIR/Dialect/NVVM/NVVMToLLVMIRTranslation.h"
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

void warp::addSpecialize(OpPassManager &pm, const CompileOptions &options) {
  SpecializeOptions facts;
  facts.target = options.target;
  facts.rank = options.rank;
  facts.contiguous = options.contiguous;
  facts.index32 = options.index32;
  facts.flat = options.flat;
  facts.large = options.large;
  facts.disjoint = options.disjoint;
  facts.lanes = options.lanes;
  facts.debug = options.debug;
  facts.fastMath = options.fastMath;
  facts.deterministic = options.deterministic;
  facts.ordered = options.ordered;
  facts.blockDim = options.blockDim;
  facts.threads = options.threads;
  if (!isGpu(options))
    facts.vectorBits = getVectorBits(options);
  pm.addPass(createSpecialize(facts));
}

/// Arith's rewrites of a select expect signless integers and make invalid
/// operations of others, so in this phase small branches stay branches.
std::unique_ptr<Pass> warp::createWarpCanonicalizer() {
  return createCanonicalizerPass(
      GreedyRewriteConfig(),
      {"(anonymous namespace)::ConvertTrivialIfToSelect"});
}

void warp::addPhase(OpPassManager &pm, Phase phase) {
  switch (phase) {
  case Phase::Warp:
    pm.addPass(createResolveDerivatives());
    pm.addPass(createInlinerPass({}, [](OpPassManager &) {}));
    pm.addPass(createSymbolDCEPass());
    pm.addPass(createWarpCanonicalizer());
    pm.addPass(createCSEPass());
    pm.addPass(createVerifyWarp());
    return;
  case Phase::Thread:
    pm.addPass(createLowerComposites());
    pm.addPass(createCanonicalizerPass());
    pm.addPass(createCSEPass());
    pm.addPass(createVerifyThread());
    return;
  case Phase::Launch:
    pm.addPass(createSumExactly());
    pm.addPass(createFuseMultiplyAdd());
    pm.addPass(createFormLaunch());
    pm.addPass(createPrivatizeAtomics());
    pm.addPass(createWidenThreads());
    pm.addPass(createVerifyLaunch());
    return;
  case Phase::Gpu:
    pm.addPass(createEmitEntry());
    pm.addPass(createLowerLanes());
    pm.addPass(createRotateLoops());
    pm.addPass(createCombineOverWarps());
    pm.addPass(createLowerSums());
    pm.addPass(createUnrollLoops());
    pm.addPass(createStageLoads());
    pm.addPass(createOrderAccesses());
    pm.addPass(createLowerArrays());
    pm.addPass(createExpandRoots());
    pm.addPass(createLowerMath());
    pm.addPass(createFormGpuModule());
    pm.addPass(createVerifyGpu());
    return;
  case Phase::LLVM:
    pm.addPass(createConvertToLLVM());
    pm.addPass(createVerifyLLVM());
    return;
  }
}

void warp::addPipeline(OpPassManager &pm, Phase last,
                       const CompileOptions &options) {
  addPhase(pm, Phase::Warp);
  if (last == Phase::Warp)
    return;
  addSpecialize(pm, options);
  for (Phase phase :
       {Phase::Thread, Phase::Launch, Phase::Gpu, Phase::LLVM})
    if (phase <= last)
      addPhase(pm, phase);
}

void warp::registerCompilerDialects(DialectRegistry &registry) {
  registry.insert<WarpDialect, arith::ArithDialect, cf::ControlFlowDialect,
                  func::FuncDialect, gpu::GPUDialect, LLVM::LLVMDialect,
                  math::MathDialect, memref::MemRefDialect, scf::SCFDialect>();
  func::registerInlinerExtension(registry);
  registerBuiltinDialectTranslation(registry);
  registerLLVMDialectTranslation(registry);
  registerNVVMDialectTranslation(registry);
}
