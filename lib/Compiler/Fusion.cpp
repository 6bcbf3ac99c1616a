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
//===----------------------------------------------------------------------===//

#include "warp/Fusion.h"

#include "Context.h"

#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"
#include "WarpDialect/WarpDialect.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/IR/IRMapping.h"
#include "mlir/IR/SymbolTable.h"
#include "mlir/IR/Verifier.h"

#include "llvm/ADT/StringSet.h"

using namespace mlir;
using warp::Error;

namespace {

class Fusing {
public:
  Fusing(StringRef name, ArrayRef<warp::FusionPart> parts);
  OwningOpRef<ModuleOp> run();

private:
  func::FuncOp takeKernel(ModuleOp part);
  void findArguments();
  void createKernel();

  std::string name;
  ArrayRef<warp::FusionPart> parts;
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

Fusing::Fusing(StringRef name, ArrayRef<warp::FusionPart> parts)
    : name(name), parts(parts),
      module(
          ModuleOp::create(UnknownLoc::get(&warp::compilerContext()), name)) {}

/// The kernel of a part.
func::FuncOp Fusing::takeKernel(ModuleOp part) {
  for (auto function : part.getOps<func::FuncOp>()) {
    if (!function->hasAttr(warp::kernelAttrName))
      continue;
    for (NamedAttribute attribute : function->getDiscardableAttrs())
      if (StringRef key = attribute.getName(); key != warp::kernelAttrName &&
                                               key != warp::attr::argNames &&
                                               key != warp::attr::inlineBudget)
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
  for (auto [part, kernel] : llvm::zip_equal(parts, kernels)) {
    IRMapping mapping;
    for (auto [i, number] : llvm::enumerate(part.arguments))
      mapping.map(kernel.getArgument(i), fused.getArgument(number));
    for (Operation &op : kernel.getBody().front().without_terminator())
      b.clone(op, mapping);
  }
  func::ReturnOp::create(b, loc);
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
                               const std::vector<FusionPart> &parts) {
  ContextLock lock;
  Diagnostics diagnostics;
  auto made = std::make_shared<Module::Impl>();
  made->op = Fusing(name, parts).run();
  if (failed(verify(*made->op)))
    throw diagnostics.toError(Error::Kind::Compile, "invalid IR");
  return Module(std::move(made));
}
