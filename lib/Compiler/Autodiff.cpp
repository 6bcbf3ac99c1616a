//===- Autodiff.cpp - Automatic differentiation of kernels ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Runs on a copy of the primal's warp IR, before anything of a launch is known
// (Pipelines.cpp has the passes):
//
//   1  inline, canonicalise; functions with a derivative of their own stay
//   2  structs become their fields, builtins without a rule those with one,
//      loads of what was just stored are forwarded
//   3  warp-differentiate-kernel builds the derivative
//   4  warp-simplify-adjoint, warp-clean-up-adjoint and canonicalisation take
//      away what is not needed
//
// The passes leave facts for the runtime in attributes of the
// kernel. It moves to the `Derivative` here, so that equal code has an equal
// fingerprint, whatever source line it comes from.
//
//===----------------------------------------------------------------------===//

#include "Context.h"
#include "Pipelines.h"
#include "SameArrays.h"
#include "Transforms/Autodiff/ApartArrays.h"
#include "Transforms/Autodiff/Derivation.h"
#include "Transforms/Autodiff/Recording.h"

#include "warp/Autodiff.h"
#include "warp/Compile.h"

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpAttributes.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/Verifier.h"
#include "mlir/Pass/PassManager.h"

#include "llvm/Support/raw_ostream.h"

using namespace mlir;
using warp::AutodiffOptions;
using warp::Derivative;
using warp::Error;
using warp::HiddenArgument;

//===----------------------------------------------------------------------===//
// The pipeline
//===----------------------------------------------------------------------===//

namespace {

/// Passes without options of a derivative. A context keeps them: to build a
/// canonicalizer's patterns takes longer than to run it.
struct Stages {
  Stages() {
    warp::addInlining(inlining);
    warp::addPreparation(prepare);
    warp::addTidying(tidy);
    for (PassManager *stage : {&inlining, &prepare, &tidy})
      stage->enableVerifier(false);
  }

  static Stages &get() { return warp::currentContext().passes<Stages>(); }

  PassManager inlining{&warp::compilerContext()};
  PassManager prepare{&warp::compilerContext()};
  PassManager tidy{&warp::compilerContext()};
};

} // namespace

/// The facts about one launch stand at the kernel while it is differentiated.
static void markFacts(ModuleOp module, const AutodiffOptions &options) {
  SmallVector<bool> flags(options.apart.begin(), options.apart.end());
  for (auto function : module.getOps<func::FuncOp>()) {
    if (!function->hasAttr(warp::kernelAttrName))
      continue;
    if (!flags.empty())
      function->setAttr(warp::autodiff::apartAttrName,
                        DenseBoolArrayAttr::get(module.getContext(), flags));
    if (options.unrecorded)
      function->setAttr(warp::attr::unrecorded,
                        UnitAttr::get(module.getContext()));
  }
}

LogicalResult warp::derive(ModuleOp module, const AutodiffOptions &options) {
  markFacts(module, options);
  PassManager differentiate(module.getContext());
  differentiate.enableVerifier(false);
  addDifferentiation(differentiate, options);
  Stages &stages = Stages::get();
  return success(succeeded(stages.prepare.run(module)) &&
                 succeeded(differentiate.run(module)) &&
                 succeeded(stages.tidy.run(module)));
}

/// Throws what the passes of a step reported if one of them failed.
static void check(ModuleOp module,
                  llvm::function_ref<LogicalResult(ModuleOp)> step) {
  warp::Diagnostics diagnostics;
  if (failed(step(module)) || failed(verify(module)))
    throw diagnostics.toError(Error::Kind::Compile,
                              "the kernel cannot be differentiated");
}

/// Inlines what is called, and makes sure that the result is legal.
static void finish(ModuleOp module) {
  check(module, [](ModuleOp module) {
    PassManager verifier(module.getContext());
    verifier.enableVerifier(false);
    warp::addVerification(verifier);
    return success(succeeded(Stages::get().inlining.run(module)) &&
                   succeeded(verifier.run(module)));
  });
}

//===----------------------------------------------------------------------===//
// Facts of the passes
//===----------------------------------------------------------------------===//

static std::vector<std::string> readLines(Attribute attribute) {
  std::vector<std::string> lines;
  if (auto array = dyn_cast_or_null<ArrayAttr>(attribute))
    for (auto line : array.getAsRange<StringAttr>())
      lines.push_back(line.str());
  return lines;
}

/// The kinds of the attribute and of the interface are the same list.
static_assert(int(warp::HiddenKind::Preserved) ==
                  int(HiddenArgument::Kind::Preserved) &&
              int(warp::HiddenKind::Tape) == int(HiddenArgument::Kind::Tape) &&
              warp::getMaxEnumValForHiddenKind() ==
                  int(HiddenArgument::Kind::Tape));

static HiddenArgument readHidden(warp::HiddenAttr entry, mlir::Type type) {
  HiddenArgument hidden;
  hidden.kind = static_cast<HiddenArgument::Kind>(entry.getKind());
  hidden.leaf = static_cast<int>(entry.getLeaf());
  hidden.direction = static_cast<int>(entry.getDirection());
  hidden.places = readLines(entry.getPlaces());
  llvm::raw_string_ostream(hidden.type) << type;
  return hidden;
}

static std::vector<HiddenArgument> takeHidden(func::FuncOp kernel) {
  std::vector<HiddenArgument> hidden;
  Attribute taken = kernel->removeAttr(warp::attr::hidden);
  if (auto list = dyn_cast_or_null<ArrayAttr>(taken)) {
    unsigned first = kernel.getNumArguments() - list.size();
    for (auto [i, entry] : llvm::enumerate(list.getAsRange<warp::HiddenAttr>()))
      hidden.push_back(readHidden(entry, kernel.getArgumentTypes()[first + i]));
  }
  return hidden;
}

