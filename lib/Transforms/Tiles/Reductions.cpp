//===- Reductions.cpp - Models of reductions ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Threads of a block combine their elements, and then their results in halves,
// in memory: the order depends on the tile and the block only.
//
//===----------------------------------------------------------------------===//

#include "Reductions.h"
#include "Models.h"

#include "KernelFunction.h"

#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/Support/MathExtras.h"

#include <limits>

using namespace mlir;

/// Components of vectors that are added one by one, each with a barrier in
/// blocks of several warps; in memory each halving has one.
static constexpr int64_t mostParts = 4;

namespace warp::tiles {

//===----------------------------------------------------------------------===//
// Pairs
//===----------------------------------------------------------------------===//

/// NaN, or the last integer.
Value ReductionLowering::worst(TileReduction kind, Type type) {
  if (kind == TileReduction::add)
    return zero(type);
  bool isMin = kind == TileReduction::min;
  if (isa<FloatType>(type))
    return constant(type, std::numeric_limits<double>::quiet_NaN());
  auto integer = cast<IntegerType>(type);
  unsigned width = integer.getWidth();
  APInt last = integer.isUnsigned()
                   ? (isMin ? APInt::getMaxValue(width) : APInt(width, 0))
                   : (isMin ? APInt::getSignedMaxValue(width)
                            : APInt::getSignedMinValue(width));
  return ConstantOp::create(b, loc, IntegerAttr::get(type, last));
}

/// NaN never wins, and what there is loses if it is NaN.
Value ReductionLowering::isBetter(TileReduction kind, Value candidate,
                                  Value best, bool orEqual) {
  StringRef name = kind == TileReduction::min ? (orEqual ? "le" : "lt")
                                              : (orEqual ? "ge" : "gt");
  Value better = builtin(name, {candidate, best});
  if (!isa<FloatType>(best.getType()))
    return better;
  Value nothing = builtin("ne", {best, best});
  return arith::OrIOp::create(b, loc, better, nothing);
}

/// Values, and with a second one their positions; the lower position wins.
Values ReductionLowering::combine(TileReduction kind, ValueRange best,
                                  ValueRange next) {
  if (kind == TileReduction::add) {
    Value sum = builtin("add", {best[0], next[0]});
    sum.getDefiningOp()->setAttr(warp::attr::anyOrder, b.getUnitAttr());
    return {sum};
  }
  Type type = best[0].getType();
  if (best.size() == 1 && getTarget(kernel).isSimt() &&
      (type.isF32() || type.isF64())) {
    // An instruction, which skips NaN.
    if (kind == TileReduction::min)
      return {arith::MinNumFOp::create(b, loc, best[0], next[0])};
    return {arith::MaxNumFOp::create(b, loc, best[0], next[0])};
  }
  // By IEEE 754-2019: NaN is missing and -0 lies below +0.
  if (best.size() == 1 && isa<FloatType>(type))
    return {builtin(kind == TileReduction::min ? "min" : "max",
                    {best[0], next[0]})};
  Value wins = isBetter(kind, next[0], best[0], false);
  if (best.size() > 1) {
    Value ties = builtin("eq", {next[0], best[0]});
    Value earlier = less(next[1], best[1]);
    wins = arith::OrIOp::create(b, loc, wins, both(ties, earlier));
  }
  Values chosen;
  for (auto [a, c] : llvm::zip_equal(next, best))
    chosen.push_back(a.getType().isSignlessInteger()
                         ? Value(arith::SelectOp::create(b, loc, wins, a, c))
                         : builtin("where", {wins, a, c}));
  return chosen;
}

int64_t getPartialBytes(Operation *op, int64_t threads) {
  Type element = tileType(op->getOperand(0)).getElementType();
  return threads == 1 || callsForTiles(op, threads)
             ? 0
             : threads * (getByteSize(element) + 8);
}

//===----------------------------------------------------------------------===//
// Reductions
//===----------------------------------------------------------------------===//

/// By the device library, with exchanges between lanes. Bits of positions are
/// those of a number. Parts of one element have scratch memory each.
Values ReductionLowering::overWarps(Operation *op, TileReduction kind,
                                    Values sums, int64_t part) {
  Type real = b.getF32Type();
  Value own = ScratchOp::create(
      entry, loc, ScratchType::get(b.getContext(), sums.size(), real));
  for (auto [i, sum] : llvm::enumerate(sums)) {
    Value bits = sum;
    if (i > 0)
      bits = arith::BitcastOp::create(b, loc, real, sum);
    ScratchStoreOp::create(b, loc, bits, own, number(i));
  }
  int64_t offset = scratchOf(op) + part * threads * getByteSize(real);
  Value memory = arrayAt(offset, sums.size() * threads, real);
  StringRef name = kind == TileReduction::add   ? "add"
                   : kind == TileReduction::min ? "min"
                                                : "max";
  callLibrary(Twine("warp_tile_combine_") + (sums.size() > 1 ? "arg" : "") +
                  name,
              {}, {own, addressOf(memory), number(threads)});
  Values made;
  for (auto [i, sum] : llvm::enumerate(sums)) {
    Value bits = ScratchLoadOp::create(b, loc, real, own, number(i));
    made.push_back(
        i == 0 ? bits
               : Value(arith::BitcastOp::create(b, loc, sum.getType(), bits)));
  }
  return made;
}

/// The values of all threads of the block, combined; in every thread.
Values ReductionLowering::overBlock(Operation *op, TileReduction kind,
                                    Values sums) {
  if (threads == 1)
    return sums;
  const TargetInfo &target = getTarget(kernel);
  bool byWarps =
      target.has(Feature::BlockTiles) && target.hasFullSubgroups(threads);
  if (byWarps && sums[0].getType().isF32())
    return overWarps(op, kind, sums);
  auto vec = dyn_cast<VecType>(sums[0].getType());
  if (byWarps && vec && kind == TileReduction::add &&
      vec.getElementType().isF32() && getComponentCount(vec) <= mostParts) {
    Values parts;
    for (int64_t i = 0; i < getComponentCount(vec); ++i) {
      Value part = ExtractOp::create(b, loc, vec.getElementType(), sums[0],
                                     constant(b.getIntegerType(32, true), i));
      parts.push_back(overWarps(op, kind, {part}, i)[0]);
    }
    return {ConstructOp::create(b, loc, vec, parts)};
  }
  int64_t offset = scratchOf(op);
  // Arrays have elements of the language's types, so positions get a sign.
  SmallVector<Type> stored;
  Values memory;
  for (Value sum : sums) {
    Type type = sum.getType();
    stored.push_back(type.isSignlessInteger(32) ? b.getIntegerType(32, true)
                                                : type);
    memory.push_back(arrayAt(offset, threads, stored.back()));
    offset += llvm::alignTo(threads * getByteSize(type), 8);
  }
  auto read = [&](Value index) {
    Values values;
    for (auto [sum, type, array] : llvm::zip_equal(sums, stored, memory)) {
      Value value = LoadOp::create(b, loc, type, array, index);
      values.push_back(cast(value, sum.getType()));
    }
    return values;
  };
  auto write = [&](ValueRange values) {
    for (auto [value, type, array] : llvm::zip_equal(values, stored, memory))
      StoreOp::create(b, loc, cast(value, type), array, thread);
  };
  write(sums);
  for (int64_t half = llvm::PowerOf2Ceil(threads) / 2; half > 0; half /= 2) {
    barrier();
    Value exists = less(add(thread, number(half)), number(threads));
    Value isLower = less(thread, number(half));
    ifHolds(both(exists, isLower), [&] {
      write(combine(kind, read(thread), read(add(thread, number(half)))));
    });
  }
  barrier();
  return read(number(0));
}

/// Floats as signed integers in the same order, and back: the lowest one is
/// NaN, as is the highest.
static Value flipBelowZero(OpBuilder &b, Location loc, Value bits) {
  Type type = bits.getType();
  unsigned width = type.getIntOrFloatBitWidth();
  auto constantOf = [&](APInt value) -> Value {
    return arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  };
  Value signs =
      arith::ShRSIOp::create(b, loc, bits, constantOf(APInt(width, width - 1)));
  Value flipped = arith::AndIOp::create(
      b, loc, signs, constantOf(APInt::getSignedMaxValue(width)));
  return arith::XOrIOp::create(b, loc, bits, flipped);
}

/// Extrema of floats on a CPU: integers are compared in vectors, whereas NaN
/// keeps floats out of those. Positions are a second pass, the first one with
/// what won.
void ReductionLowering::reduceOrdered(Operation *op, TileReduction kind,
                                      Value tile, bool positions) {
  ArrayRef<int64_t> shape = tileType(tile).getShape();
  Type real = tileType(tile).getElementType();
  unsigned width = real.getIntOrFloatBitWidth();
  Type bits = b.getIntegerType(width);
  bool isMin = kind == TileReduction::min;
  Value worst = arith::ConstantOp::create(
      b, loc,
      b.getIntegerAttr(bits, isMin ? APInt::getSignedMaxValue(width)
                                   : APInt::getSignedMinValue(width)));
  auto keyAt = [&](ValueRange at) -> Value {
    Value x = element(tile, at);
    // Both zeros tie.
    Value bitsOf = positions ? builtin("add", {x, constant(real, 0)}) : x;
    Value key =
        flipBelowZero(b, loc, arith::BitcastOp::create(b, loc, bits, bitsOf));
    Value isNone = builtin("ne", {x, x});
    return arith::SelectOp::create(b, loc, isNone, worst, key);
  };
  Value best =
      elements(op, shape, worst, [&](ValueRange at, ValueRange best) -> Values {
        Value key = keyAt(at);
        if (isMin)
          return {arith::MinSIOp::create(b, loc, best[0], key)};
        return {arith::MaxSIOp::create(b, loc, best[0], key)};
      })[0];
  if (!positions) {
    store(op->getResult(0), number(0),
          arith::BitcastOp::create(b, loc, real, flipBelowZero(b, loc, best)));
    return;
  }
  Value last = number(INT32_MAX);
  Value first =
      elements(op, shape, last, [&](ValueRange at, ValueRange first) -> Values {
        Value wins = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                                           keyAt(at), best);
        Value place =
            arith::SelectOp::create(b, loc, wins, linear(shape, at), last);
        return {arith::MinSIOp::create(b, loc, first[0], place)};
      })[0];
  store(op->getResult(0), number(0), cast(first, b.getIntegerType(32, true)));
}

