//===- LowerLaneAccesses.cpp - Vector loads and stores of lanes -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes whose elements follow each other read and write whole vectors, which
// are taken apart and put together in registers (LaneRegisters.cpp), or rows
// of each element (LowerLaneRows.cpp). Scattered elements are rows,
// or are gathered and scattered, component by component.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"
#include "Lanes/Neighbours.h"
#include "Lanes/RowRuns.h"
#include "Lanes/Spread.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp;

//===----------------------------------------------------------------------===//
// Addresses
//===----------------------------------------------------------------------===//

/// Byte offsets of elements from the start of the array, i64.
mlir::Value ArrayLowering::gatherOffsets(const ArrayParts &parts,
                                         ValueRange indices,
                                         ArrayRef<bool> nonNegative,
                                         int64_t lanes) {
  auto wide = VectorType::get(lanes, i64);
  auto toLanes = [&](mlir::Value value) -> mlir::Value {
    if (isa<VectorType>(value.getType()))
      return value;
    if (value.getType().isInteger(32))
      value = widen(value, i64);
    return spread(b, loc, value, lanes);
  };
  auto toWide = [&](mlir::Value value) -> mlir::Value {
    value = toLanes(value);
    mlir::Type element = cast<VectorType>(value.getType()).getElementType();
    if (element.isIndex())
      return arith::IndexCastOp::create(b, loc, wide, value);
    if (element.getIntOrFloatBitWidth() < 64)
      return arith::ExtSIOp::create(b, loc, wide, value);
    return value;
  };
  mlir::Value zero = arith::ConstantOp::create(b, loc, b.getZeroAttr(wide)),
              offset;
  for (auto [d, index] : llvm::enumerate(indices)) {
    mlir::Value number;
    if (isa<VectorType>(index.getType())) {
      number = toWide(index);
      if (!nonNegative[d]) {
        mlir::Value fromEnd =
            arith::AddIOp::create(b, loc, number, toWide(parts.shape[d]));
        mlir::Value isNegative = arith::CmpIOp::create(
            b, loc, arith::CmpIPredicate::slt, number, zero);
        number = arith::SelectOp::create(b, loc, isNegative, fromEnd, number);
      }
    } else {
      number =
          toWide(nonNegative[d] ? index : wrapIndex(index, parts.shape[d]));
    }
    if (parts.unit == 0)
      number = arith::MulIOp::create(b, loc, number, toWide(parts.strides[d]));
    else if (offset)
      offset = arith::MulIOp::create(b, loc, offset, toWide(parts.shape[d]));
    offset = offset ? arith::AddIOp::create(b, loc, offset, number).getResult()
                    : number;
  }
  return offset;
}

ArrayLowering::LaneAccess
ArrayLowering::laneAccess(mlir::Value array, ValueRange indices,
                          mlir::Value mask, LaneForm form,
                          ArrayRef<bool> nonNegative) {
  LaneAccess access;
  collectLeaves(elementType(array), 0, access.leaves);
  access.mask = mask;
  access.isFull = isFullMask(mask);
  access.lanes = cast<VectorType>(mask.getType()).getNumElements();
  ArrayParts parts = getParts(array);
  if (form == LaneForm::unit) {
    SmallVector<mlir::Value> wrapped;
    for (auto [index, extent, isRight] :
         llvm::zip_equal(indices, parts.shape, nonNegative))
      wrapped.push_back(isRight ? index : wrapIndex(index, extent));
    access.pointer = elementPointer(parts, wrapped, elementType(array),
                                    /*inside=*/access.isFull);
    return access;
  }
  mlir::Value offsets =
      gatherOffsets(parts, indices, nonNegative, access.lanes);
  auto pointers = LLVM::getVectorType(dataPointer, access.lanes);
  mlir::Type step = parts.unit == 0 ? mlir::Type(i8)
                                    : LLVM::LLVMArrayType::get(i8, parts.unit);
  if (llvm::isPowerOf2_64(parts.unit) && parts.unit <= 8)
    step = b.getIntegerType(8 * parts.unit);
  access.pointer = LLVM::GEPOp::create(b, loc, pointers, step, parts.data,
                                       ArrayRef<LLVM::GEPArg>(offsets));
  return access;
}

//===----------------------------------------------------------------------===//
// Accesses
//===----------------------------------------------------------------------===//

/// For each of `count` vectors that hold the elements one after the other: the
/// lanes that are live.
static SmallVector<mlir::Value> spreadMask(OpBuilder &b, Location loc,
                                           mlir::Value mask, int64_t lanes,
                                           int64_t count) {
  if (count == 1)
    return {mask};
  SmallVector<mlir::Value> masks;
  for (int64_t number = 0; number < count; ++number) {
    SmallVector<int32_t> places;
    for (int64_t lane = 0; lane < lanes; ++lane)
      places.push_back((number * lanes + lane) / count);
    masks.push_back(LLVM::ShuffleVectorOp::create(b, loc, mask, mask, places));
  }
  return masks;
}

