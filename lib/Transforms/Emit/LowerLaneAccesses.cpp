//===- LowerLaneAccesses.cpp - Elements of neighbouring threads -----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Lanes whose elements follow each other read and write whole vectors. An
// element of n numbers is taken apart in registers: the n vectors that hold N
// elements become one vector per component. Where n is even, pairs of vectors
// are split into the numbers at even and at odd places, which leaves two
// elements of n / 2 numbers each:
//
//     x0 y0 z0 w0 | x1 y1 z1 w1 ...  =>  x0 z0 x1 z1 ...  and  y0 w0 y1 w1 ...
//
// Where n is odd, the numbers of a component lie at different places in each
// vector, so blends by constant masks bring them together and one permutation
// sorts them:
//
//     x0 y0 z0 x1 | y1 z1 x2 y2 | z2 x3 y3 z3
//     x: take 0, 3 of the first, 2 of the second, 1 of the third
//        x0 x3 x2 x1 -> x0 x1 x2 x3
//
// An element of n = 2^k numbers thus costs n k permutations. Elements that lie
// anywhere are gathered and scattered, component by component.
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"
#include "Lanes/Spread.h"
#include "WarpDialect/ParameterLayout.h"

#include "mlir/Dialect/Arith/IR/Arith.h"

using namespace mlir;
using namespace warp;

namespace {

/// Vectors in registers, whose lanes are numbered through.
class Registers {
public:
  Registers(OpBuilder &b, Location loc, int64_t lanes)
      : b(b), loc(loc), lanes(lanes) {}

  mlir::Value shuffle(mlir::Value x, mlir::Value y, ArrayRef<int32_t> places) {
    return LLVM::ShuffleVectorOp::create(b, loc, x, y, places);
  }

  /// One vector per component out of those that hold elements one after the
  /// other; null where `isWanted` says so.
  SmallVector<mlir::Value> takeApart(ArrayRef<mlir::Value> vectors,
                                     function_ref<bool(int64_t)> isWanted);
  /// The inverse.
  SmallVector<mlir::Value> putTogether(ArrayRef<mlir::Value> components);

private:
  mlir::Value takeOdd(ArrayRef<mlir::Value> vectors, int64_t c);
  mlir::Value permute(mlir::Value x, function_ref<int64_t(int64_t)> from);
  /// Of each place the number that the vector `which(place)` has there.
  mlir::Value blend(ArrayRef<mlir::Value> vectors,
                    function_ref<int64_t(int64_t)> which);

  OpBuilder &b;
  Location loc;
  int64_t lanes;
};

} // namespace

mlir::Value Registers::permute(mlir::Value x,
                               function_ref<int64_t(int64_t)> from) {
  SmallVector<int32_t> places;
  for (int64_t place = 0; place < lanes; ++place)
    places.push_back(from(place));
  return shuffle(x, x, places);
}

mlir::Value Registers::blend(ArrayRef<mlir::Value> vectors,
                             function_ref<int64_t(int64_t)> which) {
  mlir::Value blended = vectors[0];
  for (int64_t number = 1, end = vectors.size(); number < end; ++number) {
    SmallVector<int32_t> places;
    for (int64_t place = 0; place < lanes; ++place)
      places.push_back(which(place) == number ? lanes + place : place);
    blended = shuffle(blended, vectors[number], places);
  }
  return blended;
}

/// One component of elements of an odd number of them.
mlir::Value Registers::takeOdd(ArrayRef<mlir::Value> vectors, int64_t c) {
  int64_t count = vectors.size();
  SmallVector<int64_t> vectorAt(lanes);
  for (int64_t lane = 0; lane < lanes; ++lane)
    vectorAt[(lane * count + c) % lanes] = (lane * count + c) / lanes;
  mlir::Value blended =
      blend(vectors, [&](int64_t place) { return vectorAt[place]; });
  return permute(blended,
                 [&](int64_t lane) { return (lane * count + c) % lanes; });
}

SmallVector<mlir::Value>
Registers::takeApart(ArrayRef<mlir::Value> vectors,
                     function_ref<bool(int64_t)> isWanted) {
  int64_t count = vectors.size();
  SmallVector<mlir::Value> components(count);
  if (count == 1 && isWanted(0))
    return {vectors[0]};
  if (count % 2 != 0) {
    for (int64_t c = 0; c < count; ++c)
      if (isWanted(c))
        components[c] = takeOdd(vectors, c);
    return components;
  }
  for (int64_t parity : {0, 1}) {
    auto isWantedHere = [&](int64_t c) { return isWanted(2 * c + parity); };
    if (llvm::none_of(llvm::seq<int64_t>(0, count / 2), isWantedHere))
      continue;
    SmallVector<int32_t> places;
    for (int64_t lane = 0; lane < lanes; ++lane)
      places.push_back(2 * lane + parity);
    SmallVector<mlir::Value> half;
    for (int64_t i = 0; i < count; i += 2)
      half.push_back(shuffle(vectors[i], vectors[i + 1], places));
    for (auto [c, component] : llvm::enumerate(takeApart(half, isWantedHere)))
      components[2 * c + parity] = component;
  }
  return components;
}

