//===- Autodiff.cpp - From a kernel to its derivative ---------------------===//
//
// Runs on a copy of the primal's warp IR, before anything of a launch is known:
//
//   1  inline, canonicalise; functions with a derivative of their own stay
//   2  structs become their fields, builtins without a rule those with one,
//      loads of what was just stored are forwarded
//   3  warp-differentiate-kernel builds the derivative
//   4  warp-simplify-adjoint, warp-clean-up-adjoint and canonicalisation take
//      away what is not needed
//
// What the passes have to say to the runtime they leave in attributes of the
// kernel. It moves to the `Derivative` here, so that equal code has an equal
// fingerprint, whatever source line it comes from.
//
//===----------------------------------------------------------------------===//

#include "Context.h"
#include "Derivation.h"
#include "Pipelines.h"

#include "warp/Autodiff.h"
#include "warp/Compile.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Pass/PassManager.h"
#include "mlir/Transforms/Passes.h"

#include "llvm/ADT/StringSwitch.h"
#include "llvm/Support/raw_ostream.h"

using namespace mlir;
using warp::AutodiffOptions;
using warp::Derivative;
using warp::Error;
using warp::HiddenArgument;

//===----------------------------------------------------------------------===//
// The pipeline
//===----------------------------------------------------------------------===//

static void addInlining(OpPassManager &pm) {
  pm.addPass(createInlinerPass({}, [](OpPassManager &) {}));
  pm.addPass(createSymbolDCEPass());
  pm.addPass(warp::createWarpCanonicalizer());
  pm.addPass(createCSEPass());
}

static std::string activeFlags(const AutodiffOptions &options) {
  std::string text;
  for (bool flag : options.active)
    text += flag ? '1' : '0';
  return text;
}

void warp::addDerivation(OpPassManager &pm, const AutodiffOptions &options) {
  DifferentiateKernelOptions derivation;
  derivation.mode = options.forward ? "forward" : "reverse";
  derivation.active = activeFlags(options);
  derivation.singular = options.singular;
  derivation.unique = options.unique;
  derivation.maxLocalTape = options.maxLocalTape;
  addInlining(pm);
  pm.addPass(createFlattenStructs());
  pm.addPass(createExpandBuiltins());
  pm.addPass(createWarpCanonicalizer());
  pm.addPass(createCSEPass());
  pm.addPass(createForwardStores());
  pm.addPass(createDifferentiateKernel(derivation));
  pm.addPass(createInlinePullbacks({activeFlags(options)}));
  pm.addPass(createWarpCanonicalizer());
  pm.addPass(createCSEPass());
  pm.addPass(createLoopInvariantCodeMotionPass());
  pm.addPass(createSimplifyAdjoint());
  pm.addPass(createWarpCanonicalizer());
  pm.addPass(createCSEPass());
  pm.addPass(createCleanUpAdjoint());
}

/// Functions with a derivative of their own stay calls until that is built.
void warp::keepCalls(ModuleOp module, bool keep) {
  for (auto function : module.getOps<func::FuncOp>()) {
    if (!function->hasAttr(warp::attr::vjp) &&
        !function->hasAttr(warp::attr::replay))
      continue;
    if (keep)
      function.setNoInline(true);
    else
      function.removeNoInlineAttr();
  }
}

static void run(ModuleOp module,
                llvm::function_ref<void(OpPassManager &)> addPasses) {
  warp::Diagnostics diagnostics;
  PassManager pm(module.getContext());
  pm.enableVerifier(false);
  addPasses(pm);
  if (failed(pm.run(module)) || failed(verify(module)))
    throw diagnostics.toError(Error::Kind::Compile,
                              "the kernel cannot be differentiated");
}

//===----------------------------------------------------------------------===//
// What the passes said
//===----------------------------------------------------------------------===//

static func::FuncOp findMarked(ModuleOp module, StringRef attribute) {
  for (auto function : module.getOps<func::FuncOp>())
    if (function->hasAttr(attribute))
      return function;
  return nullptr;
}

static std::vector<std::string> readLines(Attribute attribute) {
  std::vector<std::string> lines;
  if (auto array = dyn_cast_or_null<ArrayAttr>(attribute))
    for (auto line : array.getAsRange<StringAttr>())
      lines.push_back(line.str());
  return lines;
}

static HiddenArgument readHidden(DictionaryAttr entry, mlir::Type type) {
  using Kind = HiddenArgument::Kind;
  HiddenArgument hidden;
  auto kind = entry.getAs<StringAttr>("kind");
  hidden.kind = llvm::StringSwitch<Kind>(kind ? kind.getValue() : "")
                    .Case("saved", Kind::Saved)
                    .Case("counters", Kind::Counters)
                    .Case("tangent", Kind::Tangent)
                    .Default(Kind::Preserved);
  if (auto leaf = entry.getAs<IntegerAttr>("leaf"))
    hidden.leaf = static_cast<int>(leaf.getInt());
  if (auto count = entry.getAs<IntegerAttr>("per_thread"))
    hidden.perThread = count.getInt();
  hidden.places = readLines(entry.get("places"));
  llvm::raw_string_ostream(hidden.type) << type;
  return hidden;
}

