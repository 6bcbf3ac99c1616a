//===- Generate.cpp - Code generation from the LLVM dialect ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The second half of a compilation: what the lowered module says about the code
// is collected, it becomes LLVM IR, and that an object file or PTX. But for the
// first step this needs no lock: the LLVM context is its own.
//
//===----------------------------------------------------------------------===//

#include "Compilation.h"

#include "Targets/Nvidia/AssembledLibrary.h"
#include "Targets/Target.h"
#include "Transforms/Choices.h"
#include "Transforms/Emit/LowerLibraryCalls.h"
#include "Transforms/KernelFunction.h"
#include "Transforms/Tiles/TensorMapAttributes.h"
#include "Transforms/Variant.h"

#include "warp/FirstCode.h"
#include "warp/NativeCode.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Target/LLVMIR/Export.h"

#include "llvm/IR/DiagnosticInfo.h"
#include "llvm/IR/DiagnosticPrinter.h"
#include "llvm/IR/InstIterator.h"
#include "llvm/IR/LLVMContext.h"
#include "llvm/IR/Module.h"
#include "llvm/IR/Operator.h"
#include "llvm/IR/Verifier.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/Target/TargetMachine.h"
#include "llvm/Transforms/Utils/Cloning.h"

using namespace mlir;
using namespace warp;

void Compilation::translate() {
  ContextLock lock;
  double start = now();
  collectFacts(*op);
  Diagnostics diagnostics;
  llvmContext = std::make_unique<llvm::LLVMContext>();
  // The default handler ends the process on an error.
  llvmContext->setDiagnosticHandlerCallBack(
      [](const llvm::DiagnosticInfo *info, void *errors) {
        if (info->getSeverity() != llvm::DS_Error)
          return;
        llvm::raw_string_ostream stream(*static_cast<std::string *>(errors));
        llvm::DiagnosticPrinterRawOStream printer(stream);
        info->print(printer);
      },
      &llvmErrors);
  llvmModule = translateModuleToLLVMIR(*op, *llvmContext, code.entry);
  if (!llvmModule)
    throw diagnostics.toError(Error::Kind::Compile,
                              "cannot translate the kernel to LLVM IR");
  std::string malformed;
  llvm::raw_string_ostream stream(malformed);
  if (llvm::verifyModule(*llvmModule, &stream))
    throw Error(Error::Kind::Compile,
                "the kernel's LLVM IR is malformed: " + malformed);
  code.schedule.isExact = hasExactFloats();
  time("translate", start);
}

/// True if a function has an operation of that kind.
static bool contains(LLVM::LLVMFuncOp function,
                     function_ref<bool(Operation *)> isOne) {
  return function
      .walk([&](Operation *op) {
        return isOne(op) ? WalkResult::interrupt() : WalkResult::advance();
      })
      .wasInterrupted();
}

/// Operations of code that takes long to compile well, hundreds of
/// milliseconds.
static constexpr int longCode = 4000;

/// The facts that only the finished function shows.
static void readCodeFacts(LLVM::LLVMFuncOp function, const TargetInfo &target,
                          Schedule &schedule) {
  schedule.atomics =
      contains(function, llvm::IsaPred<LLVM::AtomicRMWOp, LLVM::AtomicCmpXchgOp>);
  int left = longCode;
  for (auto one :
       function->getParentOfType<ModuleOp>().getOps<LLVM::LLVMFuncOp>())
    schedule.isLong |= (one == function || one->hasAttr(attr::kept)) &&
                       contains(one, [&](Operation *) { return --left == 0; });
  schedule.cooperative = function->hasAttr(attr::blockThreads);
  schedule.ragged = function->hasAttr(attr::ragged);
  schedule.fixedBlock =
      schedule.cooperative || contains(function, [&](Operation *op) {
        return target.isBlockBarrier(op);
      });
  schedule.dynamicBytes = target.isSimt() ? int(getDynamicBytes(function)) : 0;
  if (auto list = function->getAttrOfType<ArrayAttr>(attr::tensorMaps))
    for (auto map : list.getAsRange<DenseI64ArrayAttr>())
      schedule.tensorMaps.push_back(
          {map[0], map[1], map[2], map[3], map[4], map[5]});
}