void ReductionLowering::reduce(Operation *op, TileReduction kind, Value tile,
                               std::optional<int64_t> axis, bool positions) {
  TileType type = tileType(tile);
  Type element = type.getElementType();
  // An inlined tile is not worth to be computed twice.
  Operation *def = tile.getDefiningOp();
  bool isKept = !def || !isInline(def);
  if (threads == 1 && !axis && kind != TileReduction::add &&
      (isKept || !positions) && (element.isF32() || element.isF64()))
    return reduceOrdered(op, kind, tile, positions);
  Value result = op->getResult(0);
  Values first{worst(kind, type.getElementType())};
  if (positions)
    first.push_back(number(INT32_MAX));
  auto step = [&](ValueRange sums, Value next, Value position) {
    Values candidate{next};
    if (positions)
      candidate.push_back(position);
    return combine(kind, sums, candidate);
  };
  auto finish = [&](ValueRange indices, ValueRange sums) {
    Value value = positions ? sums[1] : sums[0];
    if (positions) {
      // The first position, if all elements are NaN.
      Value none = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq,
                                         value, number(INT32_MAX));
      value = arith::SelectOp::create(b, loc, none, number(0), value);
      value = cast(value, b.getIntegerType(32, true));
    }
    store(result, indices, value);
  };
  if (!axis) {
    Values sums = elements(op, type.getShape(), first,
                           [&](ValueRange at, ValueRange sums) {
                             return step(sums, this->element(tile, at),
                                         linear(type.getShape(), at));
                           });
    sums = overBlock(op, kind, sums);
    if (isReplicated(result))
      finish(ValueRange(number(0)), sums);
    else
      byFirstThread([&] { finish(ValueRange(number(0)), sums); });
    return;
  }
  SmallVector<int64_t> outer(type.getShape());
  int64_t extent = outer[*axis];
  outer.erase(outer.begin() + *axis);
  if (outer.empty())
    outer.push_back(1);
  elements(op, outer, [&](ValueRange indices) {
    Values sums = loop(number(0), number(extent), number(1), first,
                       [&](Value i, ValueRange sums) {
                         Values at(indices.take_front(type.getRank() - 1));
                         at.insert(at.begin() + *axis, i);
                         return step(sums, this->element(tile, at), i);
                       });
    finish(indices, sums);
  });
}