/// Takes the attributes off the kernel.
static void readFacts(func::FuncOp kernel, Derivative &derivative) {
  auto take = [&](StringRef name) { return kernel->removeAttr(name); };
  if (auto list = dyn_cast_or_null<ArrayAttr>(take(warp::attr::hidden))) {
    unsigned first = kernel.getNumArguments() - list.size();
    for (auto [i, entry] : llvm::enumerate(list.getAsRange<DictionaryAttr>()))
      derivative.hidden.push_back(
          readHidden(entry, kernel.getArgumentTypes()[first + i]));
  }
  if (auto list = dyn_cast_or_null<ArrayAttr>(take(warp::attr::needed)))
    for (auto leaf : list.getAsRange<IntegerAttr>())
      derivative.needed.push_back(static_cast<int>(leaf.getInt()));
  if (Attribute reason = take(warp::attr::oneThread)) {
    auto text = dyn_cast<StringAttr>(reason);
    derivative.oneThread = text ? text.str() : "threads would meet";
  }
  derivative.notices = readLines(take(warp::attr::notices));
  if (auto numbers =
          dyn_cast_or_null<DictionaryAttr>(take(warp::attr::metrics)))
    for (NamedAttribute entry : numbers)
      if (auto number = dyn_cast<IntegerAttr>(entry.getValue()))
        derivative.metrics[entry.getName().str()] = number.getInt();
}

/// Parts the augmented primal, if there is one, from the adjoint.
static std::optional<warp::Module> takeAugmented(ModuleOp module) {
  if (!findMarked(module, warp::attr::augmented))
    return std::nullopt;
  auto other = std::make_shared<warp::Module::Impl>();
  other->op = module.clone();
  findMarked(*other->op, warp::kernelAttrName).erase();
  func::FuncOp primal = findMarked(*other->op, warp::attr::augmented);
  primal->removeAttr(warp::attr::augmented);
  primal->setAttr(warp::kernelAttrName, UnitAttr::get(module.getContext()));
  findMarked(module, warp::attr::augmented).erase();
  run(*other->op, addInlining);
  return warp::Module(std::move(other));
}

/// Checks options, and says of every array whether it is active.
static AutodiffOptions complete(const warp::Module &module,
                                AutodiffOptions options) {
  if (!module.getImpl() || !module.getImpl()->op)
    throw Error(Error::Kind::Compile, "the module is empty");
  size_t count = 0;
  for (const warp::Param &param : warp::parameters(module))
    count += param.arrays.size();
  if (options.active.empty())
    options.active.assign(count, true);
  if (options.active.size() != count)
    throw Error(Error::Kind::Value,
                "expects " + std::to_string(count) +
                    " flags for the arrays of the kernel, but got " +
                    std::to_string(options.active.size()));
  StringRef policy = options.singular;
  if (policy != "pinned" && policy != "strict" && policy != "report")
    throw Error(Error::Kind::Value, "expects 'pinned', 'strict' or 'report' at "
                                    "singular points, but got '" +
                                        options.singular + "'");
  return options;
}

Derivative warp::differentiate(const Module &module,
                               const AutodiffOptions &given) {
  ContextLock lock;
  AutodiffOptions options = complete(module, given);
  auto copy = std::make_shared<Module::Impl>();
  copy->op = module.getImpl()->op->clone();
  run(*copy->op, [&](OpPassManager &pm) {
    pm.addPass(createResolveDerivatives(
        {/*keepDerivatives=*/true, options.singular}));
  });
  // A derivative that a function has of its own is one in reverse mode.
  keepCalls(*copy->op, !options.forward);
  run(*copy->op, [&](OpPassManager &pm) { addDerivation(pm, options); });
  keepCalls(*copy->op, false);
  Derivative derivative{Module(copy), std::nullopt, {}, {}, {}, {}, {}};
  func::FuncOp kernel = findMarked(*copy->op, kernelAttrName);
  readFacts(kernel, derivative);
  StringRef suffix = options.forward ? "_tangent" : "_adjoint";
  if (!kernel.getSymName().ends_with(suffix))
    kernel.setSymName((kernel.getSymName() + suffix).str());
  derivative.augmented = takeAugmented(*copy->op);
  run(*copy->op, [](OpPassManager &pm) {
    addInlining(pm);
    pm.addPass(createVerifyWarp());
  });
  return derivative;
}
