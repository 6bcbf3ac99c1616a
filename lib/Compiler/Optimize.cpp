//===- Optimize.cpp - LLVM's optimiser, libraries and emission ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Abandon.h"
#include "Target.h"

#include "Targets/Nvidia/AssembledLibrary.h"
#include "WarpDialect/CallAttributes.h"

#include "warp/Error.h"
#include "warp/Forks.h"

#include "llvm/Analysis/InlineCost.h"
#include "llvm/Bitcode/BitcodeReader.h"
#include "llvm/IR/LegacyPassManager.h"
#include "llvm/IR/Module.h"
#include "llvm/Linker/Linker.h"
#include "llvm/MC/MCSubtargetInfo.h"
#include "llvm/Passes/PassBuilder.h"
#include "llvm/Support/CommandLine.h"
#include "llvm/Support/MemoryBuffer.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/Target/TargetMachine.h"
#include "llvm/Transforms/IPO/AlwaysInliner.h"
#include "llvm/Transforms/IPO/GlobalDCE.h"
#include "llvm/Transforms/IPO/InferFunctionAttrs.h"
#include "llvm/Transforms/IPO/Inliner.h"
#include "llvm/Transforms/IPO/Internalize.h"
#include "llvm/Transforms/InstCombine/InstCombine.h"
#include "llvm/Transforms/Scalar/DeadStoreElimination.h"
#include "llvm/Transforms/Scalar/EarlyCSE.h"
#include "llvm/Transforms/Scalar/GVN.h"
#include "llvm/Transforms/Scalar/IndVarSimplify.h"
#include "llvm/Transforms/Scalar/InferAlignment.h"
#include "llvm/Transforms/Scalar/LICM.h"
#include "llvm/Transforms/Scalar/LoopDeletion.h"
#include "llvm/Transforms/Scalar/LoopIdiomRecognize.h"
#include "llvm/Transforms/Scalar/LoopInstSimplify.h"
#include "llvm/Transforms/Scalar/LoopLoadElimination.h"
#include "llvm/Transforms/Scalar/LoopPassManager.h"
#include "llvm/Transforms/Scalar/LoopRotation.h"
#include "llvm/Transforms/Scalar/LoopSimplifyCFG.h"
#include "llvm/Transforms/Scalar/LoopUnrollPass.h"
#include "llvm/Transforms/Scalar/SROA.h"
#include "llvm/Transforms/Scalar/SimpleLoopUnswitch.h"
#include "llvm/Transforms/Scalar/SimplifyCFG.h"
#include "llvm/Transforms/Vectorize/LoopVectorize.h"
#include "llvm/Transforms/Vectorize/SLPVectorizer.h"
#include "llvm/Transforms/Vectorize/VectorCombine.h"

#include <map>
#include <vector>

using namespace warp;

//===----------------------------------------------------------------------===//
// Machines
//===----------------------------------------------------------------------===//

namespace {
struct MachinePool {
  ForkMutex mutex;
  std::map<std::string, std::vector<std::unique_ptr<llvm::TargetMachine>>> idle;

  static MachinePool &get() {
    static auto *pool = new MachinePool;
    return *pool;
  }
};
} // namespace

MachineLease::MachineLease(const std::string &key,
                           std::unique_ptr<llvm::TargetMachine> machine)
    : key(key), machine(std::move(machine)) {}

MachineLease::MachineLease(MachineLease &&) = default;

MachineLease::~MachineLease() {
  if (!machine)
    return;
  MachinePool &pool = MachinePool::get();
  std::lock_guard guard(pool.mutex);
  pool.idle[key].push_back(std::move(machine));
}

MachineLease MachineLease::get(const CompileOptions &options) {
  std::string key = options.target + " " + std::to_string(options.optLevel);
  MachinePool &pool = MachinePool::get();
  {
    std::lock_guard guard(pool.mutex);
    auto &idle = pool.idle[key];
    if (!idle.empty()) {
      auto machine = std::move(idle.back());
      idle.pop_back();
      return MachineLease(key, std::move(machine));
    }
  }
  auto machine = getTarget(options).createMachine(options);
  if (!machine ||
      !machine->getMCSubtargetInfo()->isCPUStringValid(machine->getTargetCPU()))
    throw Error(Error::Kind::Compile,
                "no code generator for target '" + options.target + "'");
  return MachineLease(key, std::move(machine));
}

//===----------------------------------------------------------------------===//
// Libraries
//===----------------------------------------------------------------------===//

