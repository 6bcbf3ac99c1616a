//===- Llvm.cpp - Stand-ins for parts of LLVM: a smaller library ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// LLVM's tables of file formats, of pass names and of code generators refer to
// parts that no code of ours reaches: other object files than ELF, links for
// other processors, debug information for Windows, profiles, patterns in PDL. A
// definition here takes the place of the archive's member, so that the linker
// leaves the member out (2.2 MB of libwarp.so). Each fails the way LLVM does
// for an input that it does not know. A symbol that a member is needed for all
// the same is an error of the link: it is then defined twice.
//
//===----------------------------------------------------------------------===//

#include "llvm/Analysis/InlineAdvisor.h"
#include "llvm/CodeGen/Passes.h"
#include "llvm/ExecutionEngine/JITLink/JITLink.h"
#include "llvm/InitializePasses.h"
#include "llvm/MC/MCAsmBackend.h"
#include "llvm/MC/MCCodeEmitter.h"
#include "llvm/MC/MCGOFFObjectWriter.h"
#include "llvm/MC/MCObjectWriter.h"
#include "llvm/MC/MCSPIRVObjectWriter.h"
#include "llvm/MC/MCStreamer.h"
#include "llvm/MC/MCWasmObjectWriter.h"
#include "llvm/MC/MCXCOFFObjectWriter.h"
#include "llvm/Object/ObjectFile.h"
#include "llvm/Object/Wasm.h"

using namespace llvm;

[[noreturn]] static void unreachable() {
  report_fatal_error("a part of LLVM that libwarp.so is built without");
}

static Error unknownFormat() {
  return createStringError("a format of object files that libwarp.so is built "
                           "without");
}

//===----------------------------------------------------------------------===//
// Object files
//===----------------------------------------------------------------------===//

namespace llvm::object {
Expected<std::unique_ptr<WasmObjectFile>>
ObjectFile::createWasmObjectFile(MemoryBufferRef) {
  return unknownFormat();
}
} // namespace llvm::object

//===----------------------------------------------------------------------===//
// Links in memory
//===----------------------------------------------------------------------===//

namespace llvm::jitlink {
#define WARP_NO_LINK(format)                                                   \
  Expected<std::unique_ptr<LinkGraph>> createLinkGraphFrom##format(            \
      MemoryBufferRef, std::shared_ptr<orc::SymbolStringPool>) {               \
    return unknownFormat();                                                    \
  }
#define WARP_NO_LINKER(format)                                                 \
  void link_##format(std::unique_ptr<LinkGraph>,                               \
                     std::unique_ptr<JITLinkContext> context) {                \
    context->notifyFailed(unknownFormat());                                    \
  }
WARP_NO_LINK(COFFObject)
WARP_NO_LINK(MachOObject)
WARP_NO_LINK(XCOFFObject)
WARP_NO_LINKER(COFF)
WARP_NO_LINKER(MachO)
WARP_NO_LINKER(XCOFF)
#define WARP_NO_PROCESSOR(name)                                                \
  WARP_NO_LINK(ELFObject_##name)                                               \
  WARP_NO_LINKER(ELF_##name)
#ifndef __aarch64__
WARP_NO_PROCESSOR(aarch64)
#endif
#ifndef __x86_64__
WARP_NO_PROCESSOR(x86_64)
#endif
WARP_NO_PROCESSOR(aarch32)
WARP_NO_PROCESSOR(loongarch)
WARP_NO_PROCESSOR(ppc64)
WARP_NO_PROCESSOR(ppc64le)
WARP_NO_PROCESSOR(riscv)
WARP_NO_PROCESSOR(systemz)
WARP_NO_PROCESSOR(x86)
} // namespace llvm::jitlink

//===----------------------------------------------------------------------===//
// Machine code
//===----------------------------------------------------------------------===//

namespace llvm {
#define WARP_NO_WRITER(format)                                                 \
  std::unique_ptr<MCObjectWriter> create##format##ObjectWriter(                \
      std::unique_ptr<MC##format##ObjectTargetWriter>, raw_pwrite_stream &) {  \
    unreachable();                                                             \
  }
WARP_NO_WRITER(GOFF)
WARP_NO_WRITER(SPIRV)
WARP_NO_WRITER(Wasm)
WARP_NO_WRITER(XCOFF)
std::unique_ptr<MCObjectWriter>
createWasmDwoObjectWriter(std::unique_ptr<MCWasmObjectTargetWriter>,
                          raw_pwrite_stream &, raw_pwrite_stream &) {
  unreachable();
}
#define WARP_NO_STREAMER(format, ...)                                          \
  MCStreamer *create##format##Streamer(                                        \
      MCContext &, std::unique_ptr<MCAsmBackend> &&,                           \
      std::unique_ptr<MCObjectWriter> &&,                                      \
      std::unique_ptr<MCCodeEmitter> &&__VA_OPT__(, ) __VA_ARGS__) {           \
    unreachable();                                                             \
  }
