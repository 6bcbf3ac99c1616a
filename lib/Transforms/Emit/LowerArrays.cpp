//===- LowerArrays.cpp - Arrays become pointers, extents, strides ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One walk over the entry, operations before what they contain and definitions
// before uses. An operation on arrays is replaced on the spot; the parts of
// every array are remembered in a table (`known`), so a view of a view costs
// nothing and the strides of a packed array are constants. Arrays that pass
// through control flow (a branch that yields one of two) are packed into an
// LLVM struct there, and the types of the operation are changed in place.
//
// All loads of one composite are emitted next to each other, and so are its
// stores; on the GPU this decides how much of the memory's bandwidth is used.
//
//===----------------------------------------------------------------------===//

#include "Analysis/GeometryMemory.h"
#include "ArrayLowering.h"
#include "ForwardElements.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "WarpDialect/LibraryOps.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

namespace warp {
#define GEN_PASS_DEF_LOWERARRAYS
#include "WarpDialect/Passes.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;

/// Addresses on a thread's stack are none of a GPU's global memory.
static bool hasThreadMemory(LLVM::LLVMFuncOp entry) {
  return entry
      .walk([](LibraryCallOp op) {
        return op.getCallee() == threadMemory ? WalkResult::interrupt()
                                              : WalkResult::advance();
      })
      .wasInterrupted();
}

ArrayLowering::ArrayLowering(LLVM::LLVMFuncOp entry)
    : entry(entry), module(entry->getParentOfType<ModuleOp>()),
      b(entry.getContext()), loc(entry.getLoc()), gpu(isGpu(entry)),
      index32(getVariant(entry).getIndex32()),
      debug(getVariant(entry).getDebug()),
      exclusive(!gpu && getRecipe(entry).getExclusive()) {
  MLIRContext *context = b.getContext();
  i8 = b.getI8Type();
  i32 = b.getI32Type();
  i64 = b.getI64Type();
  pointer = LLVM::LLVMPointerType::get(context);
  dataPointer =
      LLVM::LLVMPointerType::get(context, gpu && !hasThreadMemory(entry));
}

LogicalResult ArrayLowering::run() {
  forwardStores(entry);
  if (gpu && !debug && !entry->hasAttr(attr::blockThreads))
    staged = findStagedAccesses(entry);
  SmallVector<Operation *> operations;
  entry.walk<WalkOrder::PreOrder>(
      [&](Operation *op) { operations.push_back(op); });
  for (Operation *op : operations)
    if (auto array = dyn_cast<ArrayAtOp>(op); array && isGeometryMemory(array))
      geometry.insert(array);
  if (debug) {
    b.setInsertionPointToStart(&entry.getBody().front());
    mlir::Value block = entry.getArgument(0);
    errorRecord = LLVM::LoadOp::create(
        b, loc, i64, advance(block, offsetof(LaunchHeader, errorRecord)), 8);
  }
  for (Operation *op : operations)
    if (op != entry)
      lower(op);
  for (Operation *op : llvm::reverse(dead))
    op->erase();
  if (!sites.empty())
    entry->setAttr(attr::sites, b.getArrayAttr(sites));
  return failure(malformed);
}

/// A place in the block's memory that bytes are added to; null if an operation
/// is something else.
static BlockMemoryOp getPlaceBehind(Operation *op) {
  auto sum = dyn_cast_or_null<arith::AddIOp>(op);
  return sum ? sum.getLhs().getDefiningOp<BlockMemoryOp>() : nullptr;
}

void ArrayLowering::lower(Operation *op) {
  b.setInsertionPoint(op);
  loc = op->getLoc();
  bool replaced = true;
  if (auto parameter = dyn_cast<ParameterOp>(op))
    lowerParameter(parameter);
  else if (auto view = dyn_cast<ViewOp>(op))
    lowerView(view);
  else if (auto slice = dyn_cast<SliceOp>(op))
    lowerSlice(slice);
  else if (auto view = dyn_cast<IndexDimOp>(op))
    lowerIndexDim(view);
  else if (auto view = dyn_cast<ComponentViewOp>(op))
    lowerComponentView(view);
  else if (auto dim = dyn_cast<DimOp>(op))
    lowerDim(dim);
  else if (auto stride = dyn_cast<StrideOp>(op))
    lowerStride(stride);
  else if (auto pointer = dyn_cast<PointerOp>(op))
    lowerPointer(pointer);
  else if (auto array = dyn_cast<ArrayAtOp>(op))
    lowerArrayAt(array);
  else if (auto grad = dyn_cast<GradOp>(op))
    lowerGrad(grad);
  else if (isa<BlockMemoryOp>(op) || getPlaceBehind(op))
    ; // Arrays there ask for it.
  else if (auto load = dyn_cast<LoadComponentsOp>(op))
    lowerLoad(load);
  else if (auto store = dyn_cast<StoreComponentsOp>(op))
    lowerStore(store);
  else if (auto atomic = dyn_cast<AtomicComponentsOp>(op))
    lowerAtomic(atomic);
  else if (auto cas = dyn_cast<AtomicCasOp>(op))
    lowerAtomicCas(cas);
  else if (auto load = dyn_cast<LoadLanesOp>(op))
    lowerLanes(load);
  else if (auto store = dyn_cast<StoreLanesOp>(op))
    lowerLanes(store);
  else if (auto update = dyn_cast<UpdateLanesOp>(op))
    lowerLanes(update);
  else if (auto address = dyn_cast<AddressOp>(op))
    lowerAddress(address);
  else if (auto scratch = dyn_cast<ScratchOp>(op))
    lowerScratch(scratch);
  else if (auto load = dyn_cast<ScratchLoadOp>(op))
    lowerScratch(load);
  else if (auto store = dyn_cast<ScratchStoreOp>(op))
    lowerScratch(store);
  else if (auto printf = dyn_cast<PrintfOp>(op))
    lowerPrintf(printf);
  else if (auto assertion = dyn_cast<AssertOp>(op))
    lowerAssert(assertion);
  else
    replaced = false;
  if (replaced)
    dead.push_back(op);
  else
    convertControlFlow(op);
}

/// Changes array types of operands, results and block arguments in place. Calls
/// get addresses of a thread's memory.
void ArrayLowering::convertControlFlow(Operation *op) {
  for (OpOperand &operand : op->getOpOperands())
    if (isa<warp::ArrayType>(operand.get().getType()))
      operand.set(pack(operand.get()));
    else if (isa<ScratchType>(operand.get().getType()))
      operand.set(LLVM::PtrToIntOp::create(b, loc, i64,
                                           scratches.lookup(operand.get())));
  auto convert = [&](mlir::Value value) {
    auto array = dyn_cast<warp::ArrayType>(value.getType());
    if (!array)
      return;
    packedTypes[value] = array;
    value.setType(getDescriptorType(array.getRank()));
  };
  llvm::for_each(op->getResults(), convert);
  for (Region &region : op->getRegions())
    for (Block &block : region)
      llvm::for_each(block.getArguments(), convert);
}

//===----------------------------------------------------------------------===//
// Values
//===----------------------------------------------------------------------===//

void ArrayLowering::lowerParameter(ParameterOp op) {
  mlir::Type type = op.getType();
  int64_t offset = op.getOffset();
  if (auto array = dyn_cast<warp::ArrayType>(type)) {
    int64_t unit = op.getPacked() ? getByteSize(array.getElementType()) : 0;
    ArrayParts parts =
        readDescriptor(op.getBlock(), offset, array.getRank(), unit);
    parts.name = op.getName().value_or("");
    parts.owner = ArrayParts::Owner::Caller;
    known[op] = parts;
    descriptors[op] = {op.getBlock(), offset};
    return;
  }
  mlir::Type stored = isBool(type) ? i8 : type;
  auto load = LLVM::LoadOp::create(
      b, loc, stored, advance(op.getBlock(), offset), getByteSize(type), false,
      false, /*isInvariant=*/true);
  if (Attribute fact = op->getAttr(attr::nonNegative))
    load->setAttr(attr::nonNegative, fact);
  mlir::Value value = load;
  if (isBool(type))
    value = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, value,
                                  constant(i8, 0));
  op.replaceAllUsesWith(value);
}