void warp::linkBitcode(llvm::Module &module,
                       llvm::function_ref<llvm::StringRef()> bitcode,
                       llvm::StringRef name) {
  bool missing = llvm::any_of(module, [](llvm::Function &function) {
    return function.isDeclaration() && !function.isIntrinsic() &&
           !AssembledCalls::isKept(function);
  });
  if (!missing)
    return;
  auto parsed = llvm::getLazyBitcodeModule(
      llvm::MemoryBufferRef(bitcode(), name), module.getContext(),
      /*ShouldLazyLoadMetadata=*/true);
  if (!parsed)
    throw Error(Error::Kind::Compile, "cannot read the embedded " + name.str() +
                                          ": " +
                                          llvm::toString(parsed.takeError()));
  llvm::Module &library = **parsed;
  // These would link everything that they list.
  for (llvm::StringRef list : {"llvm.used", "llvm.compiler.used"})
    if (auto *global = library.getNamedGlobal(list))
      global->eraseFromParent();
  library.setTargetTriple(module.getTargetTriple());
  library.setDataLayout(module.getDataLayout());
  auto internalize = [](llvm::Module &linked, const llvm::StringSet<> &names) {
    llvm::internalizeModule(linked, [&](const llvm::GlobalValue &value) {
      return !value.hasName() || !names.count(value.getName());
    });
  };
  bool failed = llvm::Linker::linkModules(
      module, std::move(*parsed), llvm::Linker::LinkOnlyNeeded, internalize);
  if (failed)
    throw Error(Error::Kind::Compile, "cannot link the embedded " + name.str());
}

//===----------------------------------------------------------------------===//
// Optimisation and emission
//===----------------------------------------------------------------------===//

template <typename T> static void setLlvmOption(llvm::StringRef name, T value) {
  auto &all = llvm::cl::getRegisteredOptions();
  auto found = all.find(name);
  if (found != all.end())
    static_cast<llvm::cl::opt<T> *>(found->second)->setValue(value);
}

/// Passes that take long and gain nothing here, and only options of the command
/// line have a say in.
static void setLlvmOptions() {
  // A second, narrower vector loop for what the first leaves over would cost a
  // quarter of the compile time.
  setLlvmOption("enable-epilogue-vectorization", false);
  // Live ranges that are split across more blocks than this get the same code
  // without being grown over all of them, which takes the square of a long
  // kernel's size (14 s of 17 for a thousand sines).
  setLlvmOption("grow-region-complexity-budget", 1000u);
  // A store that makes another one dead is near it; the default of 90 steps
  // takes two fifths of the passes' time where many elements are stored.
  setLlvmOption("dse-memoryssa-walklimit", 20u);
}

namespace {
/// The analyses that passes share.
struct Analyses {
  Analyses(llvm::PassBuilder &builder) {
    builder.registerModuleAnalyses(modules);
    builder.registerCGSCCAnalyses(calls);
    builder.registerFunctionAnalyses(functions);
    builder.registerLoopAnalyses(loops);
    builder.crossRegisterProxies(loops, functions, calls, modules);
  }

  llvm::LoopAnalysisManager loops;
  llvm::FunctionAnalysisManager functions;
  llvm::CGSCCAnalysisManager calls;
  llvm::ModuleAnalysisManager modules;
};
} // namespace

/// Instructions beyond which statements are not joined into vectors: that would
/// take three times as long as all other passes together, and what is so long
/// is seldom straight-line arithmetic.
static constexpr unsigned mostJoined = 8000;

/// Accesses of a loop beyond which none of them stays in a register from one
/// iteration to the next: to look for such ones takes the square of their
/// number. Where a GPU's loops have more, they are unrolled exchanges by way of
/// shared memory (a third of the time that a Cholesky factor takes here).
static constexpr unsigned mostPromotedOnGpus = 100, mostPromotedOnCpus = 250;

