//===- Lowering.cpp - AMDGPU intrinsics, address spaces and entries -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operations of the `gpu` dialect become intrinsics of LLVM's AMDGPU target
// directly: MLIR's patterns would need another dialect in this library. As LLVM
// wants it for amdgcn (AMDGPU usage, address spaces), parameters are read from
// constant memory, and memory of a thread lies in an address space of its own.
//
//===----------------------------------------------------------------------===//

#include "Amd.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/GPU/IR/GPUDialect.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/MemRef/IR/MemRef.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/BuiltinOps.h"

using namespace mlir;
using namespace warp;

/// Address spaces of LLVM's amdgcn.
static constexpr unsigned sharedSpace = 3, constantSpace = 4, privateSpace = 5;

static Value constant(OpBuilder &b, Location loc, int32_t value) {
  return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
}

static Value call(OpBuilder &b, Location loc, Type type, StringRef name,
                  ValueRange operands) {
  return LLVM::CallIntrinsicOp::create(b, loc, type, b.getStringAttr(name),
                                       operands)
      .getResult(0);
}

static void call(OpBuilder &b, Location loc, StringRef name) {
  LLVM::CallIntrinsicOp::create(b, loc, b.getStringAttr(name), ValueRange());
}

static LLVM::LLVMPointerType pointerTo(OpBuilder &b, unsigned space = 0) {
  return LLVM::LLVMPointerType::get(b.getContext(), space);
}

/// Accesses of the threads of a scope before and after it are ordered.
static void synchronize(OpBuilder &b, Location loc, StringRef scope,
                        StringRef barrier) {
  LLVM::FenceOp::create(b, loc, LLVM::AtomicOrdering::release, scope);
  call(b, loc, barrier);
  LLVM::FenceOp::create(b, loc, LLVM::AtomicOrdering::acquire, scope);
}

void AmdTarget::declareEntry(LLVM::LLVMFuncOp entry, int64_t bytes,
                             int64_t alignment) const {
  Builder b(entry.getContext());
  auto block = LLVM::LLVMArrayType::get(b.getI8Type(), bytes);
  entry.setArgAttr(0, "llvm.byref", TypeAttr::get(block));
  entry.setArgAttr(0, "llvm.align", b.getI64IntegerAttr(alignment));
}

//===----------------------------------------------------------------------===//
// Subgroups and blocks
//===----------------------------------------------------------------------===//

Value AmdTarget::emitBallot(OpBuilder &b, Location loc, Value condition) const {
  Type lanes = b.getIntegerType(getSubgroupSize());
  std::string name = "llvm.amdgcn.ballot.i" + std::to_string(getSubgroupSize());
  return call(b, loc, lanes, name, condition);
}

/// The ballot counts lanes that are here.
Value AmdTarget::emitIsFull(OpBuilder &b, Location loc) const {
  Value yes = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  return emitVoteAll(b, loc, yes);
}

Value AmdTarget::emitVoteAll(OpBuilder &b, Location loc,
                             Value condition) const {
  Value lanes = emitBallot(b, loc, condition);
  Value all =
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(lanes.getType(), -1));
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, lanes, all);
}

Value AmdTarget::emitActiveLanes(OpBuilder &b, Location loc) const {
  Value yes = arith::ConstantOp::create(b, loc, b.getBoolAttr(true));
  return emitBallot(b, loc, yes);
}

Value AmdTarget::emitAgree(OpBuilder &b, Location loc, Value value,
                           Value) const {
  Value first =
      call(b, loc, b.getI64Type(), "llvm.amdgcn.readfirstlane.i64", value);
  Value differs =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, value, first);
  Value lanes = emitBallot(b, loc, differs);
  Value none =
      arith::ConstantOp::create(b, loc, b.getIntegerAttr(lanes.getType(), 0));
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, lanes, none);
}

/// Lanes of a wavefront go through code together.
void AmdTarget::emitSubgroupBarrier(OpBuilder &b, Location loc, Value) const {
  synchronize(b, loc, "wavefront", "llvm.amdgcn.wave.barrier");
}

