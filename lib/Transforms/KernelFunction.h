//===- KernelFunction.h - Finding the kernel of a module --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_KERNELFUNCTION_H
#define WARP_LIB_TRANSFORMS_KERNELFUNCTION_H

#include "Targets/Target.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpAttributes.h"
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

/// The kind of launch that a function is compiled for. Without that attribute
/// nothing is known of it.
inline VariantAttr getVariant(mlir::Operation *func) {
  auto variant = func->getAttrOfType<VariantAttr>(attr::variant);
  return variant ? variant : VariantAttr::getUnknown(func->getContext());
}

/// The target that a function is compiled for.
inline const TargetInfo &getTarget(mlir::Operation *func) {
  return getVariant(func).getTarget().getInfo();
}

/// The passes' decisions about the launch of a function.
inline ScheduleAttr getSchedule(mlir::Operation *func) {
  auto schedule = func->getAttrOfType<ScheduleAttr>(attr::schedule);
  return schedule ? schedule : ScheduleAttr::getDefault(func->getContext());
}

inline void setSchedule(mlir::Operation *func, ScheduleAttr schedule) {
  func->setAttr(attr::schedule, schedule);
}

/// The threads of a kernel in phase `launch`; null in other phases.
inline ThreadsOp findThreads(mlir::FunctionOpInterface kernel) {
  for (auto group : kernel.getFunctionBody().getOps<GroupOp>())
    for (auto threads : group.getBody().getOps<ThreadsOp>())
      return threads;
  return nullptr;
}

/// The threads of the module's kernel, or null with an error if it has none or
/// is in another phase.
inline ThreadsOp findThreads(mlir::ModuleOp module) {
  mlir::FunctionOpInterface kernel = findKernel(module);
  if (!kernel)
    return nullptr;
  ThreadsOp threads = findThreads(kernel);
  if (!threads)
    kernel.emitError("expects a kernel in phase 'launch'");
  return threads;
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