/// The remaining passes for code whose calls are inlined and whose loops have
/// the form they were given on purpose: a third of the standard passes find
/// that.
static llvm::FunctionPassManager buildLeanPasses(bool gpu, bool vectorize,
                                                 bool join) {
  using namespace llvm;
  auto memory = [](LoopPassManager passes) {
    return createFunctionToLoopPassAdaptor(std::move(passes),
                                           /*UseMemorySSA=*/true);
  };
  FunctionPassManager all;
  all.addPass(SROAPass(SROAOptions::ModifyCFG));
  all.addPass(EarlyCSEPass(/*UseMemorySSA=*/true));
  all.addPass(
      SimplifyCFGPass(SimplifyCFGOptions().convertSwitchRangeToICmp(true)));
  all.addPass(InstCombinePass());

  auto hoisting = [&](bool speculate) {
    return LICMPass(LICMOptions(
        100, gpu ? mostPromotedOnGpus : mostPromotedOnCpus, speculate));
  };
  LoopPassManager rotate;
  rotate.addPass(LoopInstSimplifyPass());
  rotate.addPass(LoopSimplifyCFGPass());
  rotate.addPass(hoisting(/*speculate=*/false));
  rotate.addPass(LoopRotatePass());
  rotate.addPass(hoisting(/*speculate=*/true));
  rotate.addPass(SimpleLoopUnswitchPass());
  all.addPass(memory(std::move(rotate)));
  all.addPass(SimplifyCFGPass());
  LoopPassManager simplify;
  simplify.addPass(LoopIdiomRecognizePass());
  simplify.addPass(IndVarSimplifyPass());
  simplify.addPass(LoopDeletionPass());
  simplify.addPass(LoopFullUnrollPass());
  all.addPass(createFunctionToLoopPassAdaptor(std::move(simplify)));

  all.addPass(SROAPass(SROAOptions::ModifyCFG));
  all.addPass(GVNPass());
  all.addPass(DSEPass());
  all.addPass(InstCombinePass());
  if (vectorize) {
    all.addPass(LoopVectorizePass());
    all.addPass(InferAlignmentPass());
    all.addPass(LoopLoadEliminationPass());
    all.addPass(InstCombinePass());
    all.addPass(SimplifyCFGPass(SimplifyCFGOptions()
                                    .convertSwitchRangeToICmp(true)
                                    .needCanonicalLoops(false)
                                    .hoistCommonInsts(true)
                                    .sinkCommonInsts(true)));
    if (join)
      all.addPass(SLPVectorizerPass());
  }
  all.addPass(VectorCombinePass());
  all.addPass(LoopUnrollPass());
  all.addPass(InstCombinePass());
  LoopPassManager hoist;
  hoist.addPass(hoisting(/*speculate=*/true));
  all.addPass(memory(std::move(hoist)));
  all.addPass(SimplifyCFGPass(SimplifyCFGOptions()
                                  .convertSwitchRangeToICmp(true)
                                  .convertSwitchToLookupTable(true)
                                  .forwardSwitchCondToPhi(true)
                                  .needCanonicalLoops(false)
                                  .hoistCommonInsts(true)
                                  .sinkCommonInsts(true)));
  return all;
}

/// The library was optimised when it was built: what is long is called on CPUs,
/// what is short, or called once by a GPU, becomes part of the kernel.
static void optimizeLean(llvm::Module &module, llvm::PassBuilder &builder,
                         Analyses &analyses, bool gpu, bool vectorize,
                         bool join) {
  constexpr unsigned longest = 260;
  for (llvm::Function &function : module) {
    if (!function.hasLocalLinkage() || function.isDeclaration())
      continue;
    if (!gpu && function.getInstructionCount() > longest)
      function.addFnAttr(llvm::Attribute::NoInline);
    // LLVM itself would compare targets.
    if (gpu && function.hasOneUse() &&
        !function.hasFnAttribute(llvm::Attribute::NoInline))
      function.addFnAttr(llvm::Attribute::AlwaysInline);
  }
  llvm::ModulePassManager before, after;
  // Answers what libdevice asks about the target.
  if (gpu)
    builder.invokePipelineStartEPCallbacks(before, llvm::OptimizationLevel::O2);
  before.addPass(llvm::InferFunctionAttrsPass());
  before.addPass(llvm::ModuleInlinerWrapperPass(llvm::getInlineParams(2, 0)));
  before.run(module, analyses.modules);
  llvm::FunctionPassManager usual = buildLeanPasses(gpu, vectorize, join);
  llvm::FunctionPassManager quick =
      buildLeanPasses(gpu, vectorize, /*join=*/false);
  for (llvm::Function &function : module) {
    if (function.isDeclaration() || (!gpu && function.hasLocalLinkage() &&
                                     !function.hasFnAttribute(attr::kept)))
      continue;
    bool isLong = function.getInstructionCount() > mostJoined;
    (isLong ? quick : usual).run(function, analyses.functions);
  }
  analyses.modules.clear();
  after.addPass(llvm::GlobalDCEPass());
  after.run(module, analyses.modules);
}

