//===- Codegen.cpp - PTX generation and library linking -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// PTX text, which the driver assembles for its GPU. libdevice is linked from
// the bytes embedded in this library; its `__nvvm_reflect` questions are
// answered here: subnormals are kept and roots and quotients are correctly
// rounded, unless fast math is on.
//
//===----------------------------------------------------------------------===//

#include "AssembledLibrary.h"
#include "Nvidia.h"
#include "Reductions.h"

#include "Compiler/Target.h"
#include "Support/Embedded.h"

#include "warp/NativeCode.h"

#include "llvm/IR/Constants.h"
#include "llvm/IR/Module.h"
#include "llvm/MC/TargetRegistry.h"
#include "llvm/Support/TargetSelect.h"
#include "llvm/Target/TargetMachine.h"

#include <optional>
#include <vector>

using namespace warp;

WARP_EMBEDDED(devicelib_cuda)
WARP_EMBEDDED(devicelib_tiles)
WARP_EMBEDDED(libdevice)

/// Bitcode that a process compiles with lives as long as it.
#define WARP_KEPT(function, packed)                                            \
  llvm::StringRef function() {                                                 \
    static const auto *bytes = new std::vector<char>(decompress(packed()));    \
    return {bytes->data(), bytes->size()};                                     \
  }
WARP_KEPT(warp::gpuLibrary, devicelib_cuda)
WARP_KEPT(warp::gpuTileLibrary, devicelib_tiles)
static WARP_KEPT(nvidiaLibrary, libdevice)
#undef WARP_KEPT

    /// The oldest PTX version that knows the architecture, but 8.0 at least,
    /// and 8.1 where pairs of floats are added.
    static const char *ptxVersion(unsigned number) {
  if (number == 103 || number > 120)
    return "+ptx88";
  if (number == 120)
    return "+ptx87";
  if (number >= 100)
    return "+ptx86";
  return number >= 90 ? "+ptx81" : "+ptx80";
}

/// Lets the entry wait, before all else, until the kernel before it on its
/// stream has ended and its writes are visible, so that a launch may start it
/// early. In the text, where nothing can come before it any more.
static void waitForPredecessor(llvm::SmallVectorImpl<char> &ptx,
                               llvm::StringRef entry) {
  llvm::StringRef text(ptx.data(), ptx.size());
  llvm::StringRef open = "\n{\n", wait = "\tgriddepcontrol.wait;\n";
  size_t begin = text.find((".entry " + entry + "(").str());
  size_t body = begin == text.npos ? begin : text.find(open, begin);
  if (body != text.npos)
    ptx.insert(ptx.begin() + body + open.size(), wait.begin(), wait.end());
}

void NvidiaTarget::finishText(llvm::SmallVectorImpl<char> &ptx,
                              llvm::StringRef entry) const {
  if (has(Feature::ProgrammaticLaunch))
    waitForPredecessor(ptx, entry);
  llvm::StringRef text(ptx.data(), ptx.size());
  if (text.contains(nativeCodePrefix)) {
    std::string whole = joinNativePtx(text.str(), getName().str());
    ptx.assign(whole.begin(), whole.end());
  }
}

void NvidiaTarget::finishModule(llvm::Module &module) const {
  useReductions(module);
}

std::unique_ptr<llvm::TargetMachine>
NvidiaTarget::createMachine(const CompileOptions &options) const {
  static const llvm::Target *target = [] {
    LLVMInitializeNVPTXTargetInfo();
    LLVMInitializeNVPTXTarget();
    LLVMInitializeNVPTXTargetMC();
    LLVMInitializeNVPTXAsmPrinter();
    std::string error;
    return llvm::TargetRegistry::lookupTarget(
        llvm::Triple("nvptx64-nvidia-cuda"), error);
  }();
  llvm::TargetOptions settings;
  auto level = options.optLevel == 0 ? llvm::CodeGenOptLevel::None
                                     : llvm::CodeGenOptLevel::Default;
  return std::unique_ptr<llvm::TargetMachine>(target->createTargetMachine(
      llvm::Triple("nvptx64-nvidia-cuda"), getName(), ptxVersion(version),
      settings, llvm::Reloc::PIC_, llvm::CodeModel::Small, level));
}

/// Tells libdevice to flush subnormals to zero, or not to.
static void setReflection(llvm::Module &module, bool flush) {
  llvm::LLVMContext &context = module.getContext();
  auto *type = llvm::Type::getInt32Ty(context);
  auto entry = [&](llvm::StringRef name, uint32_t value) {
    module.addModuleFlag(llvm::Module::Override, name,
                         llvm::ConstantInt::get(type, value));
  };
  entry("nvvm-reflect-ftz", flush);
  entry("nvvm-reflect-prec-sqrt", !flush);
}

void NvidiaTarget::prepareModule(llvm::Module &module,
                                 llvm::TargetMachine &machine,
                                 const CompileOptions &options) const {
  module.setTargetTriple(machine.getTargetTriple());
  module.setDataLayout(machine.createDataLayout());
  declareForNativeCode(module, getName().str());
  std::optional<AssembledCalls> calls;
  if (options.linked)
    calls.emplace(module, getName());
  if (llvm::any_of(module, [](const llvm::Function &function) {
        return function.isDeclaration() &&
               function.getName().starts_with("warp_tile_");
      }))
    linkBitcode(module, gpuTileLibrary, "device library");
  linkBitcode(module, gpuLibrary, "device library");
  linkBitcode(module, nvidiaLibrary, "libdevice");
  calls.reset();
  keepNativeCalls(module);
  setReflection(module, options.fastMath);
  llvm::LLVMContext &context = module.getContext();
  for (llvm::Function &function : module) {
    if (function.isDeclaration())
      continue;
    function.addFnAttr(llvm::Attribute::NoUnwind);
    if (options.fastMath)
      function.addFnAttr("denormal-fp-math-f32", "preserve-sign,preserve-sign");
    if (function.getCallingConv() != llvm::CallingConv::PTX_Kernel)
      continue;
    // Nobody writes to the parameters, so they need no copy.
    function.addParamAttr(0,
                          llvm::Attribute::get(context, "nvvm.grid_constant"));
    if (options.maxRegisters > 0)
      function.addFnAttr("nvvm.maxnreg", std::to_string(options.maxRegisters));
    if (options.minBlocks > 0)
      function.addFnAttr("nvvm.minctasm", std::to_string(options.minBlocks));
  }
}

void NvidiaTarget::limitRegisters(llvm::Function &kernel, int leastBlocks,
                                  int mostRegisters) const {
  // A target takes one of both.
  if (leastBlocks)
    kernel.addFnAttr("nvvm.minctasm", std::to_string(leastBlocks));
  else if (mostRegisters)
    kernel.addFnAttr("nvvm.maxnreg", std::to_string(mostRegisters));
}
