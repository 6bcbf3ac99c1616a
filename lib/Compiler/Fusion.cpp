//===- Fusion.cpp - Kernels of several launches as one --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The bodies stand one after the other in a new kernel, whose arguments are
// those of all parts, each array once. Functions that a part calls come along
// under names of their own. Values still go from part to part through memory,
// so that rounding is that of the separate kernels: multiplications and
// additions of different parts only meet behind warp-fuse-multiply-add, which
// has formed the `fma` of each part by then.
//
// Parts whose launches have the first extent in common alone may run in blocks:
// each block has the threads of all parts for one index of that extent, and
// they wait for each other between parts that share elements.
//
//===----------------------------------------------------------------------===//

#include "warp/Fusion.h"

#include "Context.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/Registry.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/SymbolTable.h"
#include "mlir/IR/Verifier.h"

#include "llvm/ADT/StringSet.h"

using namespace mlir;
using warp::Error;

namespace {

class Fusing {
public:
  Fusing(StringRef name, ArrayRef<warp::FusionPart> parts,
         int64_t blockThreads);
  OwningOpRef<ModuleOp> run();

private:
  func::FuncOp takeKernel(ModuleOp part);
  /// True if blocks of a part have the threads of those of the whole, and work
  /// on tiles together.
  bool hasTiles(func::FuncOp kernel) const {
    auto threads = kernel->getAttrOfType<IntegerAttr>(warp::attr::blockThreads);
    return threads && threads.getInt() == blockThreads;
  }
  void findArguments();
  void createKernel();
  void addPart(const warp::FusionPart &part, func::FuncOp kernel,
               func::FuncOp fused, Operation *end);
  void addRowPart(const warp::FusionPart &part, func::FuncOp kernel,
                  func::FuncOp fused, Operation *end);

  std::string name;
  ArrayRef<warp::FusionPart> parts;
  int64_t blockThreads;
  OwningOpRef<ModuleOp> module;
  /// Copies of the parts, which own their kernels.
  SmallVector<OwningOpRef<ModuleOp>> copies;
  SmallVector<func::FuncOp> kernels;
  SmallVector<Type> types;
  SmallVector<std::string> names;
};

} // namespace

static Error failure(const Twine &message) {
  return Error(Error::Kind::Compile, message.str());
}

Fusing::Fusing(StringRef name, ArrayRef<warp::FusionPart> parts,
               int64_t blockThreads)
    : name(name), parts(parts), blockThreads(blockThreads),
      module(
          ModuleOp::create(UnknownLoc::get(&warp::compilerContext()), name)) {}

/// The kernel of a part.
func::FuncOp Fusing::takeKernel(ModuleOp part) {
  for (auto function : part.getOps<func::FuncOp>()) {
    if (!function->hasAttr(warp::kernelAttrName))
      continue;
    for (NamedAttribute attribute : function->getDiscardableAttrs())
      if (StringRef key = attribute.getName();
          key != warp::kernelAttrName && key != warp::attr::argNames &&
          key != warp::attr::inlineBudget &&
          (key != warp::attr::blockThreads || !hasTiles(function)))
        throw failure("kernel '" + function.getSymName() + "' has '" + key +
                      "'");
    return function;
  }
  throw failure("the module has no kernel");
}

/// Types and names of the arguments, each by the first part that has it.
void Fusing::findArguments() {
  llvm::StringSet<> taken;
  for (auto [part, kernel] : llvm::zip_equal(parts, kernels)) {
    auto given = kernel->getAttrOfType<ArrayAttr>(warp::attr::argNames);
    for (auto [i, number] : llvm::enumerate(part.arguments)) {
      Type type = kernel.getArgumentTypes()[i];
      if (number > int(types.size()) || number < 0)
        throw failure("an argument is missing");
      if (number < int(types.size())) {
        if (types[number] != type)
          throw failure("one argument has two types");
        continue;
      }
      std::string name = given ? cast<StringAttr>(given[i]).str() : "";
      while (!taken.insert(name).second)
        name += '_';
      types.push_back(type);
      names.push_back(std::move(name));
    }
  }
}

void Fusing::createKernel() {
  OpBuilder b = OpBuilder::atBlockEnd(module->getBody());
  Location loc = kernels.front().getLoc();
  auto fused = func::FuncOp::create(b, loc, name, b.getFunctionType(types, {}));
  fused->setAttr(warp::kernelAttrName, b.getUnitAttr());
  SmallVector<StringRef> list(names.begin(), names.end());
  fused->setAttr(warp::attr::argNames, b.getStrArrayAttr(list));
  int64_t budget = 0;
  for (func::FuncOp kernel : kernels)
    if (auto own = kernel->getAttrOfType<IntegerAttr>(warp::attr::inlineBudget))
      budget += own.getInt();
  if (budget)
    fused->setAttr(warp::attr::inlineBudget, b.getI64IntegerAttr(budget));
  b.setInsertionPointToStart(fused.addEntryBlock());
  auto end = func::ReturnOp::create(b, loc);
  if (blockThreads)
    fused->setAttr(warp::attr::blockThreads, b.getI64IntegerAttr(blockThreads));
  for (auto [part, kernel] : llvm::zip_equal(parts, kernels))
    if (blockThreads)
      addRowPart(part, kernel, fused, end);
    else
      addPart(part, kernel, fused, end);
}

