//===- Reductions.cpp - Atomic reductions without result ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A thread waits for the result of `atom` even if it has no use: assemblers see
// that only in code that is not linked, and drivers give machine code to keep
// of nothing but linked code. `red` has no result (PTX ISA, "Parallel
// Synchronization and Communication Instructions: red"), and LLVM does not use
// it. This comes last, when pointers and uses are known.
//
//===----------------------------------------------------------------------===//

#include "Reductions.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/IR/IRBuilder.h"
#include "llvm/IR/InlineAsm.h"
#include "llvm/IR/Module.h"

using namespace llvm;

/// Address space 1 of NVPTX.
static constexpr unsigned globalSpace = 1;

/// The operation and type of `red` for an update, and the constraint of its
/// value; empty without such.
static std::pair<std::string, std::string> findReduction(AtomicRMWInst &rmw) {
  Type *type = rmw.getValOperand()->getType();
  if (rmw.getOperation() == AtomicRMWInst::FAdd) {
    if (type->isFloatTy())
      return {"add.f32", "f"};
    if (type->isDoubleTy())
      return {"add.f64", "d"};
    return {};
  }
  if (!type->isIntegerTy(32) && !type->isIntegerTy(64))
    return {};
  auto named = [&](StringRef name, StringRef kind) {
    bool isWide = type->isIntegerTy(64);
    return std::pair((name + "." + kind + (isWide ? "64" : "32")).str(),
                     std::string(isWide ? "l" : "r"));
  };
  switch (rmw.getOperation()) {
  case AtomicRMWInst::Add:
  case AtomicRMWInst::Sub:
    return named("add", "u");
  case AtomicRMWInst::Min:
    return named("min", "s");
  case AtomicRMWInst::Max:
    return named("max", "s");
  case AtomicRMWInst::UMin:
    return named("min", "u");
  case AtomicRMWInst::UMax:
    return named("max", "u");
  case AtomicRMWInst::And:
    return named("and", "b");
  case AtomicRMWInst::Or:
    return named("or", "b");
  case AtomicRMWInst::Xor:
    return named("xor", "b");
  default:
    return {};
  }
}

static void replace(AtomicRMWInst &rmw) {
  auto [name, constraint] = findReduction(rmw);
  if (name.empty())
    return;
  IRBuilder<> b(&rmw);
  Value *pointer = rmw.getPointerOperand(), *value = rmw.getValOperand();
  if (rmw.getOperation() == AtomicRMWInst::Sub)
    value = b.CreateNeg(value);
  auto *type = FunctionType::get(b.getVoidTy(),
                                 {pointer->getType(), value->getType()}, false);
  auto *text =
      InlineAsm::get(type, "red.relaxed.gpu.global." + name + " [$0], $1;",
                     "l," + constraint + ",~{memory}",
                     /*hasSideEffects=*/true);
  b.CreateCall(text, {pointer, value})->setDebugLoc(rmw.getDebugLoc());
  rmw.eraseFromParent();
}

void warp::useReductions(Module &module) {
  SyncScope::ID device = module.getContext().getOrInsertSyncScopeID("device");
  for (Function &function : module)
    for (BasicBlock &block : function)
      for (Instruction &one : make_early_inc_range(block)) {
        auto *rmw = dyn_cast<AtomicRMWInst>(&one);
        if (rmw && rmw->use_empty() &&
            rmw->getPointerAddressSpace() == globalSpace &&
            rmw->getOrdering() == AtomicOrdering::Monotonic &&
            rmw->getSyncScopeID() == device)
          replace(*rmw);
      }
}
