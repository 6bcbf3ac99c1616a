//===- CleanUpAdjoint.cpp - Dead code elimination in derivatives ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Runs when dead code is gone. The remaining IR shows what the derivative
// needs: marked loads that cannot be had are errors, arguments without a use
// go, and the arrays that are read are listed for the tape, which watches
// whether they still have the contents of the launch.
//
//===----------------------------------------------------------------------===//

#include "AdjointSums.h"
#include "Analysis/ArrayOrigins.h"
#include "Analysis/Effects.h"
#include "Analysis/ThreadVariance.h"
#include "Autodiff/Loops/CountTrips.h"
#include "Autodiff/Recording.h"
#include "Autodiff/Reverse/Reverse.h"
#include "DeadValues.h"
#include "HiddenArguments.h"
#include "KernelFunction.h"
#include "ValueConditions.h"

#include "WarpDialect/TileOps.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

namespace warp {
#define GEN_PASS_DEF_CLEANUPADJOINT
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp::autodiff;

/// Reports loads of what the launch overwrote; notes what the others assume.
static LogicalResult checkMarks(func::FuncOp adjoint) {
  bool hasFailed = false;
  adjoint.walk([&](Operation *load) {
    if (!isa<warp::AccessOp, warp::TileAccessOp>(load))
      return;
    auto why = load->getAttrOfType<StringAttr>(warp::attr::unrecoverable);
    if (why) {
      load->emitError(why.getValue());
      hasFailed = true;
    }
    if (load->removeAttr(warp::attr::assumesOneThread) &&
        !adjoint->hasAttr(warp::attr::oneThread))
      adjoint->setAttr(
          warp::attr::oneThread,
          StringAttr::get(load->getContext(),
                          "it reads what all threads of the launch write"));
  });
  return failure(hasFailed);
}

/// Erases arguments and what is done to them.
static void dropArguments(func::FuncOp function,
                          function_ref<bool(BlockArgument)> isDropped) {
  llvm::BitVector dropped(function.getNumArguments());
  for (BlockArgument argument : function.getArguments()) {
    if (!isDropped(argument))
      continue;
    for (Operation *user : llvm::make_early_inc_range(argument.getUsers()))
      user->erase();
    dropped.set(argument.getArgNumber());
  }
  (void)function.eraseArguments(dropped);
}

/// Drops the hidden arguments that nothing uses.
static void dropIdle(func::FuncOp function) {
  dropArguments(function, [](BlockArgument argument) {
    return getHidden(argument) && argument.use_empty();
  });
}

/// Drops what the adjoint does not read from what is recorded for it; null if
/// nothing is left to record or to check.
static func::FuncOp dropUnused(func::FuncOp adjoint, func::FuncOp recording) {
  llvm::SmallDenseSet<Attribute> wanted;
  for (BlockArgument argument : adjoint.getArguments())
    if (warp::HiddenAttr hidden = getHidden(argument);
        hidden && !argument.use_empty())
      wanted.insert(hidden);
  bool isOfUse = false;
  auto isUnused = [&](BlockArgument argument) {
    warp::HiddenAttr hidden = getHidden(argument);
    if (!hidden)
      return false;
    bool isTape = hidden.getKind() == warp::HiddenKind::Tape;
    isOfUse |= hidden.getKind() == warp::HiddenKind::Claims ||
               (isTape && wanted.contains(hidden));
    return isTape && !wanted.contains(hidden);
  };
  dropArguments(recording, isUnused);
  if (!isOfUse) {
    recording.erase();
    return nullptr;
  }
  eraseDead(recording.getBody());
  dropArguments(recording, [](BlockArgument argument) {
    warp::HiddenAttr hidden = getHidden(argument);
    return hidden && hidden.getKind() == warp::HiddenKind::Saved &&
           argument.use_empty();
  });
  return recording;
}

/// Drops the hidden arguments that nothing uses, in the adjoint and in what
/// saves or records for it.
static void dropUnusedSaved(func::FuncOp adjoint, func::FuncOp augmented,
                            func::FuncOp recording) {
  llvm::SmallDenseSet<Attribute> used;
  for (func::FuncOp reader : {adjoint, recording})
    if (reader)
      for (BlockArgument argument : reader.getArguments())
        if (warp::HiddenAttr hidden = getHidden(argument);
            hidden && !argument.use_empty() &&
            (reader == adjoint || hidden.getKind() == warp::HiddenKind::Saved))
          used.insert(hidden);
  auto isUnused = [&](BlockArgument argument) {
    warp::HiddenAttr hidden = getHidden(argument);
    return hidden && !used.contains(hidden);
  };
  if (augmented)
    dropArguments(augmented, isUnused);
  dropArguments(adjoint, isUnused);
}

/// Moves what is known about hidden arguments to the function; returns how
/// many there are.
static unsigned describeHidden(func::FuncOp function) {
  Builder b(function.getContext());
  SmallVector<Attribute> hidden, names;
  if (auto known = function->getAttrOfType<ArrayAttr>(warp::attr::argNames))
    llvm::append_range(names, known);
  for (BlockArgument argument : function.getArguments()) {
    warp::HiddenAttr entry = getHidden(argument);
    if (!entry)
      continue;
    unsigned number = argument.getArgNumber();
    warp::HiddenKind kind = entry.getKind();
    if (kind == warp::HiddenKind::Counters)
      entry = warp::HiddenAttr::get(
          b.getContext(), kind, entry.getLeaf(), entry.getDirection(),
          function->getAttrOfType<ArrayAttr>(warp::attr::places));
    hidden.push_back(entry);
    function.removeArgAttr(number, warp::attr::hidden);
    // The tape of one loop may be several arguments.
    int64_t part = kind == warp::HiddenKind::Tape ? number : entry.getLeaf();
    names.push_back(
        b.getStringAttr(stringifyHiddenKind(kind) + "." + Twine(part)));
  }
  function->removeAttr(warp::attr::places);
  if (hidden.empty())
    return 0;
  function->setAttr(warp::attr::hidden, b.getArrayAttr(hidden));
  if (function->hasAttr(warp::attr::argNames))
    function->setAttr(warp::attr::argNames, b.getArrayAttr(names));
  return hidden.size();
}

/// True if all threads of a launch add to one element, so that warps or blocks
/// of them add up first.
static bool isShared(warp::AccumulateOp sum,
                     const warp::ThreadVariance &variance) {
  auto isSame = [&](Value value) {
    return variance.isUniform(value, warp::Scope::Launch);
  };
  return isSame(sum.getArray()) && llvm::all_of(sum.getIndices(), isSame);
}

/// Lists the leaves whose contents the adjoint reads, or the function that
/// records for it, and counts.
static void describeCode(func::FuncOp adjoint, func::FuncOp recording,
                         unsigned hiddenCount) {
  warp::ArrayLeaves leaves(adjoint);
  unsigned count = leaves.size() - hiddenCount;
  llvm::BitVector needed(count);
  auto note = [&](const warp::ArrayLeaves &leaves, Value array) {
    for (unsigned leaf : leaves.of(array))
      if (leaf < count)
        needed.set(leaf);
  };
  int64_t atomics = 0, reductions = 0, shadowed = 0, assertions = 0;
  warp::ThreadVariance variance(adjoint, /*disjoint=*/true);
  adjoint.walk([&](Operation *op) {
    shadowed += isa<warp::GradOp>(op);
    // Others need code with checks.
    if (auto assertion = dyn_cast<warp::AssertOp>(op))
      assertions += !assertion.getAlways();
    if (auto sum = dyn_cast<warp::AccumulateOp>(op); sum && !sum.getUnique()) {
      ++atomics;
      reductions += isShared(sum, variance);
    }
    if (auto sum = dyn_cast<warp::TileAtomicOp>(op))
      atomics += sum.getKind() == warp::TileUpdate::add;
    if (warp::isPlainRead(op))
      note(leaves, cast<warp::AccessOp>(op).getArray());
    if (auto tiles = dyn_cast<warp::TileAccessOp>(op);
        tiles && !tiles.mayWrite())
      note(leaves, tiles.getArray());
  });
  if (recording) {
    warp::ArrayLeaves own(recording);
    recording.walk([&](warp::AccessOp op) {
      if (warp::isPlainRead(op))
        note(own, op.getArray());
    });
  }
  Builder b(adjoint.getContext());
  SmallVector<int64_t> list(needed.set_bits_begin(), needed.set_bits_end());
  adjoint->setAttr(warp::attr::needed, b.getI64ArrayAttr(list));
  NamedAttrList metrics(
      adjoint->getAttrOfType<DictionaryAttr>(warp::attr::metrics));
  metrics.set("atomics", b.getI64IntegerAttr(atomics));
  metrics.set("block_reductions", b.getI64IntegerAttr(reductions));
  metrics.set("shadowed", b.getI64IntegerAttr(shadowed));
  metrics.set("assertions", b.getI64IntegerAttr(assertions));
  adjoint->setAttr(warp::attr::metrics,
                   metrics.getDictionary(adjoint.getContext()));
}

namespace {

struct CleanUpAdjoint : warp::impl::CleanUpAdjointBase<CleanUpAdjoint> {
  void runOnOperation() override {
    auto adjoint =
        dyn_cast_or_null<func::FuncOp>(warp::findKernel(getOperation()));
    if (!adjoint || failed(checkMarks(adjoint)))
      return signalPassFailure();
    assertConditions(adjoint);
    func::FuncOp augmented, recording, sizing;
    for (auto function : getOperation().getOps<func::FuncOp>()) {
      if (function->hasAttr(warp::attr::augmented))
        augmented = function;
      if (function->hasAttr(warp::attr::recording))
        recording = function;
      if (function->hasAttr(warp::attr::sizing))
        sizing = function;
    }
    mergeSums(adjoint.getBody().front());
    storeSums(adjoint);
    if (func::FuncOp counting = takeCounting(adjoint)) {
      dropUnusedSaved(counting, nullptr, nullptr);
      describeHidden(counting);
    }
    if (recording)
      recording = dropUnused(adjoint, recording);
    dropUnusedSaved(adjoint, augmented, recording);
    if (recording) {
      describeHidden(recording);
      dropIdle(sizing);
      describeHidden(sizing);
    } else if (sizing) {
      sizing.erase();
    }
    describeCode(adjoint, recording, describeHidden(adjoint));
    if (augmented && describeHidden(augmented) == 0)
      augmented.erase();
  }
};

} // namespace