/// Copies a part's operations in front of another one.
void Fusing::addPart(const warp::FusionPart &part, func::FuncOp kernel,
                     func::FuncOp fused, Operation *end) {
  OpBuilder b(end);
  IRMapping mapping;
  for (auto [i, number] : llvm::enumerate(part.arguments))
    mapping.map(kernel.getArgument(i), fused.getArgument(number));
  for (Operation &op : kernel.getBody().front().without_terminator())
    // The parts behind it go on where threads of a block return.
    b.clone(op, mapping)->walk([](Operation *inner) {
      inner->removeAttr(warp::attr::stays);
    });
}

/// Gives what asks for the indices of a thread others; null stands for 0.
static void setIndices(Operation *root, ArrayRef<Value> indices) {
  root->walk([&](warp::TidOp tid) {
    OpBuilder b(tid);
    for (auto [value, result] : llvm::zip(indices, tid.getResults())) {
      Value index = value;
      if (!index)
        index = warp::ConstantOp::create(b, tid.getLoc(),
                                         b.getIntegerAttr(result.getType(), 0));
      else if (index.getType() != result.getType())
        index = warp::CastOp::create(b, tid.getLoc(), result.getType(), index);
      result.replaceAllUsesWith(index);
    }
    tid->erase();
  });
}

/// The same for the threads of a row, of which a part has as many as the
/// product of its inner extents.
void Fusing::addRowPart(const warp::FusionPart &part, func::FuncOp kernel,
                        func::FuncOp fused, Operation *end) {
  OpBuilder b(end);
  Location loc = kernel.getLoc();
  Type index = b.getIntegerType(32, /*isSigned=*/true);
  auto constant = [&](int64_t value) -> Value {
    return warp::ConstantOp::create(b, loc, b.getIntegerAttr(index, value));
  };
  auto builtin = [&](StringRef name, Value a, Value other) {
    return warp::createBuiltin(b, loc, name, {a, other})->getResult(0);
  };
  if (part.waits)
    warp::BarrierOp::create(b, loc);
  auto tid = warp::TidOp::create(b, loc, SmallVector<Type>(2, index));
  SmallVector<Value> indices(4);
  indices[0] = tid.getResult(0);
  if (hasTiles(kernel)) {
    // All threads work together, in one block of the row.
    indices[part.inner.size()] = tid.getResult(1);
    Operation *before = tid;
    addPart(part, kernel, fused, end);
    for (Operation *op = before->getNextNode(); op != end;) {
      Operation *next = op->getNextNode();
      setIndices(op, indices);
      op = next;
    }
    return;
  }
  int64_t count = 1;
  for (int64_t extent : part.inner)
    count *= extent;
  Value isIn = builtin("lt", tid.getResult(1), constant(count));
  auto branch = scf::IfOp::create(b, loc, isIn, /*withElseRegion=*/false);
  b.setInsertionPoint(branch.thenBlock()->getTerminator());
  // The indices of the part's own launch.
  Value rest = tid.getResult(1);
  for (size_t i = part.inner.size(); i-- > 0;) {
    Value extent = constant(part.inner[i]);
    indices[i + 1] = i ? builtin("mod", rest, extent) : rest;
    if (i)
      rest = builtin("floordiv", rest, extent);
  }
  addPart(part, kernel, fused, branch.thenBlock()->getTerminator());
  setIndices(branch, indices);
}

OwningOpRef<ModuleOp> Fusing::run() {
  for (auto [number, part] : llvm::enumerate(parts)) {
    ModuleOp given = *part.module->getImpl()->op;
    copies.emplace_back(given.clone());
    ModuleOp copy = *copies.back();
    kernels.push_back(takeKernel(copy));
    if (kernels.back().getNumArguments() != part.arguments.size() ||
        !kernels.back().getBody().hasOneBlock())
      throw failure("a kernel has other arguments");
    for (auto function : copy.getOps<func::FuncOp>()) {
      std::string own = (function.getSymName() + "_part" + Twine(number)).str();
      auto symbol = StringAttr::get(copy.getContext(), own);
      if (failed(SymbolTable::replaceAllSymbolUses(function, symbol, copy)))
        throw failure("a function cannot be renamed");
      function.setSymName(own);
      if (blockThreads && function != kernels.back() &&
          function.walk([](warp::TidOp) { return WalkResult::interrupt(); })
              .wasInterrupted())
        throw failure("a function has the index of the thread");
    }
  }
  findArguments();
  createKernel();
  for (auto [copy, kernel] : llvm::zip_equal(copies, kernels)) {
    kernel.erase();
    module->getBody()->getOperations().splice(module->getBody()->end(),
                                              copy->getBody()->getOperations());
  }
  return std::move(module);
}

warp::Module warp::fuseKernels(const std::string &name,
                               const std::vector<FusionPart> &parts,
                               int64_t blockThreads) {
  ContextLock lock;
  Diagnostics diagnostics;
  auto made = std::make_shared<Module::Impl>();
  made->op = Fusing(name, parts, blockThreads).run();
  if (failed(verify(*made->op)))
    throw diagnostics.toError(Error::Kind::Compile, "invalid IR");
  return Module(std::move(made));
}