void ArrayLowering::lowerView(ViewOp op) {
  ArrayParts parts = getParts(op.getArray());
  Address start = address(op.getArray(), op.getIndices());
  if (start.inside)
    guarded(op, op.getArray(), start, {},
            [] { return SmallVector<mlir::Value>(); });
  size_t count = op.getIndices().size();
  parts.data = start.pointer;
  parts.shape.erase(parts.shape.begin(), parts.shape.begin() + count);
  if (parts.unit == 0)
    parts.strides.erase(parts.strides.begin(), parts.strides.begin() + count);
  if (start.inside)
    // Nothing is within an array that starts out of bounds.
    for (mlir::Value &extent : parts.shape)
      extent = arith::SelectOp::create(b, loc, start.inside, extent,
                                       constant(i32, 0));
  known[op] = parts;
}

void ArrayLowering::lowerComponentView(ComponentViewOp op) {
  ArrayParts parts = getParts(op.getArray());
  mlir::Type element = elementType(op.getArray());
  if (auto record = dyn_cast<warp::StructType>(element)) {
    int64_t field = record.getFieldIndex(op.getField().value_or(""));
    parts.data = advance(parts.data, getFieldOffset(record, field));
    known[op] = parts;
    return;
  }
  int64_t size = getByteSize(getElementScalar(element));
  SmallVector<int64_t> extents{getComponentCount(element)};
  if (auto matrix = dyn_cast<MatType>(element))
    extents = {matrix.getRows(), matrix.getCols()};
  int64_t bytes = size * (extents.size() == 2 ? extents[1] : 1);
  for (auto [index, extent] : llvm::zip(op.getIndices(), extents)) {
    APInt number;
    if (matchPattern(index, m_ConstantInt(&number))) {
      int64_t i = number.getSExtValue();
      parts.data = advance(parts.data, (i < 0 ? i + extent : i) * bytes);
    } else {
      mlir::Value i = wrapIndex(widen(index, i64), constant(i64, extent));
      mlir::Value offset =
          arith::MulIOp::create(b, loc, i, constant(i64, bytes));
      parts.data = advance(parts.data, offset);
    }
    bytes = size;
  }
  known[op] = parts;
}

