//===- Cpu.h - x86-64 and aarch64 processors --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_CPU_CPU_H
#define WARP_LIB_TARGETS_CPU_CPU_H

#include "Targets/Target.h"

namespace warp {

/// "cpu" is the processor that compiles, "cpu:skylake-avx512" another one,
/// which tests use.
class CpuTarget final : public TargetInfo {
public:
  static std::unique_ptr<TargetInfo> parse(llvm::StringRef name);

  CpuTarget(llvm::StringRef name, TargetFacts facts, int64_t bits)
      : TargetInfo(name, facts), bits(bits) {}

  bool isSimt() const override { return false; }
  int64_t getVectorBits() const override { return bits; }
  bool returnsOnX87() const override;
  void declareEntry(mlir::LLVM::LLVMFuncOp entry, int64_t bytes,
                    int64_t alignment) const override;
  std::string getMathFunction(llvm::StringRef name, bool isSingle,
                              bool fast) const override;
  std::string describeProcessor() const override;
  std::unique_ptr<llvm::TargetMachine>
  createMachine(const CompileOptions &options) const override;
  void prepareModule(llvm::Module &module, llvm::TargetMachine &machine,
                     const CompileOptions &options) const override;

private:
  int64_t bits;
};

} // namespace warp

#endif // WARP_LIB_TARGETS_CPU_CPU_H
