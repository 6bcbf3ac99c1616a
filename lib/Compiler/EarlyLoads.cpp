//===- EarlyLoads.cpp - Loads of GPUs stay ahead of branches --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//
//
// InstCombine moves a load into the branch that alone uses it, and with it the
// loads that its address comes from. A CPU saves a load where the branch is not
// taken. A thread of a GPU waits for the condition, which is often loaded too,
// and then for each load of the chain in turn: gathers that a program makes
// side by side become a sequence of round trips to memory.
//
//   load a; load c; load x[c]; if (a) use x[c]     2 round trips
//   load a; if (a) { load c; load x[c]; use it }   3 round trips
//
// Arithmetic still moves. While InstCombine runs, an intrinsic that touches
// memory ends each block that has a choice of successors: no load moves over
// it, unless it is of memory that never changes, like a parameter. The machine
// sinking pass of PTX does the same later; an empty piece of assembly stops it,
// which is a comment in the text.
//
//===----------------------------------------------------------------------===//

#include "Target.h"

#include "llvm/IR/IRBuilder.h"
#include "llvm/IR/InlineAsm.h"
#include "llvm/IR/InstIterator.h"
#include "llvm/IR/IntrinsicInst.h"
#include "llvm/IR/PassInstrumentation.h"

using namespace warp;

static llvm::Function *asCombined(llvm::StringRef pass, llvm::Any unit) {
  if (pass != "InstCombinePass")
    return nullptr;
  auto *function = llvm::any_cast<const llvm::Function *>(&unit);
  return function ? const_cast<llvm::Function *>(*function) : nullptr;
}

static void endBlocks(llvm::Function &function) {
  for (llvm::BasicBlock &block : function) {
    llvm::Instruction *last = block.getTerminator();
    if (last->getNumSuccessors() > 1)
      llvm::IRBuilder<>(last).CreateIntrinsic(llvm::Intrinsic::sideeffect, {});
  }
}

static void removeEnds(llvm::Function &function) {
  for (llvm::Instruction &one :
       llvm::make_early_inc_range(llvm::instructions(function)))
    if (auto *call = llvm::dyn_cast<llvm::IntrinsicInst>(&one))
      if (call->getIntrinsicID() == llvm::Intrinsic::sideeffect)
        call->eraseFromParent();
}

/// True if a load of memory that may change could move over the block's end.
static bool endsWithLoads(llvm::BasicBlock &block) {
  for (llvm::Instruction &one : llvm::reverse(block)) {
    if (one.mayWriteToMemory())
      return false;
    if (llvm::isa<llvm::LoadInst>(one) &&
        !one.hasMetadata(llvm::LLVMContext::MD_invariant_load))
      return true;
  }
  return false;
}

void warp::keepLoadsBeforeBranches(llvm::Module &module) {
  auto *type = llvm::FunctionType::get(
      llvm::Type::getVoidTy(module.getContext()), /*isVarArg=*/false);
  auto *end = llvm::InlineAsm::get(type, "", "~{memory}",
                                   /*hasSideEffects=*/true);
  for (llvm::Function &function : module)
    for (llvm::BasicBlock &block : function)
      if (block.getTerminator()->getNumSuccessors() > 1 && endsWithLoads(block))
        llvm::IRBuilder<>(block.getTerminator()).CreateCall(end);
}

void warp::keepLoadsBeforeBranches(
    llvm::PassInstrumentationCallbacks &callbacks) {
  callbacks.registerBeforeNonSkippedPassCallback(
      [](llvm::StringRef pass, llvm::Any unit) {
        if (llvm::Function *function = asCombined(pass, unit))
          endBlocks(*function);
      });
  callbacks.registerAfterPassCallback([](llvm::StringRef pass, llvm::Any unit,
                                         const llvm::PreservedAnalyses &) {
    if (llvm::Function *function = asCombined(pass, unit))
      removeEnds(*function);
  });
}
