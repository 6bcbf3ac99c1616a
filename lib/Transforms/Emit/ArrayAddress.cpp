//===- ArrayAddress.cpp - Array values and element addresses --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The address of an element is the data pointer plus, for a packed array, the
// row-major element number times the element size, else the sum of indices
// times byte strides. With `index32` a GPU counts elements in 32 bits; a CPU
// always uses 64, which costs it nothing and keeps addresses affine.
//
// Index arithmetic of 32 bits is redone in 64: where it would overflow, the
// access is out of bounds of every array anyway.
//
//===----------------------------------------------------------------------===//

#include "ArrayLowering.h"
#include "KernelFunction.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Matchers.h"

using namespace mlir;
using namespace warp;

static constexpr auto noSignedWrap = arith::IntegerOverflowFlags::nsw;

mlir::Value ArrayLowering::constant(mlir::Type type, int64_t value) {
  return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
}

/// Sign-extends, or truncates, an integer or index.
mlir::Value ArrayLowering::widen(mlir::Value value, mlir::Type type) {
  if (value.getType() == type)
    return value;
  if (value.getType().isIndex())
    return arith::IndexCastOp::create(b, loc, type, value);
  if (value.getType().getIntOrFloatBitWidth() > type.getIntOrFloatBitWidth())
    return arith::TruncIOp::create(b, loc, type, value);
  return arith::ExtSIOp::create(b, loc, type, value);
}

/// Python's rule: an index below zero counts from the end.
mlir::Value ArrayLowering::wrapIndex(mlir::Value index, mlir::Value extent) {
  if (index.getType() != i64)
    index = widen(index, i32);
  if (!debug && isNonNegative(index, b.getInsertionBlock()))
    return index;
  mlir::Type type = index.getType();
  mlir::Value fromEnd =
      arith::AddIOp::create(b, loc, index, widen(extent, type));
  if (matchPattern(index, m_Constant()) && !isNonNegative(index, nullptr))
    return fromEnd;
  mlir::Value negative =
      arith::CmpIOp::create(b, loc, arith::CmpIPredicate::slt, index,
                            constant(type, 0));
  return arith::SelectOp::create(b, loc, negative, fromEnd, index);
}

/// The index in 64 bits, with sums and products of 32 bits redone.
mlir::Value ArrayLowering::wideIndex(mlir::Value index, int depth) {
  if (index.getType() == i64)
    return index;
  APInt number;
  if (matchPattern(index, m_ConstantInt(&number)))
    return constant(i64, number.getSExtValue());
  Operation *op = index.getDefiningOp();
  if (auto trunc = dyn_cast_or_null<arith::TruncIOp>(op))
    if (trunc.getIn().getType() == i64 &&
        bitEnumContainsAll(trunc.getOverflowFlags(), noSignedWrap))
      return trunc.getIn();
  if (!op || depth == 0 || debug || index.getType() != i32)
    return widen(index, i64);
  auto redo = [&](auto kind) -> mlir::Value {
    using Op = decltype(kind);
    return Op::create(b, loc, wideIndex(op->getOperand(0), depth - 1),
                      wideIndex(op->getOperand(1), depth - 1), noSignedWrap);
  };
  if (isa<arith::AddIOp>(op))
    return redo(arith::AddIOp());
  if (isa<arith::SubIOp>(op))
    return redo(arith::SubIOp());
  if (isa<arith::MulIOp>(op))
    return redo(arith::MulIOp());
  return widen(index, i64);
}

//===----------------------------------------------------------------------===//
// Descriptors
//===----------------------------------------------------------------------===//

mlir::Type ArrayLowering::getDescriptorType(int64_t rank) {
  SmallVector<mlir::Type> fields{dataPointer};
  fields.append(rank, i32);
  fields.append(rank, i64);
  return LLVM::LLVMStructType::getLiteral(b.getContext(), fields);
}

