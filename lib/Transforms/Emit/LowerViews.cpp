//===- LowerViews.cpp - Array parameters, views and extents ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Arguments, views, arrays at an address and gradients become parts of arrays
// in the table of LowerArrays.cpp; extents, strides and pointers are read
// there.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"
#include "KernelFunction.h"
#include "Launch/GpuBlock.h"
#include "WarpDialect/ParameterLayout.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/IR/Matchers.h"

#include <numeric>

using namespace mlir;
using namespace warp;

void ArrayLowering::lowerParameter(ParameterOp op) {
  mlir::Type type = op.getType();
  int64_t offset = op.getOffset();
  if (auto array = dyn_cast<warp::ArrayType>(type)) {
    int64_t unit = op.getPacked() ? getByteSize(array.getElementType()) : 0;
    ArrayParts parts =
        readDescriptor(op.getBlock(), offset, array.getRank(), unit);
    parts.name = op.getName().value_or("");
    parts.owner = ArrayParts::Owner::Caller;
    if (gpu && unit)
      parts.alignment = packedAlignment(unit);
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
  parts.alignment = 1;
  mlir::Type element = elementType(op.getArray());
  if (auto record = dyn_cast<warp::StructType>(element)) {
    int64_t field = record.getFieldIndex(op.getField().value_or(""));
    parts.data = advance(parts.data, getFieldOffset(record, field));
    known[op] = parts;
    return;
  }
  int64_t size = getByteSize(getElementScalar(element));
  if (std::optional<StringRef> field = op.getField()) {
    // In a transform the vector comes first.
    parts.data = advance(parts.data, *field == "p" ? 0 : 3 * size);
    known[op] = parts;
    return;
  }
  SmallVector<int64_t, 2> extents = getIndexExtents(element);
  int64_t bytes = size * (extents.size() == 2 ? extents[1] : 1);
  for (auto [index, extent] : llvm::zip(op.getIndices(), extents)) {
    APInt number;
    if (matchPattern(index, m_ConstantInt(&number))) {
      int64_t i = number.getSExtValue();
      parts.data = advance(parts.data, (i < 0 ? i + extent : i) * bytes);
    } else {
      mlir::Value i = wrapIndex(widen(index, i64), constant(i64, extent));
      // Nothing is written beyond the element; debug launches have reported it.
      i = arith::MinUIOp::create(b, loc, i, constant(i64, extent - 1));
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

/// Memory that the threads of a block share: on a CPU, where a block is one
/// thread, on its stack.
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

BlockMemoryOp ArrayLowering::getPlaceBehind(Operation *op) {
  auto sum = dyn_cast_or_null<arith::AddIOp>(op);
  return sum ? sum.getLhs().getDefiningOp<BlockMemoryOp>() : nullptr;
}

void ArrayLowering::lowerArrayAt(ArrayAtOp op) {
  ArrayParts parts;
  parts.unit = getByteSize(elementType(op));
  Operation *address = op.getAddress().getDefiningOp();
  if (auto memory = dyn_cast_or_null<BlockMemoryOp>(address)) {
    parts.data = advance(getBlockMemory(), memory.getOffset());
    if (gpu)
      parts.alignment =
          std::gcd(packedAlignment(parts.unit), int64_t(memory.getOffset()));
  } else if (BlockMemoryOp memory = getPlaceBehind(address)) {
    parts.data = advance(advance(getBlockMemory(), memory.getOffset()),
                         cast<arith::AddIOp>(address).getRhs());
  } else {
    parts.data = LLVM::IntToPtrOp::create(b, loc, dataPointer,
                                          widen(op.getAddress(), i64));
  }
  if (isa_and_nonnull<BlockMemoryOp>(address) || getPlaceBehind(address))
    parts.owner = ArrayParts::Owner::Block;
  for (mlir::Value extent : op.getExtents())
    parts.shape.push_back(widen(extent, i32));
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
  if (scale != 1) {
    parts.alignment = 1;
    for (mlir::Value &bytes : parts.strides)
      bytes = arith::MulIOp::create(b, loc, bytes, constant(i64, scale));
  }
  known[op] = parts;
}
