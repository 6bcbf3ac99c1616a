//===- Codegen.cpp - No code generation for AMD's GPUs --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// LLVM's back end for AMD's GPUs is not part of this library: the result of
// warp-convert-to-llvm is for `mlir-translate`, `llvm-link` with the device
// library, and `llc` (scripts/lower_corpus.py).
//
//===----------------------------------------------------------------------===//

#include "Amd.h"

#include "warp/Compile.h"
#include "warp/Error.h"

#include "llvm/IR/Module.h"
#include "llvm/Target/TargetMachine.h"

using namespace warp;

std::unique_ptr<llvm::TargetMachine>
AmdTarget::createMachine(const CompileOptions &) const {
  throw Error(Error::Kind::Compile, "no code generator for target '" +
                                        getName().str() +
                                        "', lower to LLVM IR and use llc");
}

void AmdTarget::prepareModule(llvm::Module &, llvm::TargetMachine &,
                              const CompileOptions &) const {
  llvm_unreachable("there is no machine");
}