/// Parts of an array whose descriptor is in memory.
ArrayParts ArrayLowering::readDescriptor(mlir::Value base, int64_t offset,
                                         int64_t rank, int64_t unit) {
  auto read = [&](mlir::Type type, int64_t at, unsigned align) -> mlir::Value {
    return LLVM::LoadOp::create(b, loc, type, advance(base, offset + at), align,
                                false, false, /*isInvariant=*/true);
  };
  ArrayParts parts;
  parts.unit = unit;
  parts.data = read(dataPointer, 0, 8);
  for (int64_t d = 0; d < rank; ++d) {
    parts.shape.push_back(read(i32, shapeOffset(d), 4));
    parts.shape.back().getDefiningOp()->setAttr(attr::nonNegative,
                                                b.getUnitAttr());
  }
  if (unit == 0)
    for (int64_t d = 0; d < rank; ++d)
      parts.strides.push_back(widen(read(i32, stridesOffset(d), 4), i64));
  return parts;
}

/// Parts of an array value; those of a block argument or of the result of a
/// control-flow operation are taken from its struct.
ArrayParts &ArrayLowering::getParts(mlir::Value array) {
  auto found = known.find(array);
  if (found != known.end())
    return found->second;
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointAfterValue(array);
  auto type = cast<LLVM::LLVMStructType>(array.getType());
  int64_t rank = (type.getBody().size() - 1) / 2;
  auto field = [&](int64_t i) -> mlir::Value {
    return LLVM::ExtractValueOp::create(b, loc, array, i);
  };
  ArrayParts parts;
  parts.data = field(0);
  for (int64_t d = 0; d < rank; ++d)
    parts.shape.push_back(field(1 + d));
  for (int64_t d = 0; d < rank; ++d)
    parts.strides.push_back(field(1 + rank + d));
  return known[array] = parts;
}

warp::ArrayType ArrayLowering::arrayType(mlir::Value array) {
  if (auto type = dyn_cast<warp::ArrayType>(array.getType()))
    return type;
  return packedTypes.lookup(array);
}

/// The array as a struct, for control flow.
mlir::Value ArrayLowering::pack(mlir::Value array) {
  if (isa<LLVM::LLVMStructType>(array.getType()))
    return array;
  ArrayParts parts = getParts(array);
  int64_t rank = parts.shape.size();
  mlir::Value packed =
      LLVM::UndefOp::create(b, loc, getDescriptorType(rank));
  auto insert = [&](mlir::Value part, int64_t i) {
    packed = LLVM::InsertValueOp::create(b, loc, packed, part, i);
  };
  insert(parts.data, 0);
  for (int64_t d = 0; d < rank; ++d)
    insert(parts.shape[d], 1 + d);
  for (int64_t d = 0; d < rank; ++d)
    insert(stride(parts, d), 1 + rank + d);
  return packed;
}

/// Bytes from one index to the next along a dimension.
mlir::Value ArrayLowering::stride(ArrayParts &parts, int64_t dim) {
  if (parts.unit == 0)
    return parts.strides[dim];
  mlir::Value bytes = constant(i64, parts.unit);
  for (int64_t d = dim + 1, rank = parts.shape.size(); d < rank; ++d)
    bytes = arith::MulIOp::create(b, loc, bytes, widen(parts.shape[d], i64),
                                  noSignedWrap);
  return bytes;
}

//===----------------------------------------------------------------------===//
// Addresses
//===----------------------------------------------------------------------===//

mlir::Value ArrayLowering::advance(mlir::Value base, int64_t bytes) {
  if (bytes == 0)
    return base;
  return LLVM::GEPOp::create(b, loc, base.getType(), i8, base,
                             ArrayRef<LLVM::GEPArg>(int32_t(bytes)),
                             LLVM::GEPNoWrapFlags::inbounds);
}