/// By a word of shared memory: all threads clear it, some set it, all read it.
Value AmdTarget::emitBlockAny(OpBuilder &b, Location loc,
                              Value condition) const {
  Operation *op = b.getInsertionBlock()->getParentOp();
  auto module = op->getParentOfType<ModuleOp>();
  OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
  std::string name = "block_any";
  for (unsigned i = 0; module.lookupSymbol(name); ++i)
    name = "block_any_" + std::to_string(i);
  auto type = LLVM::LLVMArrayType::get(b.getI32Type(), 1);
  auto word = LLVM::GlobalOp::create(
      inModule, loc, type, /*isConstant=*/false, LLVM::Linkage::Internal, name,
      /*value=*/Attribute(), /*alignment=*/4, sharedSpace);
  inModule.createBlock(&word.getInitializerRegion());
  LLVM::ReturnOp::create(inModule, loc,
                         LLVM::UndefOp::create(inModule, loc, type));
  Value place = LLVM::AddressOfOp::create(b, loc, word);
  auto barrier = [&] { gpu::BarrierOp::create(b, loc); };
  LLVM::StoreOp::create(b, loc, constant(b, loc, 0), place, 4);
  barrier();
  Value number = arith::ExtUIOp::create(b, loc, b.getI32Type(), condition);
  LLVM::AtomicRMWOp::create(b, loc, LLVM::AtomicBinOp::_or, place, number,
                            LLVM::AtomicOrdering::monotonic, getBlockScope(),
                            4);
  barrier();
  Value any = LLVM::LoadOp::create(b, loc, b.getI32Type(), place, 4);
  // Nobody clears it for the next time before all have read it.
  barrier();
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, any,
                               constant(b, loc, 0));
}

//===----------------------------------------------------------------------===//
// Instructions and functions
//===----------------------------------------------------------------------===//

/// Within 1 ulp; it always takes subnormal numbers for zeros.
Value AmdTarget::emitRsqrt(OpBuilder &b, Location loc, Value x, bool) const {
  return call(b, loc, b.getF32Type(), "llvm.amdgcn.rsq.f32", x);
}

void AmdTarget::emitPrintf(OpBuilder &b, Location loc, ModuleOp module,
                           Value format, Value buffer, int64_t bytes) const {
  StringRef name = "warp_gpu_printf";
  auto print = module.lookupSymbol<LLVM::LLVMFuncOp>(name);
  if (!print) {
    OpBuilder inModule = OpBuilder::atBlockBegin(module.getBody());
    auto type = LLVM::LLVMFunctionType::get(
        b.getI32Type(), {format.getType(), buffer.getType(), b.getI32Type()});
    print = LLVM::LLVMFuncOp::create(inModule, loc, name, type);
  }
  LLVM::CallOp::create(
      b, loc, print,
      ValueRange{format, buffer, constant(b, loc, int32_t(bytes))});
}

/// The device library has all that LLVM does not expand inline.
std::string AmdTarget::getMathFunction(StringRef name, bool isSingle,
                                       bool) const {
  if (name == "rsqrt" || name == "fmod")
    return "";
  StringRef prefix =
      isSingle && (name == "sin" || name == "cos") ? "warp_gpu_" : "warp_";
  return (prefix + name + (isSingle ? "f" : "")).str();
}

//===----------------------------------------------------------------------===//
// Conversion
//===----------------------------------------------------------------------===//

namespace {

/// Replaces the operations of the `gpu` dialect in one module.
class KernelLowering {
public:
  KernelLowering(gpu::GPUModuleOp module, int64_t waveSize)
      : module(module), waveSize(waveSize), b(module.getContext()) {}

  void run() {
    SmallVector<Operation *> ops;
    module.walk([&](Operation *op) {
      if (isa_and_nonnull<gpu::GPUDialect>(op->getDialect()))
        ops.push_back(op);
    });
    for (Operation *op : ops) {
      b.setInsertionPoint(op);
      loc = op->getLoc();
      if (Value value = lower(op)) {
        op->getResult(0).replaceAllUsesWith(value);
        op->erase();
      }
    }
    for (auto kernel :
         llvm::make_early_inc_range(module.getOps<gpu::GPUFuncOp>()))
      toFunction(kernel);
  }

private:
  Value i32(StringRef intrinsic, ValueRange operands = {}) {
    return call(b, *loc, b.getI32Type(), intrinsic, operands);
  }
  Value toIndex(Value number) {
    return arith::IndexCastOp::create(b, *loc, b.getIndexType(), number);
  }

  static std::string along(StringRef intrinsic, gpu::Dimension dimension) {
    return (intrinsic + "." + gpu::stringifyDimension(dimension)).str();
  }

