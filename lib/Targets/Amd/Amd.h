//===- Amd.h - AMD's GPUs ---------------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_AMD_AMD_H
#define WARP_LIB_TARGETS_AMD_AMD_H

#include "Targets/Target.h"

namespace warp {

/// "gfx90a" has subgroups (waves) of 64 lanes, "gfx1100" of 32. Kernels are
/// lowered to LLVM's dialect; this library has no code generator for them.
class AmdTarget final : public TargetInfo {
public:
  static std::unique_ptr<TargetInfo> parse(llvm::StringRef name);

  AmdTarget(llvm::StringRef name, TargetFacts facts)
      : TargetInfo(name, facts) {}

  void declareEntry(mlir::LLVM::LLVMFuncOp entry, int64_t bytes,
                    int64_t alignment) const override;
  mlir::Value emitIsFull(mlir::OpBuilder &b, mlir::Location loc) const override;
  mlir::Value emitVoteAll(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Value condition) const override;
  mlir::Value emitBallot(mlir::OpBuilder &b, mlir::Location loc,
                         mlir::Value condition) const override;
  mlir::Value emitActiveLanes(mlir::OpBuilder &b,
                              mlir::Location loc) const override;
  mlir::Value emitAgree(mlir::OpBuilder &b, mlir::Location loc,
                        mlir::Value value, mlir::Value lanes) const override;
  void emitSubgroupBarrier(mlir::OpBuilder &b, mlir::Location loc,
                           mlir::Value lanes) const override;
  mlir::Value emitBlockAny(mlir::OpBuilder &b, mlir::Location loc,
                           mlir::Value condition) const override;
  mlir::Value emitRsqrt(mlir::OpBuilder &b, mlir::Location loc, mlir::Value x,
                        bool flushes) const override;
  void emitPrintf(mlir::OpBuilder &b, mlir::Location loc, mlir::ModuleOp module,
                  mlir::Value format, mlir::Value buffer,
                  int64_t bytes) const override;
  llvm::StringRef getLaunchScope() const override { return "agent"; }
  llvm::StringRef getBlockScope() const override { return "workgroup"; }
  /// Loads of one address are scalar by themselves.
  unsigned getTableSpace(bool uniform, int64_t bytes) const override {
    return 4;
  }
  std::string getMathFunction(llvm::StringRef name, bool isSingle,
                              bool fast) const override;
  llvm::StringRef getSineCosine() const override { return "warp_gpu_sincosf"; }
  void prepareKernel(mlir::Operation *module) const override;
  void finishKernel(mlir::LLVM::LLVMFuncOp kernel,
                    int64_t blockDim) const override;
  bool isBlockBarrier(mlir::Operation *op) const override;

  std::unique_ptr<llvm::TargetMachine>
  createMachine(const CompileOptions &options) const override;
  void prepareModule(llvm::Module &module, llvm::TargetMachine &machine,
                     const CompileOptions &options) const override;

};

} // namespace warp

#endif // WARP_LIB_TARGETS_AMD_AMD_H