void ArrayLowering::lowerDim(DimOp op) {
  mlir::Value extent = getParts(op.getArray()).shape[op.getDim()];
  op.getResult().replaceAllUsesWith(widen(extent, getSignless(op.getType())));
}

void ArrayLowering::lowerStride(StrideOp op) {
  mlir::Value bytes = stride(getParts(op.getArray()), op.getDim());
  op.getResult().replaceAllUsesWith(
      arith::TruncIOp::create(b, loc, getSignless(op.getType()), bytes));
}

void ArrayLowering::lowerPointer(PointerOp op) {
  op.getResult().replaceAllUsesWith(LLVM::PtrToIntOp::create(
      b, loc, getSignless(op.getType()), getParts(op.getArray()).data));
}

/// What the threads of a block share: on a CPU, where a block is one thread, on
/// its stack.
mlir::Value ArrayLowering::getBlockMemory() {
  if (blockMemory)
    return blockMemory;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(&entry.getBody().front());
  auto bytes = entry->getAttrOfType<IntegerAttr>(attr::blockBytes);
  // In words of 64 bits, for their alignment.
  auto type = LLVM::LLVMArrayType::get(i64, bytes ? bytes.getInt() / 8 : 0);
  // Swizzled tiles are patterns of 1024 bytes (PlanTileMemory.cpp).
  int64_t alignment = bytes && bytes.getInt() >= 1024 ? 1024 : 16;
  if (gpu)
    return blockMemory =
               getDynamicBytes(entry)
                   ? nameDynamicShared(b, loc, module, "tiles")
                   : makeShared(b, loc, module, type, "tiles", alignment);
  mlir::Value one = LLVM::ConstantOp::create(b, loc, b.getI64IntegerAttr(1));
  return blockMemory =
             LLVM::AllocaOp::create(b, loc, pointer, type, one, /*align=*/64);
}

