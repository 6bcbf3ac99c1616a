//===- Target.cpp - Target registry: from a name to a target --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Target.h"

#include "Amd/Amd.h"
#include "Cpu/Cpu.h"
#include "Nvidia/Nvidia.h"

#include "warp/Compile.h"
#include "warp/Error.h"
#include "warp/Forks.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

#include "llvm/ADT/StringMap.h"

using namespace mlir;
using namespace warp;

namespace {
struct Targets {
  ForkMutex mutex;
  llvm::StringMap<std::unique_ptr<TargetInfo>> known;

  static Targets &get() {
    static auto *targets = new Targets;
    return *targets;
  }
};
} // namespace

const TargetInfo *warp::parseTarget(StringRef name) {
  Targets &targets = Targets::get();
  std::lock_guard guard(targets.mutex);
  auto found = targets.known.find(name);
  if (found != targets.known.end())
    return found->second.get();
  for (auto *parse : {CpuTarget::parse, NvidiaTarget::parse, AmdTarget::parse})
    if (std::unique_ptr<TargetInfo> made = parse(name))
      return (targets.known[name] = std::move(made)).get();
  return nullptr;
}

std::string warp::describeUnknownTarget(StringRef name) {
  return ("expects a target such as 'cpu', 'sm_90' or 'gfx90a', but got '" +
          name + "'")
      .str();
}

const TargetInfo &warp::getTarget(const CompileOptions &options) {
  if (const TargetInfo *target = parseTarget(options.target))
    return *target;
  throw Error(Error::Kind::Compile, describeUnknownTarget(options.target));
}

//===----------------------------------------------------------------------===//
// Instructions that a target lacks
//===----------------------------------------------------------------------===//

mlir::Value TargetInfo::emitIsFull(OpBuilder &, Location) const {
  llvm_unreachable("the target has no subgroups");
}
mlir::Value TargetInfo::emitVoteAll(OpBuilder &, Location, mlir::Value) const {
  llvm_unreachable("the target has no subgroups");
}
mlir::Value TargetInfo::emitBallot(OpBuilder &, Location, mlir::Value) const {
  llvm_unreachable("the target has no subgroups");
}
mlir::Value TargetInfo::emitActiveMax(OpBuilder &, Location,
                                      mlir::Value) const {
  llvm_unreachable("the target has no such instruction");
}
mlir::Value TargetInfo::emitActiveLanes(OpBuilder &, Location) const {
  llvm_unreachable("the target has no subgroups");
}
mlir::Value TargetInfo::emitAgree(OpBuilder &, Location, mlir::Value,
                                  mlir::Value) const {
  llvm_unreachable("the target has no subgroups");
}
void TargetInfo::emitSubgroupBarrier(OpBuilder &, Location, mlir::Value) const {
  llvm_unreachable("the target has no subgroups");
}
mlir::Value TargetInfo::emitBlockAny(OpBuilder &, Location, mlir::Value) const {
  llvm_unreachable("the target has no blocks");
}
mlir::Value TargetInfo::emitRsqrt(OpBuilder &, Location, mlir::Value,
                                  bool) const {
  llvm_unreachable("the target has no such instruction");
}
void TargetInfo::emitPairedAtomic(OpBuilder &, Location, mlir::Value,
                                  mlir::Value, mlir::Value) const {
  llvm_unreachable("the target has no such instruction");
}
void TargetInfo::emitPrintf(OpBuilder &, Location, ModuleOp, mlir::Value,
                            mlir::Value, int64_t) const {
  llvm_unreachable("the target's printf takes variable arguments");
}

void TargetInfo::finishKernel(LLVM::LLVMFuncOp, int64_t) const {}