/// For a vector that holds the numbers from `first` on: those that belong to
/// elements which are taken, `count` numbers of every `period`.
static mlir::Value patternMask(OpBuilder &b, Location loc, int64_t lanes,
                               int64_t first, int64_t count, int64_t period) {
  SmallVector<bool> taken;
  for (int64_t lane = 0; lane < lanes; ++lane)
    taken.push_back((first + lane) % period < count);
  auto type = VectorType::get(lanes, b.getI1Type());
  return arith::ConstantOp::create(b, loc, DenseElementsAttr::get(type, taken));
}

SmallVector<mlir::Value>
ArrayLowering::LaneAccess::lanePointers(OpBuilder &b, Location loc,
                                        int64_t step) const {
  SmallVector<mlir::Value> pointers;
  SmallVector<int64_t> offsets;
  for (int64_t lane = 0; lane < lanes; ++lane) {
    offsets.push_back(lane * step);
    if (isFull)
      pointers.push_back(move(b, loc, lane * step));
  }
  if (isFull)
    return pointers;
  auto type = VectorType::get(lanes, b.getI64Type());
  mlir::Value all = arith::ConstantOp::create(
      b, loc, DenseElementsAttr::get(type, ArrayRef(offsets)));
  mlir::Value one =
      LLVM::ExtractElementOp::create(b, loc, all, firstLive(b, loc));
  mlir::Value safe =
      arith::SelectOp::create(b, loc, mask, all, spread(b, loc, one, lanes));
  for (int64_t lane = 0; lane < lanes; ++lane) {
    mlir::Value number =
        arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(lane));
    mlir::Value offset = LLVM::ExtractElementOp::create(b, loc, safe, number);
    pointers.push_back(LLVM::GEPOp::create(b, loc, pointer.getType(),
                                           b.getI8Type(), pointer,
                                           ArrayRef<LLVM::GEPArg>(offset)));
  }
  return pointers;
}

SmallVector<mlir::Value> ArrayLowering::LaneAccess::storePointers(
    OpBuilder &b, Location loc, LLVM::LLVMFuncOp entry, int64_t step) const {
  if (isFull && step != 0)
    return lanePointers(b, loc, step);
  mlir::Value addresses = pointer;
  if (step != 0) {
    SmallVector<int64_t> offsets;
    for (int64_t lane = 0; lane < lanes; ++lane)
      offsets.push_back(lane * step);
    auto type = VectorType::get(lanes, b.getI64Type());
    mlir::Value all = arith::ConstantOp::create(
        b, loc, DenseElementsAttr::get(type, ArrayRef(offsets)));
    addresses = LLVM::GEPOp::create(
        b, loc, LLVM::getVectorType(pointer.getType(), lanes), b.getI8Type(),
        pointer, ArrayRef<LLVM::GEPArg>(all));
  }
  auto move = [&](mlir::Value from) -> mlir::Value {
    return LLVM::GEPOp::create(b, loc, from.getType(), b.getI8Type(), from,
                               ArrayRef<LLVM::GEPArg>(offset));
  };
  if (!isFull) {
    if (offset)
      addresses = move(addresses);
    OpBuilder atStart = OpBuilder::atBlockBegin(&entry.getBody().front());
    auto element =
        LLVM::LLVMArrayType::get(wordLanes().getElementType(), leaves.size());
    mlir::Value one =
        LLVM::ConstantOp::create(atStart, loc, b.getI64IntegerAttr(1));
    mlir::Value unread = LLVM::AllocaOp::create(
        atStart, loc, LLVM::LLVMPointerType::get(b.getContext()), element, one);
    addresses = LLVM::SelectOp::create(b, loc, mask, addresses,
                                       spread(b, loc, unread, lanes));
  }
  SmallVector<mlir::Value> pointers;
  for (int64_t lane = 0; lane < lanes; ++lane) {
    mlir::Value number =
        arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(lane));
    mlir::Value to = LLVM::ExtractElementOp::create(b, loc, addresses, number);
    pointers.push_back(isFull && offset ? move(to) : to);
  }
  return pointers;
}

