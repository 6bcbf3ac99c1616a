//===- Codegen.cpp - CPU code generation and library linking --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code is for the processor that compiles it: "cpu" means the host, and
// "cpu:skylake-avx512" another one, which tests use. Short functions of the
// device library are linked in and inlined, so that the loop vectoriser meets
// arithmetic where the kernel called `sin`; long ones are called
// (LibraryObject.h).
//
//===----------------------------------------------------------------------===//

#include "Cpu.h"
#include "LibraryObject.h"

#include "Compiler/Target.h"
#include "Support/Embedded.h"
#include "WarpDialect/LibraryOps.h"

#include "llvm/IR/Module.h"
#include "llvm/MC/TargetRegistry.h"
#include "llvm/Support/TargetSelect.h"
#include "llvm/Target/TargetMachine.h"
#include "llvm/TargetParser/Host.h"
#include "llvm/TargetParser/SubtargetFeature.h"

WARP_EMBEDDED(devicelib_cpu)

using namespace warp;

// The back end of the processors that the library is built for.
#ifdef __aarch64__
#define WARP_BACKEND(part) LLVMInitializeAArch64##part
static constexpr char triple[] = "aarch64-unknown-linux-gnu";
#else
#define WARP_BACKEND(part) LLVMInitializeX86##part
static constexpr char triple[] = "x86_64-unknown-linux-gnu";
#endif

namespace {
struct Processor {
  std::string name, features;
};
} // namespace

static Processor findHost() {
  Processor host;
  host.name = llvm::sys::getHostCPUName().str();
  llvm::SubtargetFeatures list;
  llvm::StringMap<bool> found = llvm::sys::getHostCPUFeatures();
  for (auto &feature : found)
    list.AddFeature(feature.first(), feature.second);
  host.features = list.getString();
  return host;
}

static Processor findProcessor(llvm::StringRef name) {
  static const Processor host = findHost();
  if (!name.consume_front("cpu:"))
    return host;
  return {name.str(), ""};
}

std::string CpuTarget::describeProcessor() const {
  Processor processor = findProcessor(getName());
  return processor.name + " " + processor.features;
}

std::unique_ptr<llvm::TargetMachine>
CpuTarget::createMachine(const CompileOptions &options) const {
  static const llvm::Target *target = [] {
    WARP_BACKEND(TargetInfo)();
    WARP_BACKEND(Target)();
    WARP_BACKEND(TargetMC)();
    WARP_BACKEND(AsmPrinter)();
    std::string error;
    return llvm::TargetRegistry::lookupTarget(llvm::Triple(triple), error);
  }();
  Processor processor = findProcessor(getName());
  llvm::TargetOptions settings;
  auto level = options.optLevel == 0   ? llvm::CodeGenOptLevel::None
               : options.optLevel == 1 ? llvm::CodeGenOptLevel::Less
                                       : llvm::CodeGenOptLevel::Default;
  return std::unique_ptr<llvm::TargetMachine>(target->createTargetMachine(
      llvm::Triple(triple), processor.name, processor.features, settings,
      llvm::Reloc::PIC_, llvm::CodeModel::Small, level, /*JIT=*/true));
}

bool CpuTarget::returnsOnX87() const { return llvm::Triple(triple).isX86(); }

static bool isMissing(const llvm::Function &function) {
  return function.isDeclaration() && !function.isIntrinsic();
}

/// True if the device library has it as machine code.
static bool isLong(const llvm::Function &function) {
  return isMissing(function) && findLibraryFunction(function.getName());
}

/// Asks for the code that fits the processor.
static void nameLibraryFunctions(llvm::Module &module,
                                 const llvm::TargetMachine &machine) {
  llvm::StringRef level = libraryLevel(*machine.getMCSubtargetInfo());
  for (llvm::Function &function : module)
    if (isLong(function))
      function.setName(function.getName() + "." + level);
}

void CpuTarget::prepareModule(llvm::Module &module,
                              llvm::TargetMachine &machine,
                              const CompileOptions &options) const {
  module.setTargetTriple(machine.getTargetTriple());
  module.setDataLayout(machine.createDataLayout());
  bool missesShort = llvm::any_of(module, [](const llvm::Function &function) {
    return isMissing(function) && !isLong(function);
  });
  if (missesShort)
    linkBitcode(module, devicelib_cpu, "device library");
  linkNativeCode(module);
  nameLibraryFunctions(module, machine);
  bool wide = getVectorBits() == 512;
  for (llvm::Function &function : module) {
    if (function.isDeclaration())
      continue;
    function.removeFnAttr("target-cpu");
    function.removeFnAttr("target-features");
    function.removeFnAttr("tune-cpu");
    function.removeFnAttr("min-legal-vector-width");
    function.addFnAttr(llvm::Attribute::NoUnwind);
    if (wide)
      function.addFnAttr("prefer-vector-width", "512");
  }
}