mlir::Value ArrayLowering::advance(mlir::Value base, mlir::Value bytes) {
  return LLVM::GEPOp::create(b, loc, base.getType(), i8, base,
                             ArrayRef<LLVM::GEPArg>(bytes),
                             LLVM::GEPNoWrapFlags::inbounds);
}

/// Pointer to the element, or subarray, at these leading indices. `inside`: the
/// array has that element.
mlir::Value ArrayLowering::elementPointer(const ArrayParts &parts,
                                          ValueRange indices,
                                          mlir::Type elementType,
                                          bool inside) {
  if (parts.unit == 0) {
    mlir::Value pointer = parts.data;
    for (auto [index, bytes] : llvm::zip(indices, parts.strides)) {
      mlir::Value offset = arith::MulIOp::create(b, loc, wideIndex(index),
                                                 bytes, noSignedWrap);
      pointer = advance(pointer, offset);
    }
    return pointer;
  }
  // Row-major number of the element.
  bool narrow = gpu && index32;
  auto prepare = [&](mlir::Value part) {
    return narrow ? widen(part, i32) : wideIndex(part);
  };
  mlir::Value number;
  for (auto [d, extent] : llvm::enumerate(parts.shape)) {
    if (number)
      number = arith::MulIOp::create(b, loc, number, prepare(extent),
                                     noSignedWrap);
    if (d >= indices.size())
      continue;
    mlir::Value index = prepare(indices[d]);
    number = number ? arith::AddIOp::create(b, loc, number, index, noSignedWrap)
                    : index;
  }
  mlir::Type step = LLVM::LLVMArrayType::get(i8, parts.unit);
  mlir::Type scalar = getSignless(elementType);
  if (isFloat(scalar) || isInteger(scalar))
    if (getByteSize(scalar) == parts.unit)
      step = scalar;
  return LLVM::GEPOp::create(b, loc, parts.data.getType(), step, parts.data,
                             ArrayRef<LLVM::GEPArg>(widen(number, i64)),
                             inside ? LLVM::GEPNoWrapFlags::inbounds
                                    : LLVM::GEPNoWrapFlags::none);
}

Address ArrayLowering::address(mlir::Value array, ValueRange indices) {
  ArrayParts parts = getParts(array);
  Address result;
  for (auto [index, extent] : llvm::zip(indices, parts.shape))
    result.indices.push_back(parts.isGeometry && !debug &&
                                     index.getType() != i64
                                 ? widen(index, i32)
                                 : wrapIndex(index, extent));
  if (debug)
    for (auto [index, extent] : llvm::zip(result.indices, parts.shape)) {
      mlir::Value fits = arith::CmpIOp::create(
          b, loc, arith::CmpIPredicate::ult, index,
          widen(extent, index.getType()));
      result.inside =
          result.inside
              ? arith::AndIOp::create(b, loc, result.inside, fits).getResult()
              : fits;
    }
  result.pointer = elementPointer(parts, result.indices, elementType(array));
  return result;
}

SmallVector<mlir::Value>
ArrayLowering::guarded(Operation *op, mlir::Value array, const Address &address,
                       TypeRange types,
                       function_ref<SmallVector<mlir::Value>()> body) {
  if (!address.inside)
    return body();
  auto guard = scf::IfOp::create(b, loc, types, address.inside,
                                 /*addThenBlock=*/true, /*addElseBlock=*/true);
  OpBuilder::InsertionGuard insertion(b);
  b.setInsertionPointToStart(guard.thenBlock());
  scf::YieldOp::create(b, loc, body());
  b.setInsertionPointToStart(guard.elseBlock());
  const ArrayParts &parts = getParts(array);
  report(op->getLoc(), CheckKind::OutOfBounds, parts.name, address.indices,
         parts.shape);
  SmallVector<mlir::Value> zeros;
  for (mlir::Type type : types)
    zeros.push_back(zeroOf(type));
  scf::YieldOp::create(b, loc, zeros);
  return SmallVector<mlir::Value>(guard.getResults());
}
