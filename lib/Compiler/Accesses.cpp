//===- Accesses.cpp - Which arrays a kernel reads and writes --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The tape asks which arrays a launch changes. The answer is a data flow over
// all functions of a module: every array, and every array in a struct, knows
// the arguments of the kernel that it may stand for, and accesses mark those.
// Calls join what their callers pass; arrays carried by loops and branches join
// everything of their type that enters there. So the answer may name an array
// too many, never one too few. Arrays that are loaded from arrays of structs
// are not seen.
//
//===----------------------------------------------------------------------===//

#include "Context.h"

#include "warp/Compile.h"

#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/WarpDialect.h"
#include "WarpDialect/WarpOps.h"
#include "WarpDialect/WarpTypes.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"
#include "mlir/Interfaces/SideEffectInterfaces.h"

#include "llvm/ADT/SmallBitVector.h"

using namespace mlir;

static unsigned countArrays(mlir::Type type) {
  SmallVector<warp::Leaf> leaves;
  if (isa<warp::ArrayType, warp::StructType>(type))
    warp::collectLeaves(type, 0, leaves);
  return llvm::count_if(leaves, [](const warp::Leaf &leaf) {
    return isa<warp::ArrayType>(leaf.type);
  });
}

/// Arrays of a struct that come before those of a field.
static unsigned firstOfField(warp::StructType type, StringRef field) {
  unsigned first = 0;
  for (int64_t i = 0, end = type.getFieldIndex(field); i < end; ++i)
    first += countArrays(type.getFieldTypes()[i]);
  return first;
}

namespace {

/// For each array in a value, the arguments it may stand for.
using Origins = SmallVector<llvm::SmallBitVector>;

class AccessFlow {
public:
  AccessFlow(ModuleOp module, func::FuncOp kernel);
  std::vector<warp::Access> take() { return std::move(accesses); }

private:
  void visit(Operation *op);
  void visitCall(func::CallOp call);
  void visitRegions(Operation *op);
  void mark(Operation *op);
  void locate(func::FuncOp kernel);
  Origins &of(Value value);
  void join(Value target, Value source, unsigned to = 0, unsigned from = 0);

  ModuleOp module;
  unsigned count = 0;
  bool changed = true;
  DenseMap<Value, Origins> origins;
  std::vector<warp::Access> accesses;
};

} // namespace

AccessFlow::AccessFlow(ModuleOp module, func::FuncOp kernel) : module(module) {
  for (mlir::Type type : kernel.getArgumentTypes())
    count += countArrays(type);
  accesses.resize(count);
  unsigned next = 0;
  for (Value argument : kernel.getArguments())
    for (llvm::SmallBitVector &set : of(argument))
      set.set(next++);
  while (changed) {
    changed = false;
    module.walk([&](Operation *op) { visit(op); });
  }
  module.walk([&](Operation *op) { mark(op); });
  locate(kernel);
}

/// Where the arrays lie in the parameter block.
void AccessFlow::locate(func::FuncOp kernel) {
  bool usesGradients =
      module.walk([](warp::GradOp) { return WalkResult::interrupt(); })
          .wasInterrupted();
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

Origins &AccessFlow::of(Value value) {
  auto [place, inserted] = origins.try_emplace(value);
  if (inserted)
    place->second.assign(countArrays(value.getType()),
                         llvm::SmallBitVector(count));
  return place->second;
}

/// Adds the arrays of `source` from number `from` on to those of `target` from
/// number `to` on, as many as both have.
void AccessFlow::join(Value target, Value source, unsigned to, unsigned from) {
  Origins added = of(source);
  Origins &all = of(target);
  for (; to < all.size() && from < added.size(); ++to, ++from) {
    if (!added[from].test(all[to]))
      continue;
    all[to] |= added[from];
    changed = true;
  }
}

void AccessFlow::visit(Operation *op) {
  if (auto get = dyn_cast<warp::StructGetOp>(op)) {
    auto type = cast<warp::StructType>(get.getSource().getType());
    join(get.getResult(), get.getSource(), 0,
         firstOfField(type, get.getField()));
  } else if (auto set = dyn_cast<warp::StructSetOp>(op)) {
    auto type = cast<warp::StructType>(set.getTarget().getType());
    join(set.getResult(), set.getTarget());
    join(set.getResult(), set.getValue(), firstOfField(type, set.getField()));
  } else if (auto create = dyn_cast<warp::StructCreateOp>(op)) {
    unsigned next = 0;
    for (Value field : create.getFields()) {
      join(create.getResult(), field, next);
      next += countArrays(field.getType());
    }
  } else if (auto call = dyn_cast<func::CallOp>(op)) {
    visitCall(call);
  } else if (op->getNumRegions() && !isa<func::FuncOp, ModuleOp>(op)) {
    visitRegions(op);
  } else {
    for (Value result : op->getResults())
      for (Value operand : op->getOperands())
        if (isa<warp::ArrayType>(result.getType()) &&
            isa<warp::ArrayType>(operand.getType()))
          join(result, operand);
  }
}

void AccessFlow::visitCall(func::CallOp call) {
  auto callee = module.lookupSymbol<func::FuncOp>(call.getCallee());
  if (!callee || callee.isExternal())
    return;
  for (auto [argument, operand] :
       llvm::zip(callee.getArguments(), call.getOperands()))
    join(argument, operand);
  callee.walk([&](func::ReturnOp end) {
    for (auto [result, value] : llvm::zip(call.getResults(), end.getOperands()))
      join(result, value);
  });
}

void AccessFlow::visitRegions(Operation *op) {
  SmallVector<Value> sources(op->getOperands()), targets(op->getResults());
  for (Region &region : op->getRegions())
    for (Block &block : region) {
      llvm::append_range(targets, block.getArguments());
      if (block.mightHaveTerminator())
        llvm::append_range(sources, block.getTerminator()->getOperands());
    }
  for (Value target : targets)
    for (Value source : sources)
      if (target.getType() == source.getType() &&
          countArrays(target.getType()))
        join(target, source);
}

void AccessFlow::mark(Operation *op) {
  auto effects = dyn_cast<MemoryEffectOpInterface>(op);
  if (!effects)
    return;
  SmallVector<MemoryEffects::EffectInstance> instances;
  effects.getEffects(instances);
  llvm::SmallBitVector read(count), written(count);
  for (MemoryEffects::EffectInstance &effect : instances) {
    Value array = effect.getValue();
    if (!array || !isa<warp::ArrayType>(array.getType()))
      continue;
    if (isa<MemoryEffects::Read>(effect.getEffect()))
      read |= of(array).front();
    if (isa<MemoryEffects::Write>(effect.getEffect()))
      written |= of(array).front();
  }
  auto place = warp::findSourceLocation(op->getLoc());
  for (unsigned leaf = 0; leaf < count; ++leaf) {
    warp::Access &access = accesses[leaf];
    access.loaded |= read[leaf] && !written[leaf];
    access.stored |= written[leaf] && !read[leaf];
    access.combined |= read[leaf] && written[leaf];
    access.fetched |= read[leaf] && written[leaf] && !op->use_empty();
    if (written[leaf] && place && !access.line)
      access.line = place.getLine();
  }
}

std::vector<warp::Access> warp::accesses(const Module &module) {
  ContextLock lock;
  ModuleOp op = *module.getImpl()->op;
  for (auto function : op.getOps<func::FuncOp>())
    if (function->hasAttr(kernelAttrName))
      return AccessFlow(op, function).take();
  throw Error(Error::Kind::Compile, "the module has no kernel");
}