  /// The value that replaces a result; null for operations without.
  Value lower(Operation *op) {
    if (auto id = dyn_cast<gpu::ThreadIdOp>(op))
      return toIndex(i32(along("llvm.amdgcn.workitem.id", id.getDimension())));
    if (auto id = dyn_cast<gpu::BlockIdOp>(op))
      return toIndex(i32(along("llvm.amdgcn.workgroup.id", id.getDimension())));
    if (auto extent = dyn_cast<gpu::BlockDimOp>(op))
      return toIndex(blockDim(extent.getDimension()));
    if (auto extent = dyn_cast<gpu::GridDimOp>(op)) {
      gpu::Dimension along = extent.getDimension();
      Value threads = readPacket(b.getI32Type(), 12 + 4 * int(along));
      return toIndex(arith::DivUIOp::create(b, *loc, threads, blockDim(along)));
    }
    if (isa<gpu::LaneIdOp>(op))
      return toIndex(laneId());
    if (auto shuffle = dyn_cast<gpu::ShuffleOp>(op))
      return exchange(shuffle);
    if (isa<gpu::BarrierOp>(op)) {
      synchronize(b, *loc, "workgroup", "llvm.amdgcn.s.barrier");
      op->erase();
    }
    return nullptr;
  }

  /// A field of the packet that launched the kernel (HSA runtime specification,
  /// kernel dispatch packet).
  Value readPacket(Type type, int32_t offset) {
    auto pointer = pointerTo(b, constantSpace);
    Value packet = call(b, *loc, pointer, "llvm.amdgcn.dispatch.ptr", {});
    Value field = LLVM::GEPOp::create(b, *loc, pointer, b.getI8Type(), packet,
                                      ArrayRef<LLVM::GEPArg>(offset));
    return LLVM::LoadOp::create(b, *loc, type, field,
                                type.getIntOrFloatBitWidth() / 8, false, false,
                                /*isInvariant=*/true);
  }

  Value blockDim(gpu::Dimension along) {
    Value extent = readPacket(b.getI16Type(), 4 + 2 * int(along));
    return arith::ExtUIOp::create(b, *loc, b.getI32Type(), extent);
  }

  Value laneId() {
    Value all = constant(b, *loc, -1), none = constant(b, *loc, 0);
    Value low = i32("llvm.amdgcn.mbcnt.lo", {all, none});
    return waveSize == 32 ? low : i32("llvm.amdgcn.mbcnt.hi", {all, low});
  }

  /// 32 bits of another lane, whose number counts in bytes.
  Value exchange(gpu::ShuffleOp op) {
    Value lane = op.getOffset(), own = laneId();
    if (op.getMode() == gpu::ShuffleMode::XOR)
      lane = arith::XOrIOp::create(b, *loc, own, lane);
    if (op.getMode() == gpu::ShuffleMode::DOWN) {
      lane = arith::AddIOp::create(b, *loc, own, lane);
      Value exists =
          arith::CmpIOp::create(b, *loc, arith::CmpIPredicate::ult, lane,
                                constant(b, *loc, int32_t(waveSize)));
      lane = arith::SelectOp::create(b, *loc, exists, lane, own);
    }
    Value place = arith::ShLIOp::create(b, *loc, lane, constant(b, *loc, 2));
    Value value = op.getValue();
    Type type = value.getType();
    if (!type.isInteger(32))
      value = arith::BitcastOp::create(b, *loc, b.getI32Type(), value);
    Value moved = i32("llvm.amdgcn.ds.bpermute", {place, value});
    if (!type.isInteger(32))
      moved = arith::BitcastOp::create(b, *loc, type, moved);
    Value yes = arith::ConstantOp::create(b, *loc, b.getBoolAttr(true));
    op.getValid().replaceAllUsesWith(yes);
    return moved;
  }

  /// A variable for a buffer of the block, whose address is all that is used.
  void toVariable(gpu::GPUFuncOp kernel, BlockArgument buffer,
                  unsigned number) {
    auto type = cast<MemRefType>(buffer.getType());
    auto array =
        LLVM::LLVMArrayType::get(type.getElementType(), type.getNumElements());
    auto alignment =
        dyn_cast_or_null<IntegerAttr>(kernel.getWorkgroupAttributionAttr(
            number, LLVM::LLVMDialect::getAlignAttrName()));
    b.setInsertionPoint(kernel);
    auto variable = LLVM::GlobalOp::create(
        b, *loc, array, /*isConstant=*/false, LLVM::Linkage::Internal,
        ("__wg_" + kernel.getName() + "_" + Twine(number)).str(),
        /*value=*/Attribute(), alignment ? alignment.getInt() : 0, sharedSpace);
    {
      OpBuilder::InsertionGuard guard(b);
      b.createBlock(&variable.getInitializerRegion());
      LLVM::ReturnOp::create(b, *loc, LLVM::UndefOp::create(b, *loc, array));
    }
    for (Operation *user : llvm::make_early_inc_range(buffer.getUsers())) {
      b.setInsertionPoint(user);
      Value place = LLVM::AddressOfOp::create(b, *loc, variable);
      place = LLVM::PtrToIntOp::create(b, *loc, b.getI64Type(), place);
      user->getResult(0).replaceAllUsesWith(toIndex(place));
      user->erase();
    }
  }

