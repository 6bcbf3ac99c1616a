//===- Lowering.cpp - CPU entries and math functions ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Cpu.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

using namespace mlir;
using namespace warp;

void CpuTarget::declareEntry(LLVM::LLVMFuncOp entry, int64_t, int64_t) const {
  auto unit = UnitAttr::get(entry.getContext());
  entry.setArgAttr(0, "llvm.noalias", unit);
  entry.setArgAttr(0, "llvm.readonly", unit);
}

/// The device library has all that is no instruction, and that LLVM does not
/// expand inline.
std::string CpuTarget::getMathFunction(StringRef name, bool isSingle,
                                       bool) const {
  if (name == "rsqrt" || name == "fmod")
    return "";
  return ("warp_" + name + (isSingle ? "f" : "")).str();
}
