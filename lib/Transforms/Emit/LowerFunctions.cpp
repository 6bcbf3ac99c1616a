//===- LowerFunctions.cpp - Lowering of out-of-line functions -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Arguments and results go by value: scalars, and arrays as structs of pointer,
// extents and strides. Several results are one struct, which processors return
// in registers as far as these reach, and GPUs in `.param` space, which their
// assembler keeps in registers.
//
// On x86-64 functions with more than two floats as results follow
// `x86_regcallcc`, which has 16 vector registers for results: C's convention
// returns the third on the stack of the x87, of which LLVM 22 makes illegal
// instructions in long code. Others do not, as it has callees save registers.
//
//===----------------------------------------------------------------------===//

#include "LowerFunctions.h"

#include "KernelFunction.h"
#include "WarpDialect/CallAttributes.h"
#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

using namespace mlir;

static LLVM::CConv conventionFor(Operation *function, TypeRange results) {
  bool isLong = llvm::count_if(results, llvm::IsaPred<FloatType>) > 2;
  return isLong && warp::getTarget(function).returnsOnX87()
             ? LLVM::CConv::X86_RegCall
             : LLVM::CConv::C;
}

/// The type that stands for several results.
static Type resultType(MLIRContext *context, TypeRange types) {
  if (types.empty())
    return LLVM::LLVMVoidType::get(context);
  return types.size() == 1 ? types[0]
                           : LLVM::LLVMStructType::getLiteral(
                                 context, SmallVector<Type>(types));
}

/// Functions that neither read nor write memory, so that equal calls are one.
static llvm::DenseSet<Operation *> findPure(ModuleOp module) {
  llvm::DenseSet<Operation *> pure;
  for (size_t before = ~size_t(0); before != pure.size();) {
    before = pure.size();
    for (auto function : module.getOps<func::FuncOp>()) {
      WalkResult result = function.getBody().walk([&](Operation *op) {
        auto call = dyn_cast<func::CallOp>(op);
        bool isPure = call
                          ? pure.contains(module.lookupSymbol(call.getCallee()))
                          : op->getNumRegions() != 0 ||
                                op->hasTrait<OpTrait::IsTerminator>() ||
                                isMemoryEffectFree(op);
        return isPure ? WalkResult::advance() : WalkResult::interrupt();
      });
      if (!result.wasInterrupted())
        pure.insert(function);
    }
  }
  return pure;
}

SmallVector<LLVM::LLVMFuncOp>
warp::emitFunctions(LLVM::LLVMFuncOp entry, function_ref<Type(Type)> convert) {
  auto module = entry->getParentOfType<ModuleOp>();
  MLIRContext *context = module.getContext();
  SmallVector<LLVM::LLVMFuncOp> functions;
  llvm::DenseSet<Operation *> pure = findPure(module);
  for (auto source :
       llvm::make_early_inc_range(module.getOps<func::FuncOp>())) {
    if (!source->hasAttr(attr::kept))
      continue;
    OpBuilder b(source);
    auto type = LLVM::LLVMFunctionType::get(
        resultType(context, source.getResultTypes()),
        llvm::map_to_vector(source.getArgumentTypes(), convert));
    auto function = LLVM::LLVMFuncOp::create(
        b, source.getLoc(), source.getName(), type, LLVM::Linkage::Internal);
    function->setAttr(attr::kept, b.getUnitAttr());
    for (StringRef fact : {attr::variant, attr::schedule})
      if (Attribute value = entry->getAttr(fact))
        function->setAttr(fact, value);
    function.setNoInline(true);
    function.setNoUnwind(true);
    function.setCConv(conventionFor(entry, source.getResultTypes()));
    // On GPUs threads may do something together in it.
    SmallVector<StringRef> facts{attr::kept};
    if (getTarget(entry).isSimt())
      facts.push_back("convergent");
    function.setPassthroughAttr(b.getStrArrayAttr(facts));
    if (pure.contains(source)) {
      auto none = LLVM::ModRefInfo::NoModRef;
      function.setMemoryEffectsAttr(LLVM::MemoryEffectsAttr::get(
          context, none, none, none, none, none, none));
    }
    function.getBody().takeBody(source.getBody());
    source.erase();
    functions.push_back(function);
  }
  return functions;
}

static void lowerReturn(func::ReturnOp op) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  SmallVector<Value> values(op.getOperands());
  if (values.size() > 1) {
    Type type = resultType(b.getContext(), op.getOperandTypes());
    Value all = LLVM::UndefOp::create(b, loc, type);
    for (auto [i, value] : llvm::enumerate(values))
      all = LLVM::InsertValueOp::create(b, loc, all, value, int64_t(i));
    values.assign({all});
  }
  LLVM::ReturnOp::create(b, loc, values);
  op.erase();
}

static void lowerCall(func::CallOp op, LLVM::CConv convention) {
  OpBuilder b(op);
  Location loc = op.getLoc();
  SmallVector<Type> types;
  if (op.getNumResults() != 0)
    types.push_back(resultType(b.getContext(), op.getResultTypes()));
  auto call =
      LLVM::CallOp::create(b, loc, types, op.getCallee(), op.getOperands());
  call.setCConv(convention);
  if (op.getNumResults() == 1)
    op.getResult(0).replaceAllUsesWith(call.getResult());
  else
    for (auto [i, result] : llvm::enumerate(op.getResults()))
      result.replaceAllUsesWith(
          LLVM::ExtractValueOp::create(b, loc, call.getResult(), int64_t(i)));
  op.erase();
}

void warp::lowerCalls(LLVM::LLVMFuncOp function) {
  SmallVector<Operation *> found;
  function.walk([&](Operation *op) {
    if (isa<func::CallOp, func::ReturnOp>(op))
      found.push_back(op);
  });
  for (Operation *op : found)
    if (auto call = dyn_cast<func::CallOp>(op))
      lowerCall(call, conventionFor(function, call.getResultTypes()));
    else
      lowerReturn(cast<func::ReturnOp>(op));
}
