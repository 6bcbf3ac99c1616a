//===- LaneRegisters.cpp - Deinterleaving of lanes' elements --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The n vectors that hold N elements of n numbers each become one vector per
// component. Where n is even, pairs of vectors are split into the numbers at
// even and at odd places, which leaves two elements of n / 2 numbers each:
//
//     x0 y0 z0 w0 | x1 y1 z1 w1 ...  =>  x0 z0 x1 z1 ...  and  y0 w0 y1 w1 ...
//
// If n is odd, the numbers of a component lie at different places in each
// vector, so blends by constant masks bring them together and one permutation
// sorts them:
//
//     x0 y0 z0 x1 | y1 z1 x2 y2 | z2 x3 y3 z3
//     x: take 0, 3 of the first, 2 of the second, 1 of the third
//        x0 x3 x2 x1 -> x0 x1 x2 x3
//
// An element of n = 2^k numbers thus costs n k permutations. Rows are better
// for most elements of 32 or 64 bits (LowerLaneRows.cpp).
//
//===----------------------------------------------------------------------===//

#include "LaneAccess.h"

#include "llvm/ADT/Sequence.h"

using namespace mlir;
using namespace warp;

static int64_t lanesOf(ArrayRef<mlir::Value> vectors) {
  return cast<VectorType>(vectors[0].getType()).getNumElements();
}

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
  /// For each position the number that the vector `which(position)` has there.
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

SmallVector<mlir::Value> warp::takeApart(OpBuilder &b, Location loc,
                                         ArrayRef<mlir::Value> vectors,
                                         function_ref<bool(int64_t)> isWanted) {
  return Registers(b, loc, lanesOf(vectors)).takeApart(vectors, isWanted);
}

SmallVector<mlir::Value> warp::putTogether(OpBuilder &b, Location loc,
                                           ArrayRef<mlir::Value> components) {
  return Registers(b, loc, lanesOf(components)).putTogether(components);
}