  void toFunction(gpu::GPUFuncOp kernel) {
    loc = kernel.getLoc();
    for (auto [i, buffer] : llvm::enumerate(kernel.getWorkgroupAttributions()))
      toVariable(kernel, buffer, i);
    kernel.getBody().front().eraseArguments(
        kernel.getNumArguments(), kernel.getNumWorkgroupAttributions());
    b.setInsertionPoint(kernel);
    auto type = LLVM::LLVMFunctionType::get(
        LLVM::LLVMVoidType::get(b.getContext()), kernel.getArgumentTypes());
    auto function = LLVM::LLVMFuncOp::create(b, *loc, kernel.getName(), type);
    for (NamedAttribute fact : kernel->getDiscardableAttrs())
      if (fact.getName() != gpu::GPUDialect::getKernelFuncAttrName())
        function->setAttr(fact.getName(), fact.getValue());
    function.getBody().takeBody(kernel.getBody());
    for (Block &block : function.getBody())
      if (auto leave = dyn_cast<gpu::ReturnOp>(block.getTerminator())) {
        b.setInsertionPoint(leave);
        LLVM::ReturnOp::create(b, leave.getLoc(), ValueRange());
        leave.erase();
      }
    kernel.erase();
  }

  gpu::GPUModuleOp module;
  int64_t waveSize;
  OpBuilder b;
  std::optional<Location> loc;
};

} // namespace

void AmdTarget::prepareKernel(Operation *module) const {
  KernelLowering(cast<gpu::GPUModuleOp>(module), getSubgroupSize()).run();
}

/// Memory of a thread, seen by pointers to any memory.
static void moveToPrivateSpace(LLVM::LLVMFuncOp function) {
  SmallVector<LLVM::AllocaOp> allocas;
  function.walk([&](LLVM::AllocaOp op) { allocas.push_back(op); });
  for (LLVM::AllocaOp op : allocas) {
    OpBuilder b(op);
    Value memory = LLVM::AllocaOp::create(
        b, op.getLoc(), pointerTo(b, privateSpace), op.getElemType(),
        op.getArraySize(), op.getAlignment().value_or(0));
    Value seen =
        LLVM::AddrSpaceCastOp::create(b, op.getLoc(), op.getType(), memory);
    op.replaceAllUsesWith(seen);
    op.erase();
  }
}

void AmdTarget::finishKernel(LLVM::LLVMFuncOp kernel, int64_t blockDim) const {
  OpBuilder b = OpBuilder::atBlockBegin(&kernel.getBody().front());
  kernel.setCConv(LLVM::CConv::AMDGPU_KERNEL);
  BlockArgument block = kernel.getArgument(0);
  Type generic = block.getType();
  auto constants = pointerTo(b, constantSpace);
  block.setType(constants);
  kernel.setFunctionType(LLVM::LLVMFunctionType::get(
      LLVM::LLVMVoidType::get(b.getContext()), constants));
  auto seen = LLVM::AddrSpaceCastOp::create(b, kernel.getLoc(), generic, block);
  block.replaceAllUsesExcept(seen, seen);
  Attribute key = b.getStringAttr("amdgpu-flat-work-group-size"),
            range = b.getStringAttr("1," + std::to_string(blockDim));
  Attribute limit = b.getArrayAttr({key, range});
  kernel.setPassthroughAttr(ArrayAttr::get(b.getContext(), {limit}));
  for (auto function :
       kernel->getParentOp()->getRegion(0).getOps<LLVM::LLVMFuncOp>())
    moveToPrivateSpace(function);
}

bool AmdTarget::isBlockBarrier(Operation *op) const {
  auto call = dyn_cast<LLVM::CallIntrinsicOp>(op);
  return call && call.getIntrin() == "llvm.amdgcn.s.barrier";
}
