//===- TargetCPU.cpp - Code for x86-64 ------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Code is for the processor that compiles it: "cpu" means the host, and
// "cpu:skylake-avx512" another one, which tests use. The device library's
// functions are linked in and inlined, so that the loop vectoriser meets
// arithmetic where the kernel called `sin`. Those that exist as machine code
// for the host are called instead.
//
//===----------------------------------------------------------------------===//

#include "Target.h"

#include "Transforms/Variant.h"

#include "llvm/IR/Constants.h"
#include "llvm/IR/Module.h"
#include "llvm/MC/MCSubtargetInfo.h"
#include "llvm/MC/TargetRegistry.h"
#include "llvm/Support/TargetSelect.h"
#include "llvm/Target/TargetMachine.h"
#include "llvm/TargetParser/Host.h"
#include "llvm/TargetParser/SubtargetFeature.h"

#include "DeviceLib/host/HostFunctions.h"

extern "C" const char warp_devicelib_cpu_begin[], warp_devicelib_cpu_end[];

using namespace warp;

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

static Processor findProcessor(const CompileOptions &options) {
  static const Processor host = findHost();
  llvm::StringRef name = options.target;
  if (!name.consume_front("cpu:"))
    return host;
  return {name.str(), ""};
}

llvm::ArrayRef<HostFunction> warp::getHostFunctions() {
  static const auto chosen = [] {
    auto features = llvm::sys::getHostCPUFeatures();
    auto has = [&](std::initializer_list<llvm::StringRef> names) {
      return llvm::all_of(
          names, [&](llvm::StringRef name) { return features.lookup(name); });
    };
    llvm::ArrayRef<HostFunction> found;
    if (has({"avx2", "fma", "bmi", "bmi2", "f16c", "lzcnt", "movbe"})) {
      bool wide =
          has({"avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"});
      found = wide ? warp_host_functions_v4 : warp_host_functions_v3;
    }
    return found;
  }();
  return chosen;
}

std::string warp::getHostName(const HostFunction &function) {
  return std::string("host.") + function.name;
}

std::string warp::describeCpu(const CompileOptions &options) {
  Processor processor = findProcessor(options);
  return processor.name + " " + processor.features;
}

std::unique_ptr<llvm::TargetMachine>
warp::createCpuMachine(const CompileOptions &options) {
  static const llvm::Target *target = [] {
    LLVMInitializeX86TargetInfo();
    LLVMInitializeX86Target();
    LLVMInitializeX86TargetMC();
    LLVMInitializeX86AsmPrinter();
    std::string error;
    return llvm::TargetRegistry::lookupTarget(
        llvm::Triple("x86_64-unknown-linux-gnu"), error);
  }();
  Processor processor = findProcessor(options);
  llvm::TargetOptions settings;
  auto level = options.optLevel == 0   ? llvm::CodeGenOptLevel::None
               : options.optLevel == 1 ? llvm::CodeGenOptLevel::Less
                                       : llvm::CodeGenOptLevel::Default;
  return std::unique_ptr<llvm::TargetMachine>(target->createTargetMachine(
      llvm::Triple("x86_64-unknown-linux-gnu"), processor.name,
      processor.features, settings, llvm::Reloc::PIC_, llvm::CodeModel::Small,
      level, /*JIT=*/true));
}

void warp::prepareCpuModule(llvm::Module &module, llvm::TargetMachine &machine,
                            const CompileOptions &options) {
  module.setTargetTriple(machine.getTargetTriple());
  module.setDataLayout(machine.createDataLayout());
  if (options.target == "cpu" && options.optLevel > 0)
    for (const HostFunction &built : getHostFunctions())
      if (llvm::Function *called = module.getFunction(built.name))
        called->setName(getHostName(built));
  linkBitcode(module,
              {warp_devicelib_cpu_begin,
               size_t(warp_devicelib_cpu_end - warp_devicelib_cpu_begin)},
              "device library");
  linkNativeCode(module);
  if (auto *wide = module.getNamedGlobal("warp_wide_registers")) {
    bool has = machine.getMCSubtargetInfo()->checkFeatures("+avx512f");
    wide->setInitializer(llvm::ConstantInt::get(wide->getValueType(), has));
    wide->setLinkage(llvm::GlobalValue::InternalLinkage);
  }
  bool wide = getVectorBits(options.target) == 512;
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