SmallVector<mlir::Value> ArrayLowering::loadUnit(const LaneAccess &access,
                                                 int64_t stride) {
  int64_t count = access.leaves.size(), lanes = access.lanes;
  int64_t period = count * stride;
  VectorType stored = access.wordLanes();
  int64_t size = getByteSize(access.leaves[0].type);
  if (access.prefersRows(stride)) {
    auto pointers = access.lanePointers(b, loc, period * size);
    return loadRows(b, loc, stored, count,
                    [&](int64_t lane) { return pointers[lane]; });
  }
  SmallVector<mlir::Value> masks, vectors, components;
  if (!access.isFull)
    masks = spreadMask(b, loc, access.mask, lanes, period);
  mlir::Value none = arith::ConstantOp::create(b, loc, b.getZeroAttr(stored));
  for (int64_t i = 0; i < period; ++i) {
    mlir::Value from = access.move(b, loc, i * lanes * size);
    // Numbers between the elements exist, but not after the last one.
    bool isLast = stride > 1 && (i + 1) * lanes > period * (lanes - 1) + count;
    mlir::Value mask = access.isFull ? mlir::Value() : masks[i];
    if (stride > 1 && (isLast || mask)) {
      mlir::Value taken = patternMask(b, loc, lanes, i * lanes, count, period);
      mask =
          mask ? arith::AndIOp::create(b, loc, mask, taken).getResult() : taken;
    }
    if (!mask)
      vectors.push_back(LLVM::LoadOp::create(b, loc, stored, from, size));
    else
      vectors.push_back(LLVM::MaskedLoadOp::create(
          b, loc, stored, from, mask, none, b.getI32IntegerAttr(size),
          /*nontemporal=*/UnitAttr()));
  }
  if (period == 1)
    return vectors;
  components = takeApart(b, loc, vectors, [&](int64_t c) { return c < count; });
  components.truncate(count);
  return components;
}

SmallVector<mlir::Value> ArrayLowering::loadGathered(const LaneAccess &access) {
  if (access.hasWords())
    return loadWords(access);
  if (access.isFewBytes())
    return loadBytes(access);
  SmallVector<mlir::Value> components;
  for (Leaf leaf : access.leaves) {
    VectorType stored = storedLanes(leaf.type, access.lanes);
    mlir::Value none = arith::ConstantOp::create(b, loc, b.getZeroAttr(stored));
    components.push_back(LLVM::masked_gather::create(
        b, loc, stored, access.move(b, loc, leaf.offset), access.mask,
        ValueRange(none), b.getI32IntegerAttr(getByteSize(leaf.type))));
  }
  return components;
}

/// Elements that follow each other in each lane's row, so many. Where lanes
/// have the same index in the row, it is added last: rows begin at the same
/// address in all iterations of a loop.
ArrayLowering::LaneAccess ArrayLowering::runAccess(AccessOp op,
                                                   mlir::Value mask,
                                                   ArrayRef<bool> nonNegative,
                                                   int64_t count) {
  SmallVector<mlir::Value> indices(op.getIndices());
  mlir::Value column = indices.back();
  bool isShared = !isa<VectorType>(column.getType());
  if (isShared)
    indices.back() =
        arith::ConstantOp::create(b, loc, b.getZeroAttr(column.getType()));
  LaneAccess access =
      laneAccess(op.getArray(), indices, mask, LaneForm::gather, nonNegative);
  Leaf leaf = access.leaves.front();
  int64_t size = getByteSize(leaf.type);
  access.leaves.clear();
  for (int64_t k = 0; k < count; ++k) {
    access.leaves.push_back(leaf);
    access.leaves.back().offset = k * size;
  }
  if (isShared) {
    if (column.getType().isIndex())
      column = arith::IndexCastOp::create(b, loc, i64, column);
    else if (column.getType().getIntOrFloatBitWidth() < 64)
      column = arith::ExtSIOp::create(b, loc, i64, column);
    access.offset = arith::MulIOp::create(b, loc, column, constant(i64, size));
  }
  return access;
}

SmallVector<mlir::Value> ArrayLowering::loadRun(LoadLanesOp op) {
  LaneAccess access = runAccess(cast<AccessOp>(op.getOperation()), op.getMask(),
                                op.getNonNegative(), op.getNumResults());
  bool areBytes = access.isFewBytes();
  if (areBytes && access.offset)
    access.pointer = LLVM::GEPOp::create(b, loc, access.pointer.getType(),
                                         b.getI8Type(), access.pointer,
                                         ArrayRef<LLVM::GEPArg>(access.offset));
  return asStored(access.leaves, access.lanes,
                  areBytes ? loadBytes(access) : loadWords(access));
}

SmallVector<mlir::Value> ArrayLowering::loadLanes(LoadLanesOp op) {
  if (op->hasAttr(attr::neighbours))
    return loadNeighbours(op);
  LaneAccess access = laneAccess(op.getArray(), op.getIndices(), op.getMask(),
                                 op.getForm(), op.getNonNegative());
  return asStored(access.leaves, access.lanes,
                  op.getForm() == LaneForm::unit
                      ? loadUnit(access, op.getStride())
                      : loadGathered(access));
}

