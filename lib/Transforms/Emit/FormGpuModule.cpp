//===- FormGpuModule.cpp - Outlining of kernels to gpu.module -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The `gpu` dialect is what compilers for GPUs of several makers have in common
// in MLIR. Before the code becomes NVIDIA's, a launch for a GPU is put in its
// terms, and nothing of our own dialect is left:
//
//   module                       module
//     declarations, functions      gpu.module
//     variables of a block  ==>      declarations, functions
//     llvm.func, the entry           gpu.func kernel, its variables of a block
//                                      are workgroup buffers
//
// Ids, barriers and shuffles are operations of that dialect since they were
// made (GpuBlock.cpp). The entry becomes a `gpu.func` this late because it is a
// function with pointers all the way, as it is on the CPU, and the passes that
// lower it serve both.
//
// An entry for the CPU stays as it is.
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "Launch/GpuBlock.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/MemRef/IR/MemRef.h"

namespace warp {
#define GEN_PASS_DEF_FORMGPUMODULE
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;

/// A buffer of a kernel for a variable of its block.
static Value addBuffer(gpu::GPUFuncOp kernel, LLVM::GlobalOp variable) {
  MLIRContext *context = kernel.getContext();
  auto array = cast<LLVM::LLVMArrayType>(variable.getType());
  auto space = gpu::AddressSpaceAttr::get(context,
                                          gpu::AddressSpace::Workgroup);
  auto type = MemRefType::get(int64_t(array.getNumElements()),
                              array.getElementType(), AffineMap(), space);
  unsigned number = kernel.getNumWorkgroupAttributions();
  Value buffer = kernel.addWorkgroupAttribution(type, variable.getLoc());
  if (IntegerAttr alignment = variable.getAlignmentAttr())
    kernel.setWorkgroupAttributionAttr(
        number, LLVM::LLVMDialect::getAlignAttrName(), alignment);
  return buffer;
}

/// The start of a buffer, as the pointer that its variable had.
static Value getPointer(OpBuilder &b, Location loc, Value buffer, Type type) {
  Value index = memref::ExtractAlignedPointerAsIndexOp::create(b, loc, buffer);
  Value address =
      arith::IndexCastOp::create(b, loc, b.getI64Type(), index);
  return LLVM::IntToPtrOp::create(b, loc, type, address);
}

static void replaceBlockVariables(gpu::GPUFuncOp kernel,
                                  gpu::GPUModuleOp module) {
  SmallVector<LLVM::AddressOfOp> uses;
  kernel.walk([&](LLVM::AddressOfOp use) { uses.push_back(use); });
  llvm::MapVector<Operation *, Value> buffers;
  for (LLVM::AddressOfOp use : uses) {
    auto variable = module.lookupSymbol<LLVM::GlobalOp>(use.getGlobalName());
    // The size that launches ask for stays open: it has no size here.
    if (!variable || variable.getAddrSpace() != warp::sharedSpace ||
        variable.getLinkage() == LLVM::Linkage::External)
      continue;
    Value &buffer = buffers[variable];
    if (!buffer)
      buffer = addBuffer(kernel, variable);
    OpBuilder b(use);
    use.replaceAllUsesWith(getPointer(b, use.getLoc(), buffer, use.getType()));
    use.erase();
  }
  for (auto &[variable, buffer] : buffers)
    variable->erase();
}

static gpu::GPUFuncOp toGpuFunc(LLVM::LLVMFuncOp entry) {
  OpBuilder b(entry);
  auto type = b.getFunctionType(entry.getArgumentTypes(), TypeRange());
  auto kernel =
      gpu::GPUFuncOp::create(b, entry.getLoc(), entry.getName(), type);
  for (NamedAttribute fact : entry->getDiscardableAttrs())
    kernel->setAttr(fact.getName(), fact.getValue());
  kernel->setAttr(gpu::GPUDialect::getKernelFuncAttrName(), b.getUnitAttr());
  if (ArrayAttr facts = entry.getArgAttrsAttr())
    kernel.setArgAttrsAttr(facts);
  kernel.getBody().takeBody(entry.getBody());
  for (Block &block : kernel.getBody())
    if (auto leave = dyn_cast<LLVM::ReturnOp>(block.getTerminator())) {
      OpBuilder b(leave);
      gpu::ReturnOp::create(b, leave.getLoc());
      leave.erase();
    }
  entry.erase();
  return kernel;
}

namespace {

struct FormGpuModule : warp::impl::FormGpuModuleBase<FormGpuModule> {
  void runOnOperation() override {
    FunctionOpInterface found = warp::findEntry(getOperation());
    if (!found)
      return signalPassFailure();
    auto entry = dyn_cast<LLVM::LLVMFuncOp>(found.getOperation());
    if (!entry || !warp::getTarget(entry).isSimt())
      return;
    Block *outside = getOperation().getBody();
    OpBuilder b(&getContext());
    auto module =
        gpu::GPUModuleOp::create(b, entry.getLoc(), entry.getName());
    Block *inside = &module.getBodyRegion().front();
    inside->getOperations().splice(inside->begin(), outside->getOperations());
    outside->push_back(module);
    replaceBlockVariables(toGpuFunc(entry), module);
  }
};

} // namespace