WARP_NO_STREAMER(DXContainer)
WARP_NO_STREAMER(GOFF)
WARP_NO_STREAMER(MachO, bool, bool)
WARP_NO_STREAMER(SPIRV)
WARP_NO_STREAMER(Wasm)

//===----------------------------------------------------------------------===//
// Profiles, learned inlining and scheduling of loops for other processors
//===----------------------------------------------------------------------===//

std::unique_ptr<InlineAdvisor>
getReleaseModeAdvisor(Module &, ModuleAnalysisManager &,
                      std::function<bool(CallBase &)>) {
  return nullptr;
}
void initializeMIRProfileLoaderPassPass(PassRegistry &) {}
FunctionPass *createMIRProfileLoaderPass(std::string, std::string,
                                         sampleprof::FSDiscriminatorPass,
                                         IntrusiveRefCntPtr<vfs::FileSystem>) {
  unreachable();
}
// The back end of aarch64 has it among its passes.
#ifndef __aarch64__
void initializeMachinePipelinerPass(PassRegistry &) {}
#endif
} // namespace llvm

//===----------------------------------------------------------------------===//
// Classes of headers that LLVM does not install
//===----------------------------------------------------------------------===//

#define WARP_NO_SYMBOL(name, symbol)                                           \
  extern "C" void name() __asm__(symbol);                                      \
  extern "C" void name() { unreachable(); }

// Debug information for Windows.
WARP_NO_SYMBOL(warp_no_code_view, "_ZN4llvm13CodeViewDebugC1EPNS_10AsmPrinterE")

// The second of two pipelines that generate code for x86, and its passes'
// names.
#ifdef __x86_64__
extern "C" void warp_no_x86_names() __asm__(
    "_ZN4llvm16X86TargetMachine28registerPassBuilderCallbacksERNS_11Pass"
    "BuilderE");
extern "C" void warp_no_x86_names() {}
WARP_NO_SYMBOL(warp_no_x86_pipeline,
               "_ZN4llvm16X86TargetMachine20buildCodeGenPipelineERNS_11PassM"
               "anagerINS_6ModuleENS_15AnalysisManagerIS2_JEEEJEEERNS_17raw_"
               "pwrite_streamEPS7_NS_15CodeGenFileTypeERKNS_19CGPassBuilderO"
               "ptionEPNS_28PassInstrumentationCallbacksE")
#endif

// Patterns in PDL.
WARP_NO_SYMBOL(warp_no_pdl,
               "_ZN4mlir6detail11PDLByteCodeC1ENS_8ModuleOpEN4llvm11SmallVec"
               "torISt10unique_ptrINS_19PDLPatternConfigSetESt14default_dele"
               "teIS6_EELj6EEERKNS3_8DenseMapIPNS_9OperationEPS6_NS3_12Dense"
               "MapInfoISD_vEENS3_6detail12DenseMapPairISD_SE_EEEENS3_9Strin"
               "gMapISt8functionIFNS3_13LogicalResultERNS_15PatternRewriterE"
               "RNS_13PDLResultListENS3_8ArrayRefINS_8PDLValueEEEEENS3_15Mal"
               "locAllocatorEEES10_")
WARP_NO_SYMBOL(warp_no_pdl_benefit,
               "_ZN4mlir6detail23PDLByteCodeMutableState20updatePatternBenef"
               "itEjNS_14PatternBenefitE")
WARP_NO_SYMBOL(warp_no_pdl_cleanup,
               "_ZN4mlir6detail23PDLByteCodeMutableState27cleanupAfterMatchA"
               "ndRewriteEv")
WARP_NO_SYMBOL(warp_no_pdl_state,
               "_ZNK4mlir6detail11PDLByteCode22initializeMutableStateERNS0_2"
               "3PDLByteCodeMutableStateE")
WARP_NO_SYMBOL(warp_no_pdl_match,
               "_ZNK4mlir6detail11PDLByteCode5matchEPNS_9OperationERNS_15Pat"
               "ternRewriterERN4llvm15SmallVectorImplINS1_11MatchResultEEERN"
               "S0_23PDLByteCodeMutableStateE")
WARP_NO_SYMBOL(warp_no_pdl_rewrite,
               "_ZNK4mlir6detail11PDLByteCode7rewriteERNS_15PatternRewriterE"
               "RKNS1_11MatchResultERNS0_23PDLByteCodeMutableStateE")
WARP_NO_SYMBOL(warp_no_pdl_pass,
               "_ZN4mlir31createConvertPDLToPDLInterpPassERN4llvm8DenseMapIP"
               "NS_9OperationEPNS_19PDLPatternConfigSetENS0_12DenseMapInfoIS"
               "3_vEENS0_6detail12DenseMapPairIS3_S5_EEEE")