/// Takes the attributes off the kernel.
static void readFacts(func::FuncOp kernel, Derivative &derivative) {
  auto take = [&](StringRef name) { return kernel->removeAttr(name); };
  derivative.hidden = takeHidden(kernel);
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
  if (auto rank = dyn_cast_or_null<IntegerAttr>(take(warp::attr::maxRank)))
    derivative.metrics["launch_dimensions"] = rank.getInt();
}

/// Parts the function with a mark, if there is one, from the adjoint: it is the
/// kernel of a module of its own.
static std::optional<warp::Module> takeMarked(ModuleOp module, StringRef mark) {
  func::FuncOp function = warp::findMarked(module, mark);
  if (!function)
    return std::nullopt;
  auto other = std::make_shared<warp::Module::Impl>();
  other->op = module.clone();
  func::FuncOp kernel = warp::findMarked(*other->op, mark);
  kernel->removeAttr(mark);
  kernel->removeAttr(warp::attr::maxRank);
  for (StringRef rest :
       {StringRef(warp::kernelAttrName), StringRef(warp::attr::augmented),
        StringRef(warp::attr::counting), StringRef(warp::attr::sizing),
        StringRef(warp::attr::recording)})
    if (func::FuncOp sibling = warp::findMarked(*other->op, rest))
      sibling.erase();
  kernel->setAttr(warp::kernelAttrName, UnitAttr::get(module.getContext()));
  function.erase();
  finish(*other->op);
  warp::unmarkKeptDerivatives(*other->op);
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
  if (!options.apart.empty() && options.apart.size() != count)
    throw Error(Error::Kind::Value,
                "expects " + std::to_string(count) +
                    " flags of arrays read and written in different places, "
                    "but got " +
                    std::to_string(options.apart.size()));
  if (!options.same.empty() && options.same.size() != count)
    throw Error(Error::Kind::Value, "expects " + std::to_string(count) +
                                        " numbers of arrays to use, but got " +
                                        std::to_string(options.same.size()));
  for (int one : options.same)
    if (one < 0 || size_t(one) >= count || options.same[size_t(one)] != one)
      throw Error(Error::Kind::Value,
                  "expects numbers of arrays that are used for themselves, but "
                  "got " +
                      std::to_string(one));
  if (options.width < 1)
    throw Error(Error::Kind::Value,
                "expects tangents along at least one direction, but got " +
                    std::to_string(options.width));
  StringRef policy = options.singular;
  if (policy != "pinned" && policy != "strict" && policy != "report" &&
      policy != "repeated")
    throw Error(Error::Kind::Value, "expects 'pinned', 'strict', 'report' or "
                                    "'repeated' at singular points, but got '" +
                                        options.singular + "'");
  if (options.tape != "checkpoints" && options.tape != "global")
    throw Error(Error::Kind::Value, "expects the tape 'checkpoints' or "
                                    "'global', but got '" +
                                        options.tape + "'");
  return options;
}

/// Has messages of all that becomes of a kernel name what the user wrote.
static void nameAfterItself(func::FuncOp kernel) {
  if (!kernel->hasAttr(warp::attr::primal))
    kernel->setAttr(warp::attr::primal, kernel.getSymNameAttr());
}

Derivative warp::differentiate(const Module &module,
                               const AutodiffOptions &given) {
  ContextLock lock;
  AutodiffOptions options = complete(module, given);
  auto copy = std::make_shared<Module::Impl>();
  copy->op = module.getImpl()->op->clone();
  nameAfterItself(findMarked(*copy->op, kernelAttrName));
  if (!options.same.empty())
    check(*copy->op, [&](ModuleOp module) {
      return joinSameArrays(findMarked(module, kernelAttrName), options.same);
    });
  markKeptDerivatives(*copy->op);
  check(*copy->op, [&](ModuleOp module) {
    PassManager resolve(module.getContext());
    resolve.enableVerifier(false);
    addResolution(resolve, options);
    return resolve.run(module);
  });
  autodiff::callBodies(*copy->op);
  autodiff::keepCalls(*copy->op, true);
  check(*copy->op, [&](ModuleOp module) { return derive(module, options); });
  autodiff::keepCalls(*copy->op, false);
  Derivative derivative{Module(copy)};
  func::FuncOp kernel = findMarked(*copy->op, kernelAttrName);
  readFacts(kernel, derivative);
  StringRef suffix = options.forward ? "_tangent" : "_adjoint";
  if (!kernel.getSymName().ends_with(suffix))
    kernel.setSymName((kernel.getSymName() + suffix).str());
  if (func::FuncOp counting = findMarked(*copy->op, attr::counting))
    derivative.hiddenOfCounting = takeHidden(counting);
  if (func::FuncOp recording = findMarked(*copy->op, attr::recording))
    derivative.hiddenOfRecording = takeHidden(recording);
  if (func::FuncOp sizing = findMarked(*copy->op, attr::sizing))
    derivative.hiddenOfSizing = takeHidden(sizing);
  derivative.counting = takeMarked(*copy->op, attr::counting);
  derivative.sizing = takeMarked(*copy->op, attr::sizing);
  derivative.recording = takeMarked(*copy->op, attr::recording);
  derivative.augmented = takeMarked(*copy->op, attr::augmented);
  finish(*copy->op);
  unmarkKeptDerivatives(*copy->op);
  return derivative;
}
