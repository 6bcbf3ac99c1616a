//===- MaskedLoads.cpp - Masked loads stay before later stores ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//
//
// InstCombine of LLVM 22 folds `select(m, masked.load(p, m), x)` into a masked
// load that gives x elsewhere, and puts it where the select was. Stores between
// both then come first, and the load reads what they wrote: a thread that takes
// a value and clears it gets the cleared one (llvm/llvm-project#215453, mended
// in LLVM 23). The loop vectoriser makes such code from any conditional load
// before a store. A load that something may overwrite in its block is therefore
// frozen, which the fold doesn't look through.
//
//===----------------------------------------------------------------------===//

#include "Target.h"

#include "llvm/IR/IRBuilder.h"
#include "llvm/IR/InstIterator.h"
#include "llvm/IR/IntrinsicInst.h"
#include "llvm/IR/PassInstrumentation.h"

using namespace warp;

/// True if something after it in its block may write memory.
static bool isBeforeWrite(llvm::Instruction &load) {
  for (auto *next = load.getNextNode(); next; next = next->getNextNode())
    if (next->mayWriteToMemory())
      return true;
  return false;
}

static void freezeMaskedLoads(llvm::Function &function) {
  llvm::SmallVector<llvm::IntrinsicInst *> loads;
  for (llvm::Instruction &one : llvm::instructions(function)) {
    auto *call = llvm::dyn_cast<llvm::IntrinsicInst>(&one);
    if (!call || call->getIntrinsicID() != llvm::Intrinsic::masked_load)
      continue;
    bool isFrozen = call->hasOneUse() &&
                    llvm::isa<llvm::FreezeInst>(*call->user_begin());
    if (!isFrozen && isBeforeWrite(*call))
      loads.push_back(call);
  }
  for (llvm::IntrinsicInst *load : loads) {
    llvm::IRBuilder<> builder(load->getNextNode());
    auto *frozen = llvm::cast<llvm::Instruction>(builder.CreateFreeze(load));
    load->replaceUsesWithIf(
        frozen, [&](llvm::Use &use) { return use.getUser() != frozen; });
  }
}

void warp::keepLoadsBeforeStores(llvm::PassInstrumentationCallbacks &callbacks) {
  callbacks.registerBeforeNonSkippedPassCallback(
      [](llvm::StringRef pass, llvm::Any unit) {
        if (pass != "InstCombinePass")
          return;
        if (auto *function = llvm::any_cast<const llvm::Function *>(&unit))
          freezeMaskedLoads(const_cast<llvm::Function &>(**function));
      });
}