/// The least that makes generating code quick: values in registers, said once.
static void optimizeQuickly(llvm::Module &module, llvm::PassBuilder &builder,
                            Analyses &analyses, bool gpu) {
  llvm::ModulePassManager passes;
  if (gpu)
    builder.invokePipelineStartEPCallbacks(passes, llvm::OptimizationLevel::O0);
  passes.addPass(llvm::AlwaysInlinerPass());
  llvm::FunctionPassManager each;
  each.addPass(llvm::SROAPass(llvm::SROAOptions::PreserveCFG));
  each.addPass(llvm::EarlyCSEPass());
  passes.addPass(llvm::createModuleToFunctionPassAdaptor(std::move(each)));
  passes.run(module, analyses.modules);
}

/// Code without lanes gathers nothing: that pays where arithmetic outweighs
/// memory, and such kernels have lanes. LLVM's vectorizer would gather every
/// field of long structs, 8 times slower than scalar code.
static void avoidGathers(llvm::Module &module,
                         const llvm::TargetMachine &machine) {
  std::string features = machine.getTargetFeatureString().str() +
                         ",+prefer-no-gather,+prefer-no-scatter";
  for (llvm::Function &function : module)
    if (!function.isDeclaration())
      function.addFnAttr("target-features", features);
}

void warp::optimize(llvm::Module &module, llvm::TargetMachine &machine,
                    const CompileOptions &options, bool hasLanes, bool brief) {
  static const bool once = (setLlvmOptions(), true);
  (void)once;
  llvm::PassInstrumentationCallbacks callbacks;
  keepLoadsBeforeStores(callbacks);
  callbacks.registerShouldRunOptionalPassCallback(
      [](llvm::StringRef, llvm::Any) { return !isAbandoned(); });
  llvm::PipelineTuningOptions tuning;
  tuning.LoopVectorization = tuning.SLPVectorization = !hasLanes;
  llvm::PassBuilder builder(&machine, tuning, std::nullopt, &callbacks);
  if (machine.getTargetTriple().isX86() && !hasLanes)
    avoidGathers(module, machine);
  Analyses analyses(builder);
  bool gpu = getTarget(options).isSimt();
  if (options.optLevel == 0)
    return optimizeQuickly(module, builder, analyses, gpu);
  // LLVM's own pipelines would bring 3.4 MB of passes for coroutines, OpenMP,
  // profiles and the like into the library.
  bool vectors = options.optLevel >= 2;
  optimizeLean(module, builder, analyses, gpu,
               /*vectorize=*/vectors && !gpu && !hasLanes,
               /*join=*/vectors && !brief);
  if (vectors && !gpu && !hasLanes && !brief)
    branchOnIndices(module);
}

/// Instructions beyond which they are scheduled once, before registers are
/// given out: to do it again takes time that grows with the square of a block's
/// size, up to a third of generating code, and gains two to four percent.
static constexpr unsigned mostRescheduled = 1500;

namespace {
/// The level of a machine while it emits one module.
class EmissionLevel {
public:
  EmissionLevel(llvm::Module &module, llvm::TargetMachine &machine, bool brief)
      : machine(machine), usual(machine.getOptLevel()) {
    bool isLong = brief || module.getInstructionCount() > mostRescheduled;
    const llvm::Triple &triple = machine.getTargetTriple();
    if ((triple.isX86() || triple.isAArch64()) && isLong &&
        usual == llvm::CodeGenOptLevel::Default)
      machine.setOptLevel(llvm::CodeGenOptLevel::Less);
  }
  ~EmissionLevel() { machine.setOptLevel(usual); }

private:
  llvm::TargetMachine &machine;
  llvm::CodeGenOptLevel usual;
};
} // namespace

llvm::SmallVector<char, 0> warp::emit(llvm::Module &module,
                                      llvm::TargetMachine &machine,
                                      const TargetInfo &target,
                                      llvm::StringRef entry, bool asText,
                                      bool brief) {
  llvm::SmallVector<char, 0> bytes;
  llvm::raw_svector_ostream stream(bytes);
  EmissionLevel level(module, machine, brief);
  target.finishModule(module);
  llvm::legacy::PassManager passes;
  auto type = asText ? llvm::CodeGenFileType::AssemblyFile
                     : llvm::CodeGenFileType::ObjectFile;
  if (machine.addPassesToEmitFile(passes, stream, nullptr, type,
                                  /*DisableVerify=*/true))
    throw Error(Error::Kind::Compile, "the target cannot emit code");
  passes.run(module);
  target.finishText(bytes, entry);
  return bytes;
}