//===----------------------------------------------------------------------===//
// Adjoints
//===----------------------------------------------------------------------===//

namespace {

struct ReductionAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  LogicalResult combined(TileReduceOp reduce);

private:
  /// Elements of a reduced tile, for each that they were reduced from.
  Value expand(Value tile, ArrayRef<int64_t> shape,
               std::optional<int64_t> axis);
};

} // namespace

Value ReductionAdjoint::expand(Value tile, ArrayRef<int64_t> shape,
                               std::optional<int64_t> axis) {
  SmallVector<int64_t> kept(shape);
  for (auto [d, extent] : llvm::enumerate(kept))
    if (!axis || int64_t(d) == *axis)
      extent = 1;
  return broadcast(reshape(tile, kept), shape);
}

LogicalResult ReductionAdjoint::combined(TileReduceOp reduce) {
  Value g = take();
  if (!g)
    return success();
  Value tile = reduce.getTile();
  ArrayRef<int64_t> shape = typeOf(tile).getShape();
  std::optional<int64_t> axis = reduce.getAxis();
  Value spread = expand(g, shape, axis);
  if (reduce.getKind() == TileReduction::add) {
    give(tile, spread);
    return success();
  }
  Type i32 = b.getIntegerType(32, true);
  Value winner = TileArgReduceOp::create(
      b, loc, getReducedType(typeOf(tile), axis, i32), reduce.getKind(),
      reverse.recover(tile), axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
  Value place = axis ? numbers(shape, *axis)
                     : reshape(iota(typeOf(tile).getNumElements()), shape);
  Value wins = expand(winner, shape, axis);
  give(tile, map({spread, place, wins}, [&](ValueRange x) {
         return apply("where", {apply("eq", {x[1], x[2]}), x[0],
                                zeroOf(x[0].getType())});
       }));
  return success();
}

//===----------------------------------------------------------------------===//
// Models
//===----------------------------------------------------------------------===//

namespace {

template <typename Model, typename Op>
struct ReduceModel : TileModel<Model, Op> {
  static bool isWhole(Operation *op) { return !mlir::cast<Op>(op).getAxis(); }
  bool isByOwners(Operation *op) const { return isWhole(op); }
  bool canReplicate(Operation *op) const { return isWhole(op); }
  TileRead getRead(Operation *op, OpOperand &) const {
    return isWhole(op) ? TileRead::Own : TileRead::Once;
  }
  bool readsElements(Operation *, OpOperand &) const { return true; }
  int64_t getScratchBytes(Operation *op, int64_t threads) const {
    return getPartialBytes(op, threads);
  }
  void lower(Operation *op, TileLowering &lowering) const {
    auto reduce = mlir::cast<Op>(op);
    ReductionLowering(lowering.state)
        .reduce(op, reduce.getKind(), reduce.getTile(), reduce.getAxis(),
                Model::positions);
  }
};

struct SumModel : ReduceModel<SumModel, TileReduceOp> {
  static constexpr bool positions = false;
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    return ReductionAdjoint(reverse.reverse, op)
        .combined(cast<TileReduceOp>(op));
  }
};

struct PositionModel : ReduceModel<PositionModel, TileArgReduceOp> {
  static constexpr bool positions = true;
  /// Positions.
  LogicalResult adjoint(Operation *, autodiff::TileReverse &) const {
    return success();
  }
};

} // namespace

void attachReductions(MLIRContext &context) {
  TileReduceOp::attachInterface<SumModel>(context);
  TileArgReduceOp::attachInterface<PositionModel>(context);
}

} // namespace warp::tiles
