//===- Nvidia.h - NVIDIA's GPUs ---------------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_NVIDIA_NVIDIA_H
#define WARP_LIB_TARGETS_NVIDIA_NVIDIA_H

#include "Targets/Target.h"

namespace warp {

/// "sm_90" is an architecture; "sm_90a" also has what no later one has.
class NvidiaTarget final : public TargetInfo {
public:
  static std::unique_ptr<TargetInfo> parse(llvm::StringRef name);

  NvidiaTarget(llvm::StringRef name, TargetFacts facts, unsigned version)
      : TargetInfo(name, facts), version(version) {}

  void declareEntry(mlir::LLVM::LLVMFuncOp entry, int64_t bytes,
                    int64_t alignment) const override;
  mlir::Value emitIsFull(mlir::OpBuilder &b, mlir::Location loc) const override;
  mlir::Value emitVoteAll(mlir::OpBuilder &b, mlir::Location loc,
                          mlir::Value condition) const override;
  mlir::Value emitBallot(mlir::OpBuilder &b, mlir::Location loc,
                         mlir::Value condition) const override;
  mlir::Value emitActiveMax(mlir::OpBuilder &b, mlir::Location loc,
                            mlir::Value value) const override;
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
  void emitPairedAtomic(mlir::OpBuilder &b, mlir::Location loc,
                        mlir::Value pointer, mlir::Value x,
                        mlir::Value y) const override;
  void emitPrintf(mlir::OpBuilder &b, mlir::Location loc, mlir::ModuleOp module,
                  mlir::Value format, mlir::Value buffer,
                  int64_t bytes) const override;
  llvm::StringRef getLaunchScope() const override { return "device"; }
  llvm::StringRef getBlockScope() const override { return "block"; }
  /// Constant memory serves one address at a time, and a kernel has 64 KiB of
  /// it; global memory is read through the L1 cache.
  unsigned getTableSpace(bool uniform, int64_t bytes) const override {
    return uniform && bytes <= mostConstantBytes ? 4 : 1;
  }
  std::string getMathFunction(llvm::StringRef name, bool isSingle,
                              bool fast) const override;
  llvm::StringRef getSineCosine() const override { return "warp_gpu_sincosf"; }
  void addPatterns(mlir::LLVMTypeConverter &types,
                   mlir::RewritePatternSet &patterns) const override;
  void finishKernel(mlir::LLVM::LLVMFuncOp kernel,
                    int64_t blockDim) const override;
  bool isBlockBarrier(mlir::Operation *op) const override;

  std::unique_ptr<llvm::TargetMachine>
  createMachine(const CompileOptions &options) const override;
  void prepareModule(llvm::Module &module, llvm::TargetMachine &machine,
                     const CompileOptions &options) const override;
  void limitRegisters(llvm::Function &kernel, int leastBlocks,
                      int mostRegisters) const override;
  void finishModule(llvm::Module &module) const override;
  void finishText(llvm::SmallVectorImpl<char> &text,
                  llvm::StringRef entry) const override;
  llvm::StringRef getTextSuffix() const override { return "ptx"; }

private:
  /// The limit for all tables; compiler and libraries need some, too.
  static constexpr int64_t mostConstantBytes = 48 << 10;
  /// Compute capability, 90 for 9.0.
  unsigned version;
};

} // namespace warp

#endif // WARP_LIB_TARGETS_NVIDIA_NVIDIA_H
