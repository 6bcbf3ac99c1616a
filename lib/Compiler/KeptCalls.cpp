//===- KeptCalls.cpp - Out-of-line functions ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "KeptCalls.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TileTypes.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;
using warp::CallNode;

double warp::scalarOperations(Operation *op) {
  double scalars = 1;
  for (Type type : op->getResultTypes())
    if (isValue(type))
      scalars = std::max(scalars, double(getComponentCount(type)));
  return scalars;
}

//===----------------------------------------------------------------------===//
// Functions that may stay
//===----------------------------------------------------------------------===//

static bool holdsArray(Type type) {
  if (auto record = dyn_cast<warp::StructType>(type))
    return llvm::any_of(record.getFieldTypes(), holdsArray);
  return isa<warp::ArrayType>(type);
}

/// True if a function's parameters and results go by value. An array may lie in
/// memory that ends with the function, so it is no result.
static bool hasPlainSignature(func::FuncOp function) {
  return llvm::all_of(function.getArgumentTypes(), warp::isValue) &&
         llvm::all_of(function.getResultTypes(), [](Type type) {
           return warp::isValue(type) && !holdsArray(type);
         });
}

/// True if threads make an update one by one anyway: others are combined over
/// threads where a kernel keeps no calls. Assemblers combine those of integers.
static bool isByThread(Operation *op) {
  if (isa<warp::AtomicCasOp>(op))
    return true;
  auto update = dyn_cast<warp::AtomicOp>(op);
  return update &&
         (!update.getOld().use_empty() ||
          isa<IntegerType>(warp::getElementScalar(update.getOld().getType())));
}

/// True if an operation needs nothing but its operands, wherever it stands:
/// neither the thread's index, nor other threads, nor the kernel's parameter
/// block. Updates are planned for all of a kernel, unless a function may make
/// some, and print, by itself.
static bool isPlain(Operation *op, bool mayUpdate) {
  if (auto access = dyn_cast<warp::AccessOp>(op))
    return access.isUpdate() ? mayUpdate && isByThread(op)
                             : isa<warp::LoadOp, warp::StoreOp>(op);
  if (isa<warp::PrintfOp>(op))
    return mayUpdate;
  if (auto call = dyn_cast<warp::LibraryCallOp>(op))
    return call.getNumResults() != 0 && isMemoryEffectFree(op) &&
           warp::findLibraryFunction(call.getCallee());
  if (isa<warp::TidOp, warp::GradOp, warp::BarrierOp, warp::AssertOp,
          warp::CheckIndexOp, warp::PointerOp, warp::AddressOp,
          warp::TileAccessOp>(op))
    return false;
  auto isTile = [](Type type) { return isa<warp::TileType>(type); };
  if (llvm::any_of(op->getOperandTypes(), isTile) ||
      llvm::any_of(op->getResultTypes(), isTile))
    return false;
  return isa<func::CallOp>(op) || isa<scf::SCFDialect>(op->getDialect()) ||
         op->hasTrait<OpTrait::IsTerminator>() ||
         (op->getNumRegions() == 0 && isMemoryEffectFree(op));
}

static bool hasPlainBody(func::FuncOp function, bool mayUpdate) {
  if (function->hasAttr(warp::kernelAttrName))
    return false;
  WalkResult result = function.getBody().walk([&](Operation *op) {
    return isPlain(op, mayUpdate) ? WalkResult::advance()
                                  : WalkResult::interrupt();
  });
  return !result.wasInterrupted();
}

//===----------------------------------------------------------------------===//
// Functions that stay
//===----------------------------------------------------------------------===//

namespace {
/// The lengths of functions if those of at least `least` operations stay.
struct Choice {
  Choice(ArrayRef<CallNode> nodes, ArrayRef<bool> may, double least);

  SmallVector<bool> stays;
  /// Scalar operations of the kernel and of all functions that stay.
  double total = 0;
};
} // namespace

Choice::Choice(ArrayRef<CallNode> nodes, ArrayRef<bool> may, double least)
    : stays(nodes.size()) {
  SmallVector<double> length;
  for (auto [i, node] : llvm::enumerate(nodes)) {
    double sum = node.own;
    for (unsigned callee : node.callees)
      sum += stays[callee] ? 0 : length[callee];
    length.push_back(sum);
    stays[i] = may[i] && sum >= least;
    if (stays[i] || i + 1 == nodes.size())
      total += sum;
  }
}

std::optional<warp::KeptCalls>
warp::chooseKeptCalls(ArrayRef<CallNode> nodes, double budget, bool mayUpdate) {
  SmallVector<bool> none(nodes.size());
  if (Choice(nodes, none, 0).total <= budget)
    return std::nullopt;
  SmallVector<unsigned> calls(nodes.size());
  // A function may become part of those that call it.
  SmallVector<bool> isPlain;
  for (const CallNode &node : nodes) {
    for (unsigned callee : node.callees)
      ++calls[callee];
    isPlain.push_back(
        hasPlainBody(node.function, mayUpdate) &&
        llvm::all_of(node.callees, [&](unsigned i) { return isPlain[i]; }));
  }
  KeptCalls kept;
  for (auto [node, plain, count] : llvm::zip_equal(nodes, isPlain, calls))
    kept.mayStay.push_back(plain && count > 1 &&
                           hasPlainSignature(node.function));
  kept.least = budget / 2;
  while (kept.least > KeptCalls::shortest &&
         Choice(nodes, kept.mayStay, kept.least).total > budget)
    kept.least /= 2;
  kept.least = std::max(kept.least, KeptCalls::shortest);
  return kept;
}