/// Components of the types that memory has.
SmallVector<mlir::Value>
ArrayLowering::asStored(ArrayRef<Leaf> leaves, int64_t lanes,
                        SmallVector<mlir::Value> components) {
  for (auto [leaf, value] : llvm::zip_equal(leaves, components))
    if (VectorType stored = storedLanes(leaf.type, lanes);
        value.getType() != stored)
      value = arith::BitcastOp::create(b, loc, stored, value);
  return components;
}

void ArrayLowering::lowerLanes(LoadLanesOp op) {
  if (op->hasAttr(attr::run)) {
    op->replaceAllUsesWith(loadRun(op));
    return;
  }
  SmallVector<Leaf> leaves;
  collectLeaves(elementType(op.getArray()), 0, leaves);
  for (auto [result, leaf, value] :
       llvm::zip_equal(op.getComponents(), leaves, loadLanes(op))) {
    if (isBool(leaf.type)) {
      mlir::Value zero =
          arith::ConstantOp::create(b, loc, b.getZeroAttr(value.getType()));
      value =
          arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, value, zero);
    }
    result.replaceAllUsesWith(value);
  }
}

static SmallVector<mlir::Value> toWords(OpBuilder &b, Location loc,
                                        ArrayRef<mlir::Value> components,
                                        VectorType stored) {
  return llvm::map_to_vector(components, [&](mlir::Value component) {
    return component.getType() == stored
               ? component
               : arith::BitcastOp::create(b, loc, stored, component)
                     .getResult();
  });
}

void ArrayLowering::storeUnit(const LaneAccess &access, int64_t stride,
                              ArrayRef<mlir::Value> components) {
  int64_t count = access.leaves.size(), lanes = access.lanes;
  int64_t period = count * stride;
  int64_t size = getByteSize(access.leaves[0].type);
  VectorType stored = access.wordLanes();
  SmallVector<mlir::Value> words = toWords(b, loc, components, stored);
  if (access.prefersRows(stride) && (access.isFull || stride > 1)) {
    auto pointers = access.storePointers(b, loc, entry, period * size);
    return storeRows(b, loc, words,
                     [&](int64_t lane) { return pointers[lane]; });
  }
  SmallVector<mlir::Value> masks =
      spreadMask(b, loc, access.mask, lanes, period);
  // The numbers between the elements stay as they are.
  if (stride > 1)
    words.resize(period, LLVM::PoisonOp::create(b, loc, stored));
  for (auto [i, vector] : llvm::enumerate(putTogether(b, loc, words))) {
    mlir::Value to = access.move(b, loc, i * lanes * size), mask = masks[i];
    if (stride > 1) {
      mlir::Value taken = patternMask(b, loc, lanes, i * lanes, count, period);
      mask = access.isFull
                 ? taken
                 : arith::AndIOp::create(b, loc, mask, taken).getResult();
    }
    if (access.isFull && stride == 1)
      LLVM::StoreOp::create(b, loc, vector, to, size);
    else
      LLVM::MaskedStoreOp::create(b, loc, vector, to, mask,
                                  b.getI32IntegerAttr(size));
  }
}

void ArrayLowering::storeScattered(const LaneAccess &access,
                                   ArrayRef<mlir::Value> components) {
  if (access.hasWords()) {
    auto pointers = access.storePointers(b, loc, entry, /*step=*/0);
    return storeRows(b, loc, toWords(b, loc, components, access.wordLanes()),
                     [&](int64_t lane) { return pointers[lane]; });
  }
  for (auto [leaf, value] : llvm::zip_equal(access.leaves, components))
    LLVM::masked_scatter::create(b, loc, value,
                                 access.move(b, loc, leaf.offset), access.mask,
                                 b.getI32IntegerAttr(getByteSize(leaf.type)));
}

void ArrayLowering::lowerLanes(StoreLanesOp op) {
  if (op->hasAttr(attr::run))
    return storeScattered(runAccess(cast<AccessOp>(op.getOperation()),
                                    op.getMask(), op.getNonNegative(),
                                    op.getComponents().size()),
                          SmallVector<mlir::Value>(op.getComponents()));
  LaneAccess access = laneAccess(op.getArray(), op.getIndices(), op.getMask(),
                                 op.getForm(), op.getNonNegative());
  SmallVector<mlir::Value> components;
  for (auto [leaf, value] : llvm::zip_equal(access.leaves, op.getComponents()))
    components.push_back(
        isBool(leaf.type)
            ? arith::ExtUIOp::create(
                  b, loc, storedLanes(leaf.type, access.lanes), value)
                  .getResult()
            : value);
  if (op.getForm() == LaneForm::unit)
    storeUnit(access, op.getStride(), components);
  else
    storeScattered(access, components);
}
