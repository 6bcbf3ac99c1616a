//===- Accesses.cpp - Array access analysis of a kernel -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The tape asks which arrays a launch changes, in the kernel or in what it
// calls. Arrays that are loaded from arrays of structs are not seen.
//
//===----------------------------------------------------------------------===//

#include "Analysis/ArrayOrigins.h"
#include "Context.h"

#include "warp/Compile.h"
#include "warp/NativeCode.h"

#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"

using namespace mlir;

namespace {

/// Adds up what the operations of a module do to the leaves of its kernel.
class Summary {
public:
  Summary(ModuleOp module, func::FuncOp kernel)
      : kernel(kernel), origins(kernel), accesses(origins.getLeaves().size()),
        hasWhile(
            module.walk([](scf::WhileOp) { return WalkResult::interrupt(); })
                .wasInterrupted()) {
    origins.freeze();
  }

  void add(warp::AccessOp op);
  void add(warp::TileAccessOp op);
  /// The same of an array whose address native code gets.
  void addNative(warp::PointerOp op);
  void locate(func::FuncOp kernel, bool usesGradients);
  std::vector<warp::Access> take() { return std::move(accesses); }

private:
  bool mayBeWatched(Operation *op) const;

  func::FuncOp kernel;
  warp::ArrayOrigins origins;
  std::vector<warp::Access> accesses;
  bool hasWhile;
};

} // namespace

/// True if a loop goes from element to element: several may be loaded, or
/// stored, at once.
static bool goesAlong(warp::AccessOp op) {
  Operation *loop = op->getParentOp();
  return isa<scf::ForOp>(loop) && !op.getIndices().empty() &&
         loop->isAncestor(
             op.getIndices().back().getParentBlock()->getParentOp());
}

/// True if a loop may end by what the operation loads: one around it, or around
/// a call of the function that it is in.
bool Summary::mayBeWatched(Operation *op) const {
  return hasWhile && (op->getParentOfType<scf::WhileOp>() ||
                      op->getParentOfType<func::FuncOp>() != kernel);
}

void Summary::add(warp::AccessOp op) {
  auto place = warp::findSourceLocation(op->getLoc());
  for (warp::ArrayMemory memory : origins.of(op.getArray()).memories) {
    warp::Access &access = accesses[memory.leaf];
    access.loaded |= !op.mayWrite();
    access.stored |= !op.mayRead();
    access.combined |= op.isUpdate();
    access.fetched |= op.isUpdate() && !op->use_empty();
    access.watched |= goesAlong(op) || (op.mayRead() && mayBeWatched(op));
    if (op.mayWrite() && place && !access.line)
      access.line = place.getLine();
  }
}

void Summary::add(warp::TileAccessOp op) {
  bool loads = !op.mayWrite();
  auto place = warp::findSourceLocation(op->getLoc());
  for (warp::ArrayMemory memory : origins.of(op.getArray()).memories) {
    warp::Access &access = accesses[memory.leaf];
    access.loaded |= loads;
    access.stored |= op.getEffect() == warp::AccessEffect::Write;
    access.combined |= op.isUpdate();
    access.fetched |= op.isUpdate() && !op->use_empty();
    // A tile that nothing overwrites needs no memory until it is used.
    access.watched |= loads;
    if (!loads && place && !access.line)
      access.line = place.getLine();
  }
}

void Summary::addNative(warp::PointerOp op) {
  auto place = warp::findSourceLocation(op.getLoc());
  for (warp::ArrayMemory memory : origins.of(op.getArray()).memories) {
    warp::Access &access = accesses[memory.leaf];
    access.loaded = access.stored = access.watched = true;
    if (place && !access.line)
      access.line = place.getLine();
  }
}

static bool isForNativeCode(warp::PointerOp op) {
  return llvm::any_of(op->getUsers(), [](Operation *user) {
    auto call = dyn_cast<warp::LibraryCallOp>(user);
    return call && call.getCallee().starts_with(warp::nativeMemoryPrefix);
  });
}

/// Finds the places of the arrays in the parameter block.
void Summary::locate(func::FuncOp kernel, bool usesGradients) {
  warp::ParameterLayout layout =
      warp::layOutParameters(kernel.getArgumentTypes());
  unsigned next = 0;
  for (auto [type, offset] :
       llvm::zip_equal(kernel.getArgumentTypes(), layout.offsets)) {
    SmallVector<warp::Leaf> leaves;
    warp::collectLeaves(type, offset, leaves);
    for (warp::Leaf leaf : leaves) {
      auto array = dyn_cast<warp::ArrayType>(leaf.type);
      if (!array)
        continue;
      warp::Access &access = accesses[next++];
      access.offset = leaf.offset;
      mlir::Type element = array.getElementType();
      access.elementSize = warp::getByteSize(element);
      if (usesGradients)
        access.gradientSize =
            warp::getByteSize(warp::getGradientElement(element));
    }
  }
}

std::vector<warp::Access> warp::accesses(const Module &module) {
  ContextLock lock;
  ModuleOp op = *module.getImpl()->op;
  for (auto function : op.getOps<func::FuncOp>()) {
    if (!function->hasAttr(kernelAttrName))
      continue;
    Summary summary(op, function);
    op.walk([&](AccessOp access) { summary.add(access); });
    op.walk([&](TileAccessOp access) { summary.add(access); });
    op.walk([&](PointerOp pointer) {
      if (isForNativeCode(pointer))
        summary.addNative(pointer);
    });
    bool usesGradients = op.walk([](GradOp) {
                             return WalkResult::interrupt();
                           }).wasInterrupted();
    summary.locate(function, usesGradients);
    return summary.take();
  }
  throw Error(Error::Kind::Compile, "the module has no kernel");
}