void ArrayLowering::lowerArrayAt(ArrayAtOp op) {
  ArrayParts parts;
  Operation *address = op.getAddress().getDefiningOp();
  if (auto memory = dyn_cast_or_null<BlockMemoryOp>(address))
    parts.data = advance(getBlockMemory(), memory.getOffset());
  else if (BlockMemoryOp memory = getPlaceBehind(address))
    parts.data = advance(advance(getBlockMemory(), memory.getOffset()),
                         cast<arith::AddIOp>(address).getRhs());
  else
    parts.data = LLVM::IntToPtrOp::create(b, loc, dataPointer,
                                          widen(op.getAddress(), i64));
  if (isa_and_nonnull<BlockMemoryOp>(address) || getPlaceBehind(address))
    parts.owner = ArrayParts::Owner::Block;
  for (mlir::Value extent : op.getExtents())
    parts.shape.push_back(widen(extent, i32));
  parts.unit = getByteSize(elementType(op));
  parts.isGeometry = geometry.contains(op);
  known[op] = parts;
}

/// Extents and strides of the array with the descriptor's other pointer. Read
/// where the array is, so that the loop over threads finds it done.
void ArrayLowering::lowerGrad(GradOp op) {
  auto found = descriptors.find(op.getArray());
  if (found == descriptors.end()) {
    op.emitError("expects the array of a gradient to be an argument of the "
                 "kernel or a field of one");
    malformed = true;
    known[op] = getParts(op.getArray());
    return;
  }
  auto [base, offset] = found->second;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(op.getArray());
  ArrayParts parts = getParts(op.getArray());
  parts.data = LLVM::LoadOp::create(b, loc, dataPointer,
                                    advance(base, offset + gradOffset), 8,
                                    false, false, /*isInvariant=*/true);
  if (!parts.name.empty())
    parts.name = b.getStringAttr(parts.name + ".grad").getValue();
  int64_t element = getByteSize(elementType(op.getArray()));
  int64_t scale = getByteSize(elementType(op)) / element;
  parts.unit *= scale;
  if (scale != 1)
    for (mlir::Value &bytes : parts.strides)
      bytes = arith::MulIOp::create(b, loc, bytes, constant(i64, scale));
  known[op] = parts;
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

mlir::Value ArrayLowering::zeroOf(mlir::Type type) {
  if (isa<LLVM::LLVMStructType>(type))
    return LLVM::ZeroOp::create(b, loc, type);
  return arith::ConstantOp::create(b, loc, b.getZeroAttr(type));
}

/// Tells LLVM what does not overlap, which vector loops over tiles would
/// otherwise ask.
template <typename Op>
void ArrayLowering::setOwner(Op access, ArrayParts::Owner owner) {
  if (gpu || owner == ArrayParts::Owner::Unknown ||
      !entry->hasAttr(attr::blockBytes))
    return;
  if (!blockScope) {
    auto domain = LLVM::AliasScopeDomainAttr::get(
        b.getContext(), b.getStringAttr("memory of a launch"));
    blockScope = b.getArrayAttr(LLVM::AliasScopeAttr::get(
        domain, b.getStringAttr("memory of a block")));
  }
  if (owner == ArrayParts::Owner::Block)
    access.setAliasScopesAttr(blockScope);
  else
    access.setNoaliasScopesAttr(blockScope);
}

/// Reads a scalar, or an array's descriptor, signless.
mlir::Value ArrayLowering::loadLeaf(mlir::Type type, mlir::Value from,
                                    ArrayParts::Owner owner) {
  mlir::Type stored = isBool(type) ? i8 : getSignless(type);
  auto load = LLVM::LoadOp::create(b, loc, stored, from, getByteSize(type));
  setOwner(load, owner);
  if (!isBool(type))
    return load;
  return arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, load,
                               constant(i8, 0));
}

void ArrayLowering::storeLeaf(mlir::Value value, mlir::Type type,
                              mlir::Value to, ArrayParts::Owner owner) {
  if (isBool(type))
    value = arith::ExtUIOp::create(b, loc, i8, value);
  setOwner(LLVM::StoreOp::create(b, loc, value, to, getByteSize(type)), owner);
}

