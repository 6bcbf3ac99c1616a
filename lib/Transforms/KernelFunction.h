//===- KernelFunction.h - Finding the kernel of a module --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_KERNELFUNCTION_H
#define WARP_LIB_TRANSFORMS_KERNELFUNCTION_H

#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/IR/BuiltinOps.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

namespace warp {

/// The function marked `warp.kernel`, or null with an error at the module if
/// there is not exactly one.
inline mlir::FunctionOpInterface findKernel(mlir::ModuleOp module) {
  mlir::FunctionOpInterface found;
  for (auto func : module.getOps<mlir::FunctionOpInterface>()) {
    if (!func->hasAttr(kernelAttrName))
      continue;
    if (found) {
      module.emitError("expects one function marked 'warp.kernel', but got '")
          << found.getName() << "' and '" << func.getName() << "'";
      return nullptr;
    }
    found = func;
  }
  if (!found)
    module.emitError("expects a function marked 'warp.kernel'");
  return found;
}

/// An integer attribute that warp-specialize attached; `fallback` without.
inline int64_t getFact(mlir::Operation *func, llvm::StringRef name,
                       int64_t fallback) {
  auto value = func->getAttrOfType<mlir::IntegerAttr>(name);
  return value ? value.getValue().getSExtValue() : fallback;
}

/// Whether the launch is for a GPU.
inline bool isGpu(mlir::Operation *func) {
  auto target = func->getAttrOfType<mlir::StringAttr>(attr::target);
  return target && target.getValue().starts_with("sm_");
}

/// Whether the blocks of a GPU launch are made of full warps.
inline bool hasWholeWarps(mlir::Operation *entry) {
  int64_t blockDim = getFact(entry, attr::blockDim, 256);
  bool oneAxis =
      getFact(entry, attr::rank, 1) == 1 || entry->hasAttr(attr::flat);
  return blockDim % 32 == 0 && (oneAxis || llvm::isPowerOf2_64(blockDim));
}

/// How many entries of `attr::sums` are arrays with exact sums.
inline int64_t countSums(mlir::ArrayAttr sums) {
  return llvm::count_if(sums.getAsRange<mlir::DenseI64ArrayAttr>(),
                        [](mlir::DenseI64ArrayAttr entry) {
                          return entry[0] != 0;
                        });
}

/// The threads of a kernel in phase `launch`; null in other phases.
inline ThreadsOp findThreads(mlir::FunctionOpInterface kernel) {
  for (auto group : kernel.getFunctionBody().getOps<GroupOp>())
    for (auto threads : group.getBody().getOps<ThreadsOp>())
      return threads;
  return nullptr;
}

/// Passes of the module-level phases agree on the function they work on.
inline mlir::FunctionOpInterface findEntry(mlir::ModuleOp module) {
  for (auto func : module.getOps<mlir::FunctionOpInterface>())
    if (func->hasAttr(attr::entry))
      return func;
  module.emitError("expects a function marked 'warp.entry'");
  return nullptr;
}

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_KERNELFUNCTION_H