SmallVector<mlir::Value>
Registers::putTogether(ArrayRef<mlir::Value> components) {
  int64_t count = components.size();
  SmallVector<mlir::Value> vectors;
  if (count == 1)
    return {components[0]};
  if (count % 2 != 0) {
    SmallVector<mlir::Value> ordered;
    for (auto [c, component] : llvm::enumerate(components)) {
      SmallVector<int64_t> laneAt(lanes);
      for (int64_t lane = 0; lane < lanes; ++lane)
        laneAt[(lane * count + c) % lanes] = lane;
      ordered.push_back(
          permute(component, [&](int64_t place) { return laneAt[place]; }));
    }
    for (int64_t i = 0; i < count; ++i)
      vectors.push_back(blend(
          ordered, [&](int64_t place) { return (i * lanes + place) % count; }));
    return vectors;
  }
  SmallVector<mlir::Value> halves[2];
  for (int64_t parity : {0, 1}) {
    SmallVector<mlir::Value> half;
    for (int64_t c = parity; c < count; c += 2)
      half.push_back(components[c]);
    halves[parity] = putTogether(half);
  }
  for (int64_t i = 0; i < count; ++i) {
    SmallVector<int32_t> places;
    for (int64_t lane = 0; lane < lanes; ++lane)
      places.push_back(i % 2 * (lanes / 2) + lane / 2 + lane % 2 * lanes);
    vectors.push_back(shuffle(halves[0][i / 2], halves[1][i / 2], places));
  }
  return vectors;
}

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

/// Of a vector that holds the numbers from `first` on: those that belong to
/// elements which are taken, `count` numbers of every `period`.
static mlir::Value patternMask(OpBuilder &b, Location loc, int64_t lanes,
                               int64_t first, int64_t count, int64_t period) {
  SmallVector<bool> taken;
  for (int64_t lane = 0; lane < lanes; ++lane)
    taken.push_back((first + lane) % period < count);
  auto type = VectorType::get(lanes, b.getI1Type());
  return arith::ConstantOp::create(b, loc, DenseElementsAttr::get(type, taken));
}

SmallVector<mlir::Value> ArrayLowering::loadUnit(const LaneAccess &access,
                                                 int64_t stride) {
  int64_t count = access.leaves.size(), lanes = access.lanes;
  int64_t period = count * stride;
  VectorType stored = storedLanes(access.leaves[0].type, lanes);
  int64_t size = getByteSize(access.leaves[0].type);
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
  Registers registers(b, loc, lanes);
  components =
      registers.takeApart(vectors, [&](int64_t c) { return c < count; });
  components.truncate(count);
  return components;
}

SmallVector<mlir::Value> ArrayLowering::loadGathered(const LaneAccess &access) {
  if (access.hasWords())
    return loadWords(access);
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

void ArrayLowering::lowerLanes(LoadLanesOp op) {
  LaneAccess access = laneAccess(op.getArray(), op.getIndices(), op.getMask(),
                                 op.getForm(), op.getNonNegative());
  SmallVector<mlir::Value> components = op.getForm() == LaneForm::unit
                                            ? loadUnit(access, op.getStride())
                                            : loadGathered(access);
  for (auto [result, leaf, value] :
       llvm::zip_equal(op.getComponents(), access.leaves, components)) {
    if (isBool(leaf.type)) {
      mlir::Value zero =
          arith::ConstantOp::create(b, loc, b.getZeroAttr(value.getType()));
      value =
          arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ne, value, zero);
    }
    result.replaceAllUsesWith(value);
  }
}

void ArrayLowering::storeUnit(const LaneAccess &access,
                              ArrayRef<mlir::Value> components) {
  int64_t count = access.leaves.size(), lanes = access.lanes;
  int64_t size = getByteSize(access.leaves[0].type);
  SmallVector<mlir::Value> masks =
      spreadMask(b, loc, access.mask, lanes, count);
  Registers registers(b, loc, lanes);
  for (auto [i, vector] : llvm::enumerate(registers.putTogether(components))) {
    mlir::Value to = access.move(b, loc, i * lanes * size);
    if (access.isFull)
      LLVM::StoreOp::create(b, loc, vector, to, size);
    else
      LLVM::MaskedStoreOp::create(b, loc, vector, to, masks[i],
                                  b.getI32IntegerAttr(size));
  }
}

void ArrayLowering::storeScattered(const LaneAccess &access,
                                   ArrayRef<mlir::Value> components) {
  for (auto [leaf, value] : llvm::zip_equal(access.leaves, components))
    LLVM::masked_scatter::create(b, loc, value,
                                 access.move(b, loc, leaf.offset), access.mask,
                                 b.getI32IntegerAttr(getByteSize(leaf.type)));
}

void ArrayLowering::lowerLanes(StoreLanesOp op) {
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
    storeUnit(access, components);
  else
    storeScattered(access, components);
}
