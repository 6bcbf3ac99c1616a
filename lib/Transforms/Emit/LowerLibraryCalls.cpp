//===- LowerLibraryCalls.cpp - Calls of the device library ----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A function returns by a pointer, as C's conventions for structs differ from
// target to target. The memory is in the first block of the entry, so that a
// call in a loop needs no more of it than one outside, and an optimiser removes
// it where it inlines the function. Forms for lanes get vectors in such memory,
// too.
//
//===----------------------------------------------------------------------===//

#include "LowerLibraryCalls.h"

#include "KernelFunction.h"
#include "WarpDialect/LibraryOps.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;

static LLVM::LLVMFuncOp declare(ModuleOp module, StringRef name,
                                ValueRange operands) {
  if (auto found = module.lookupSymbol<LLVM::LLVMFuncOp>(name))
    return found;
  MLIRContext *context = module.getContext();
  OpBuilder b = OpBuilder::atBlockBegin(module.getBody());
  SmallVector<Type> types(operands.getTypes());
  auto type =
      LLVM::LLVMFunctionType::get(LLVM::LLVMVoidType::get(context), types);
  auto function = LLVM::LLVMFuncOp::create(b, module.getLoc(), name, type);
  function.setNoUnwind(true);
  function.setWillReturn(true);
  return function;
}

/// The address of what lies in the parameter block behind all arguments.
static void lowerMap(warp::LibraryCallOp op, Block &first) {
  OpBuilder b(op);
  Type type = op.getResult(0).getType();
  Value block =
      LLVM::PtrToIntOp::create(b, op.getLoc(), type, first.getArgument(0));
  Value place = LLVM::ZExtOp::create(b, op.getLoc(), type, op.getArgs()[0]);
  op.getResult(0).replaceAllUsesWith(
      LLVM::AddOp::create(b, op.getLoc(), block, place));
  op->erase();
}

static void lower(warp::LibraryCallOp op, ModuleOp module, Block &first) {
  if (op.getCallee() == "warp_tile_map")
    return lowerMap(op, first);
  OpBuilder b(op);
  Location loc = op.getLoc();
  auto record = LLVM::LLVMStructType::getLiteral(
      b.getContext(), SmallVector<Type>(op.getResultTypes()));
  auto pointer = LLVM::LLVMPointerType::get(b.getContext());
  auto reserve = [&](Type type) -> Value {
    OpBuilder::InsertionGuard guard(b);
    b.setInsertionPointToStart(&first);
    Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
    return LLVM::AllocaOp::create(b, loc, pointer, type, one);
  };
  SmallVector<Value> operands;
  int64_t lanes = 0;
  for (Value arg : op.getArgs()) {
    if (auto vector = dyn_cast<VectorType>(arg.getType())) {
      lanes = vector.getNumElements();
      Value values = reserve(vector);
      LLVM::StoreOp::create(b, loc, arg, values);
      arg = values;
    }
    operands.push_back(arg);
  }
  if (lanes)
    operands.push_back(
        LLVM::ConstantOp::create(b, loc, b.getI32IntegerAttr(int32_t(lanes))));
  Value memory = reserve(record);
  operands.push_back(memory);
  LLVM::LLVMFuncOp callee = declare(module, op.getCallee(), operands);
  LLVM::CallOp::create(b, loc, callee, operands);
  for (OpResult result : op->getResults()) {
    auto number = int32_t(result.getResultNumber());
    Value from = LLVM::GEPOp::create(b, loc, pointer, record, memory,
                                     ArrayRef<LLVM::GEPArg>{0, number});
    result.replaceAllUsesWith(
        LLVM::LoadOp::create(b, loc, result.getType(), from));
  }
  op->erase();
}

/// Memory of the thread, one for each number, however often a call was copied.
static LogicalResult placeMemory(warp::LibraryCallOp op, Block &first,
                                 llvm::DenseMap<int64_t, Value> &known) {
  APInt number, bytes;
  if (!matchPattern(op.getArgs()[0], m_ConstantInt(&number)) ||
      !matchPattern(op.getArgs()[1], m_ConstantInt(&bytes)))
    return op.emitError("expects constants for memory of a thread");
  Location loc = op.getLoc();
  Value &address = known[number.getSExtValue()];
  if (!address) {
    OpBuilder b = OpBuilder::atBlockBegin(&first);
    auto type = LLVM::LLVMArrayType::get(b.getI8Type(), bytes.getZExtValue());
    Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
    Value memory = LLVM::AllocaOp::create(
        b, loc, LLVM::LLVMPointerType::get(b.getContext()), type, one,
        /*alignment=*/16);
    address = LLVM::PtrToIntOp::create(b, loc, b.getI64Type(), memory);
  }
  op->replaceAllUsesWith(ValueRange(address));
  op->erase();
  return success();
}

LogicalResult warp::lowerLibraryCalls(ModuleOp module,
                                      FunctionOpInterface entry) {
  SmallVector<LibraryCallOp> calls;
  entry->walk([&](LibraryCallOp op) { calls.push_back(op); });
  // Threads that search wait for memory at each step, and those that could hide
  // it are as many as have registers. Functions of the user are not in the
  // library's table.
  int registers = 0;
  for (LibraryCallOp op : calls)
    if (const LibraryFunction *function = findLibraryFunction(op.getCallee()))
      registers = std::max(registers, function->registers);
  if (getTarget(entry).isSimt() && registers)
    entry->setAttr(attr::mostRegisters,
                   Builder(entry.getContext()).getI64IntegerAttr(registers));
  Block &first = entry.getFunctionBody().front();
  llvm::DenseMap<int64_t, Value> memory;
  for (LibraryCallOp op : calls) {
    if (op.getCallee() != threadMemory)
      lower(op, module, first);
    else if (failed(placeMemory(op, first, memory)))
      return failure();
  }
  return success();
}