static std::vector<Site> readSites(LLVM::LLVMFuncOp function) {
  std::vector<Site> sites;
  auto table = function->getAttrOfType<ArrayAttr>(attr::sites);
  if (!table)
    return sites;
  auto primal = function->getAttrOfType<StringAttr>(attr::primal);
  std::string kernel = primal ? primal.str() : function.getName().str();
  for (auto site : table.getAsRange<ArrayAttr>())
    sites.push_back({kernel, cast<StringAttr>(site[0]).str(),
                     cast<StringAttr>(site[3]).str(),
                     int(cast<IntegerAttr>(site[1]).getInt()),
                     int(cast<IntegerAttr>(site[2]).getInt())});
  return sites;
}

/// Reads off the LLVM dialect's module how it is to be launched.
void Compilation::collectFacts(ModuleOp module) {
  bool usesPrintf = false;
  for (auto function : module.getOps<LLVM::LLVMFuncOp>()) {
    usesPrintf |=
        function.getName() == "warp_printf" || function.getName() == "vprintf";
    if (!function->hasAttr(attr::entry))
      continue;
    code.entry = function.getName().str();
    code.sites = readSites(function);
    code.schedule = readSchedule(getSchedule(function));
    // Not rounded, and without what one pass bounds it by.
    code.schedule.cost = cost;
    if (isBrief)
      code.schedule.sizeFacts |= underfilledFact;
    readCodeFacts(function, getTarget(options), code.schedule);
    choices = readChoices(function);
    auto number = [&](StringRef name) {
      auto value = function->getAttrOfType<IntegerAttr>(name);
      return value ? int(value.getInt()) : 0;
    };
    leastBlocks = number(attr::leastBlocks);
    mostRegisters = number(attr::mostRegisters);
  }
  code.schedule.usesPrintf = usesPrintf;
}

bool Compilation::hasExactFloats() const {
  if (getTarget(options).isSimt())
    return false;
  for (llvm::Function &function : *llvmModule)
    for (llvm::Instruction &instruction : llvm::instructions(function))
      if (isa<llvm::FPMathOperator>(instruction) &&
          instruction.getFastMathFlags().any())
        return false;
  return true;
}

bool Compilation::callsAssembled() const {
  return warp::callsAssembled(*llvmModule, options.target);
}

void Compilation::compileQuickly() { options = quickOptions(options); }

void Compilation::optimizeModule() {
  double start = now();
  machine.emplace(MachineLease::get(options));
  const TargetInfo &target = getTarget(options);
  target.prepareModule(*llvmModule, **machine, options);
  // The user's limits come first. Code that is linked has other registers.
  if (options.minBlocks == 0 && options.maxRegisters == 0 && !options.linked)
    target.limitRegisters(*llvmModule->getFunction(code.entry), leastBlocks,
                          mostRegisters);
  time("libraries", start);
  dump("input.ll");
  start = now();
  optimize(*llvmModule, **machine, options, code.schedule.lanes > 1,
           isBrief);
  time("optimise", start);
  dump("ll");
}

SmallVector<char, 0> Compilation::emitCode(bool asText) {
  const TargetInfo &target = getTarget(options);
  if (!dumpFolder().empty()) {
    // Emission uses a module up.
    auto copy = llvm::CloneModule(*llvmModule);
    SmallVector<char, 0> text = emit(*copy, **machine, target, code.entry,
                                     /*asText=*/true, /*brief=*/isBrief);
    writeStage(target.getTextSuffix(), StringRef(text.data(), text.size()));
  }
  double start = now();
  SmallVector<char, 0> bytes =
      emit(*llvmModule, **machine, target, code.entry,
           asText || target.isSimt(), /*brief=*/isBrief);
  if (!llvmErrors.empty())
    throw Error(Error::Kind::Compile,
                "the code generator failed: " + llvmErrors);
  time("codegen", start);
  return bytes;
}

std::string Compilation::llvmText() {
  std::string text;
  llvm::raw_string_ostream stream(text);
  llvmModule->print(stream, nullptr);
  return text;
}