void ArrayLowering::lowerLoad(LoadComponentsOp op) {
  if (auto found = staged.loads.find(op); found != staged.loads.end())
    return lowerStaged(found->second);
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  Address at = address(op.getArray(), op.getIndices());
  bool isGeometry = getParts(op.getArray()).isGeometry;
  ArrayParts::Owner owner = getParts(op.getArray()).owner;
  SmallVector<mlir::Type> types;
  for (Leaf leaf : leaves) {
    auto array = dyn_cast<warp::ArrayType>(leaf.type);
    types.push_back(array ? getDescriptorType(array.getRank())
                          : getSignless(leaf.type));
  }
  auto values = guarded(op, op.getArray(), at, types, [&] {
    SmallVector<mlir::Value> pointers, loaded;
    for (Leaf leaf : leaves)
      pointers.push_back(advance(at.pointer, leaf.offset));
    for (auto [leaf, from] : llvm::zip(leaves, pointers)) {
      auto array = dyn_cast<warp::ArrayType>(leaf.type);
      if (!array) {
        loaded.push_back(loadLeaf(leaf.type, from, owner));
        if (isGeometry && loaded.back().getType() == i32)
          loaded.back().getDefiningOp()->setAttr(attr::nonNegative,
                                                 b.getUnitAttr());
        continue;
      }
      mlir::Value key = op.getResult(loaded.size());
      known[key] = readDescriptor(from, 0, array.getRank(), 0);
      loaded.push_back(at.inside ? pack(key) : key);
    }
    return loaded;
  });
  for (auto [component, value] : llvm::zip(op.getComponents(), values)) {
    if (component == value)
      continue;
    if (isa<warp::ArrayType>(component.getType()))
      known[component] = ArrayParts(getParts(value));
    else
      component.replaceAllUsesWith(value);
  }
}

void ArrayLowering::lowerStore(StoreComponentsOp op) {
  if (staged.stores.contains(op))
    return lowerStaged(op);
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  Address at = address(op.getArray(), op.getIndices());
  ArrayParts::Owner owner = getParts(op.getArray()).owner;
  guarded(op, op.getArray(), at, {}, [&] {
    SmallVector<mlir::Value> pointers;
    for (Leaf leaf : leaves)
      pointers.push_back(advance(at.pointer, leaf.offset));
    for (auto [leaf, value, to] :
         llvm::zip(leaves, op.getComponents(), pointers)) {
      if (!isa<warp::ArrayType>(leaf.type)) {
        storeLeaf(value, leaf.type, to, owner);
        continue;
      }
      ArrayParts parts = getParts(value);
      LLVM::StoreOp::create(b, loc, parts.data, to, 8);
      for (int64_t d = 0, rank = parts.shape.size(); d < rank; ++d) {
        LLVM::StoreOp::create(b, loc, parts.shape[d],
                              advance(to, shapeOffset(d)), 4);
        mlir::Value bytes = widen(stride(parts, d), i32);
        LLVM::StoreOp::create(b, loc, bytes, advance(to, stridesOffset(d)), 4);
      }
      // The array has no gradient there. The rank comes with no flags, and
      // where there is no array it is zero, as in what Python makes.
      LLVM::StoreOp::create(b, loc, constant(i64, 0), advance(to, gradOffset),
                            8);
      mlir::Value none = LLVM::ZeroOp::create(b, loc, parts.data.getType());
      mlir::Value isNone = LLVM::ICmpOp::create(b, loc, LLVM::ICmpPredicate::eq,
                                                parts.data, none);
      mlir::Value rank = LLVM::SelectOp::create(
          b, loc, isNone, constant(i64, 0), constant(i64, parts.shape.size()));
      LLVM::StoreOp::create(b, loc, rank,
                            advance(to, offsetof(ArrayDescriptor, ndim)), 8);
    }
    return SmallVector<mlir::Value>();
  });
}

void ArrayLowering::lowerAddress(AddressOp op) {
  Address at = address(op.getArray(), op.getIndices());
  auto number = guarded(op, op.getArray(), at, i64, [&] {
    return SmallVector<mlir::Value>{
        LLVM::PtrToIntOp::create(b, loc, i64, at.pointer)};
  });
  op->replaceAllUsesWith(number);
}

namespace {
struct LowerArrays : warp::impl::LowerArraysBase<LowerArrays> {
  void getDependentDialects(DialectRegistry &registry) const override {
    LowerArraysBase::getDependentDialects(registry);
    warp::registerGpuDialect(registry);
  }

  void runOnOperation() override {
    auto entry = dyn_cast_or_null<LLVM::LLVMFuncOp>(
        findEntry(getOperation()).getOperation());
    if (!entry || failed(ArrayLowering(entry).run()))
      signalPassFailure();
  }
};
} // namespace
