//===- Compile.cpp - Compilation of modules to machine code ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One compilation is one `Compilation` object: it clones the module, runs the
// phases of Pipelines.cpp under the context's lock, and leaves it for LLVM's
// part (Generate.cpp). Every step is timed under the name that `Code::phaseMs`
// shows, and dumped if WARP_DUMP names a folder.
//
// A pass that fails is named in the error, with a file that holds the IR it
// was given, so that a report of the failure is complete.
//
//===----------------------------------------------------------------------===//

#include "Abandon.h"
#include "Compilation.h"

#include "Context.h"
#include "Pipelines.h"
#include "Transforms/IndexChecks.h"
#include "Transforms/KernelFunction.h"
#include "Transforms/Variant.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/TileTypes.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/LLVMIR/Transforms/Passes.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Pass/PassInstrumentation.h"
#include "mlir/Pass/PassManager.h"

#include "llvm/IR/LLVMContext.h"
#include "llvm/IR/Module.h"
#include "llvm/Support/FileSystem.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/Target/TargetMachine.h"

#include <chrono>

using namespace mlir;
using namespace warp;

//===----------------------------------------------------------------------===//
// Passes, and what failed in them
//===----------------------------------------------------------------------===//

namespace {

/// Remembers which pass failed; or, asked for one, the IR before it.
struct FailureRecorder : PassInstrumentation {
  void runBeforePass(Pass *pass, Operation *op) override {
    if (wanted.empty() || pass->getArgument() != wanted || !before.empty())
      return;
    llvm::raw_string_ostream stream(before);
    op->print(stream, OpPrintingFlags().enableDebugInfo());
  }
  void runAfterPassFailed(Pass *pass, Operation *) override {
    if (failed.empty())
      failed = pass->getArgument().str();
  }

  std::string wanted, before, failed;
};

/// The pass managers of a context; building patterns once saves milliseconds.
struct PassManagers {
  PassManagers() {
    auto create = [&](Phase phase) {
      auto pm = std::make_unique<PassManager>(&compilerContext());
      auto owned = std::make_unique<FailureRecorder>();
      recorders.push_back(owned.get());
      pm->addInstrumentation(std::move(owned));
      pm->enableVerifier(false);
      addPhase(*pm, phase);
      managers.push_back(std::move(pm));
    };
    create(Phase::Warp);
    create(Phase::Thread);
    create(Phase::Launch);
    create(Phase::Gpu);
    create(Phase::LLVM);
  }

  /// With the lock of the context held.
  static PassManagers &get() { return currentContext().passes<PassManagers>(); }

  std::vector<std::unique_ptr<PassManager>> managers;
  std::vector<FailureRecorder *> recorders;
};

} // namespace

