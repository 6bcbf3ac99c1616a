//===- AssembledLibrary.cpp - Cubins of the device library ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "AssembledLibrary.h"

#include "WarpDialect/LibraryOps.h"
#include "warp/LibraryCode.h"

#include "llvm/IR/Module.h"

using namespace warp;

/// True if the objects for a target have products of tiles.
static bool hasProducts(llvm::StringRef target) { return target == "sm_90a"; }

/// How the archive for a target has a function.
static LibraryFunction::Assembly assemblyOf(llvm::StringRef symbol,
                                            llvm::StringRef target) {
  const LibraryFunction *function = findLibraryFunction(symbol);
  return function && (!function->isProduct || hasProducts(target))
             ? function->assembly
             : LibraryFunction::Assembly::None;
}

bool warp::isAssembled(llvm::StringRef symbol, llvm::StringRef target) {
  return hasAssembledLibrary(target.str()) &&
         assemblyOf(symbol, target) != LibraryFunction::Assembly::None;
}

bool warp::callsAssembled(const llvm::Module &module, llvm::StringRef target) {
  return llvm::any_of(module, [&](const llvm::Function &function) {
    return function.isDeclaration() && assemblyOf(function.getName(), target) ==
                                           LibraryFunction::Assembly::Long;
  });
}

static constexpr llvm::StringLiteral hidden = "assembled.";

AssembledCalls::AssembledCalls(llvm::Module &module, llvm::StringRef target)
    : module(module) {
  for (llvm::Function &function : module)
    if (function.isDeclaration() && isAssembled(function.getName(), target)) {
      // They may contain barriers.
      function.setConvergent();
      function.setName(hidden + function.getName());
    }
}

bool AssembledCalls::isKept(const llvm::Function &function) {
  return function.getName().starts_with(hidden);
}

AssembledCalls::~AssembledCalls() {
  for (llvm::Function &function : module)
    if (isKept(function))
      function.setName(function.getName().drop_front(hidden.size()));
}
