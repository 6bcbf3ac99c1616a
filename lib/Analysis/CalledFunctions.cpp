//===- CalledFunctions.cpp - Memory effects of calls ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "CalledFunctions.h"

#include "ArrayOrigins.h"
#include "Effects.h"
#include "WarpDialect/LaneOps.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/IR/SymbolTable.h"

using namespace mlir;
using warp::CalledFunctions;
using warp::CallEffects;

CallEffects CalledFunctions::of(func::CallOp call) {
  if (auto found = known.find(call.getCallee()); found != known.end())
    return found->second;
  auto function = SymbolTable::lookupNearestSymbolFrom<func::FuncOp>(
      call, call.getCalleeAttr());
  CallEffects effects;
  if (function && !function.isExternal()) {
    effects = find(function);
  } else {
    effects.reads.resize(call.getNumOperands());
    effects.writes.resize(call.getNumOperands());
    effects.readsOther = effects.writesOther = true;
  }
  return known[call.getCallee()] = effects;
}

CallEffects CalledFunctions::find(func::FuncOp function) {
  CallEffects effects;
  effects.reads.resize(function.getNumArguments());
  effects.writes.resize(function.getNumArguments());
  auto note = [&](Value array, bool reads, bool writes) {
    auto argument = dyn_cast<BlockArgument>(warp::rootOf(array));
    if (!argument || argument.getOwner() != &function.front()) {
      effects.readsOther |= reads;
      effects.writesOther |= writes;
      return;
    }
    if (reads)
      effects.reads.set(argument.getArgNumber());
    if (writes)
      effects.writes.set(argument.getArgNumber());
  };
  function.walk([&](Operation *op) {
    if (auto access = dyn_cast<warp::AccessOp>(op))
      return note(access.getArray(), access.mayRead(), access.mayWrite());
    if (auto call = dyn_cast<func::CallOp>(op)) {
      CallEffects inner = of(call);
      effects.readsOther |= inner.readsOther;
      effects.writesOther |= inner.writesOther;
      for (auto [i, operand] : llvm::enumerate(call.getOperands()))
        if (inner.reads[i] || inner.writes[i])
          note(operand, inner.reads[i], inner.writes[i]);
      return;
    }
    // Memory of a thread's own goes with the function.
    bool isOwn =
        isa<warp::ScratchOp, warp::ScratchLoadOp, warp::ScratchStoreOp>(op);
    auto library = dyn_cast<warp::LibraryCallOp>(op);
    bool isKnown = isOwn || op->getNumRegions() != 0 ||
                   op->hasTrait<OpTrait::IsTerminator>() ||
                   warp::isConversion(op) || isMemoryEffectFree(op);
    if (!isKnown || (library && library.getCallee() == warp::threadMemory))
      effects.readsOther = effects.writesOther = true;
  });
  return effects;
}