/// True if a thread may take long: it works on tiles, whose elements are lanes,
/// or has a loop.
static bool mayTakeLong(ModuleOp module) {
  return module
      .walk([](Operation *op) {
        bool isLong =
            isa<scf::ForOp, scf::WhileOp>(op) ||
            llvm::any_of(op->getResultTypes(), llvm::IsaPred<TileType>);
        return isLong ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

double Compilation::now() {
  using namespace std::chrono;
  return duration<double, std::milli>(steady_clock::now().time_since_epoch())
      .count();
}

StringRef Compilation::dumpFolder() {
  const char *folder = getenv("WARP_DUMP");
  return folder ? folder : "";
}

/// Writes text to a new temporary file and returns its name.
static std::string saveText(StringRef text) {
  int descriptor;
  SmallString<128> path;
  if (llvm::sys::fs::createTemporaryFile("warp", "mlir", descriptor, path))
    return "";
  llvm::raw_fd_ostream(descriptor, /*shouldClose=*/true) << text;
  return path.str().str();
}

Compilation::Compilation(const Module &source, const CompileOptions &options)
    : options(options), source(source.getImpl()) {
  if (!this->source || !this->source->op)
    throw Error(Error::Kind::Compile, "the module is empty");
  if (getTarget(options).isSimt() || !options.underfilled)
    return;
  ContextLock lock;
  isBrief = !mayTakeLong(*this->source->op);
  if (isBrief)
    this->options.lanes = 1;
}

Compilation::~Compilation() {
  ContextLock lock;
  op = nullptr;
}

static thread_local const std::atomic<bool> *abandoned = nullptr;

warp::Abandonable::Abandonable(const std::atomic<bool> &flag) {
  abandoned = &flag;
}
warp::Abandonable::~Abandonable() { abandoned = nullptr; }
bool warp::isAbandoned() { return abandoned && *abandoned; }

void Compilation::time(const std::string &phase, double since) {
  code.phaseMs[phase] += now() - since;
  if (isAbandoned())
    throw Error(Error::Kind::Compile, "the process ends");
}

/// Has the kernel say what the code is for.
static LogicalResult nameVariant(ModuleOp module,
                                 const CompileOptions &options) {
  FunctionOpInterface kernel = findKernel(module);
  return success(kernel && setVariant(kernel, options));
}

/// Scalar operations beyond which large functions with several calls stay
/// calls. Lanes of a CPU take longer for calls of short functions than for copies,
/// and scalar code of a long kernel is compiled quickly first.
static constexpr int64_t gpuBudget = 3000, cpuBudget = 12000;

/// Says how long a kernel may become before functions stay calls. Checks need
/// the kernel's error record, and deterministic updates are planned for all of
/// a kernel, so these have all calls inlined.
static void setBudget(ModuleOp module, const CompileOptions &options) {
  bool inlinesAll = options.debug || options.deterministic;
  bool gpu = getTarget(options).isSimt();
  int64_t budget = gpu ? gpuBudget : cpuBudget;
  mlir::Builder b(module.getContext());
  for (auto function : module.getOps<FunctionOpInterface>()) {
    if (!function->hasAttr(kernelAttrName))
      continue;
    if (inlinesAll)
      function->removeAttr(attr::inlineBudget);
    else if (!function->hasAttr(attr::inlineBudget))
      function->setAttr(attr::inlineBudget, b.getI64IntegerAttr(budget));
    if (gpu && !inlinesAll)
      function->setAttr(attr::keepsUpdates, b.getUnitAttr());
  }
}

LogicalResult Compilation::runPasses(ModuleOp module, Phase phase) {
  if (phase == Phase::Thread && failed(nameVariant(module, options)))
    return failure();
  // Before what nobody uses is removed.
  if (phase == Phase::Warp && options.debug)
    insertIndexChecks(module);
  if (phase == Phase::Warp)
    setBudget(module, options);
  if (failed(PassManagers::get().managers[size_t(phase)]->run(module)))
    return failure();
  if (phase != Phase::Thread)
    return success();
  cost = estimateCost(module);
  for (auto kernel : module.getOps<FunctionOpInterface>())
    setSchedule(kernel,
                getSchedule(kernel).withCost(int64_t(std::min(cost, 1e12))));
  return success();
}

/// The IR before a pass that fails, had by doing everything once more.
std::string Compilation::textBefore(Phase phase, const std::string &pass) {
  Diagnostics ignored;
  OwningOpRef<ModuleOp> again = source->op->clone();
  for (int earlier = 0; earlier < int(phase); ++earlier)
    if (failed(runPasses(*again, Phase(earlier))))
      return "";
  FailureRecorder &recorder = *PassManagers::get().recorders[size_t(phase)];
  recorder.wanted = pass;
  (void)runPasses(*again, phase);
  recorder.wanted.clear();
  return std::exchange(recorder.before, "");
}

void Compilation::runPhase(Phase phase, bool isLast) {
  Diagnostics diagnostics;
  FailureRecorder &recorder = *PassManagers::get().recorders[size_t(phase)];
  recorder.failed.clear();
  bool finished = succeeded(runPasses(*op, phase));
  // To verify takes a twentieth of compiling, each time: so not after each pass
  // or phase, but once, what they leave in the end.
  if (finished && (!isLast || succeeded(verify(*op))))
    return;
  if (finished)
    throw diagnostics.toError(Error::Kind::Compile,
                              "a phase of the compiler left malformed IR");
  Error error = diagnostics.toError(Error::Kind::Compile,
                                    "a pass of the compiler failed");
  std::string pass = recorder.failed;
  // Errors with a hint are about the program, not about the compiler.
  if (pass.empty() || error.message.find("\nhint: ") != std::string::npos)
    throw error;
  std::string path = saveText(textBefore(phase, pass));
  error.message += "\n  note: in pass '" + pass + "'";
  if (!path.empty())
    error.message += "; the IR before it is in '" + path + "'";
  throw error;
}

/// Makes locations of operations known to LLVM.
static void attachLineTable(ModuleOp module, bool gpu) {
  PassManager pm(module.getContext());
  LLVM::DIScopeForLLVMFuncOpPassOptions tables;
  tables.emissionKind = gpu ? LLVM::DIEmissionKind::DebugDirectivesOnly
                            : LLVM::DIEmissionKind::LineTablesOnly;
  pm.addPass(LLVM::createDIScopeForLLVMFuncOpPass(tables));
  if (failed(pm.run(module)))
    throw Error(Error::Kind::Compile, "cannot attach source lines");
}

void Compilation::lowerTo(Phase last) {
  ContextLock lock;
  double start = now();
  if (!op) {
    op = source->op->clone();
    runPhase(Phase::Warp, last == Phase::Warp);
    time("canonicalise", start);
    dump("warp.mlir");
    if (last == Phase::Warp)
      return;
    start = now();
    runPhase(Phase::Thread, last == Phase::Thread);
    dump("thread.mlir");
  }
  if (last >= Phase::Launch) {
    runPhase(Phase::Launch, last == Phase::Launch);
    dump("launch.mlir");
  }
  if (last >= Phase::Gpu) {
    runPhase(Phase::Gpu, last == Phase::Gpu);
    dump("gpu.mlir");
  }
  if (last == Phase::LLVM) {
    runPhase(Phase::LLVM, last == Phase::LLVM);
    dump("llvm.mlir");
    if (options.lineinfo)
      attachLineTable(*op, getTarget(options).isSimt());
  }
  time("lower", start);
}

std::string Compilation::moduleText() {
  ContextLock lock;
  std::string text;
  llvm::raw_string_ostream stream(text);
  op->print(stream);
  return text;
}

void Compilation::writeStage(StringRef extension, StringRef text) {
  llvm::sys::fs::create_directories(dumpFolder());
  std::string path = (dumpFolder() + "/" + fileStem() + "." + extension).str();
  std::error_code error;
  llvm::raw_fd_ostream file(path, error);
  if (!error)
    file << text;
}

void Compilation::dump(StringRef extension) {
  if (!dumpFolder().empty())
    writeStage(extension,
               extension.ends_with("ll") ? llvmText() : moduleText());
}

std::string Compilation::fileStem() {
  Module module(source);
  std::string target = options.target;
  std::replace(target.begin(), target.end(), ':', '_');
  return module.kernelName() + "." + target + "." +
         std::to_string(options.rank) + "d";
}
