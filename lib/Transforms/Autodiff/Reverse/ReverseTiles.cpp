//===- ReverseTiles.cpp - Adjoints of operations on tiles -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Cotangents of tiles are tiles, so rules are operations on tiles:
//
//   primal                  adjoint, on the cotangent g of the result
//   load / store, atomic    add to gradients / take them, and a store zeroes
//   map                     a map of the body's adjoint
//   splat, operand of a map what each thread's elements have, summed
//   sum, broadcast          each other's
//   slice / insert, gather / scatter, get / set, shapes    each other's
//   min, max                where the extremum is
//   scan                    the scan from the other end
//   matmul                  alpha g b^T, alpha a^T g, beta g
//   Cholesky, solve         triangular solves, on the triangle that is read
//   Fourier transform       the other one
//
//===----------------------------------------------------------------------===//

#include "Reverse.h"

#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "llvm/ADT/TypeSwitch.h"
#include "llvm/Support/MathExtras.h"

using namespace mlir;

namespace warp::autodiff {

/// A tile access reads again what was there, or says why it cannot.
LogicalResult ReverseBuilder::replayTileAccess(Operation *op) {
  auto load = dyn_cast<TileLoadOp>(op);
  if (!load) {
    if (op->use_empty())
      return success();
    return op->emitOpError("returns what was there before, which depends on "
                           "the order of threads; a derivative cannot go "
                           "through it");
  }
  std::string why;
  bool needsOneThread;
  Recovery recovery = memory.getRecovery(op, why, needsOneThread);
  Operation *clone = op->clone();
  clone->setOperands(recover(op->getOperands()));
  if (recovery == Recovery::Preserved)
    clone->setOperand(0, rebase(load.getArray(), [&](Value root) {
                        return getHidden(HiddenKind::Preserved,
                                         leaves.of(root).front(),
                                         root.getType());
                      }));
  builder.insert(clone);
  if (recovery == Recovery::Impossible)
    clone->setAttr(attr::unrecoverable, builder.getStringAttr(why));
  if (needsOneThread)
    clone->setAttr(attr::assumesOneThread, builder.getUnitAttr());
  setRecovered(op->getResults(), clone->getResults());
  return success();
}

namespace {

/// Writes the adjoint of one operation.
class TileReverse {
public:
  TileReverse(ReverseBuilder &reverse, Operation *op)
      : reverse(reverse), b(reverse.builder), loc(op->getLoc()), op(op) {
    auto kernel = op->getParentOfType<func::FuncOp>();
    auto attribute =
        kernel->getAttrOfType<IntegerAttr>(warp::attr::blockThreads);
    threads = attribute ? attribute.getInt() : 1;
  }

  LogicalResult run();

private:
  static TileType typeOf(Value tile) { return cast<TileType>(tile.getType()); }
  TileType shaped(ArrayRef<int64_t> shape, Type element) {
    return TileType::get(b.getContext(), shape, element);
  }
  /// The type of the cotangent of a tile.
  TileType cotangentType(Value tile) {
    return cast<TileType>(differentialType(tile.getType()));
  }
  Value index(int64_t value) {
    return ConstantOp::create(
        b, loc, b.getIntegerAttr(b.getIntegerType(32, true), value));
  }
  Value zeroOf(Type type) { return zero(b, loc, type); }
  Value apply(StringRef name, ValueRange operands) {
    return createBuiltin(b, loc, name, operands)->getResult(0);
  }
  Value map(ValueRange inputs, function_ref<Value(ValueRange)> function) {
    return mapTiles(b, loc, inputs, function);
  }
  Value negate(Value tile) {
    return map(tile, [&](ValueRange x) { return apply("neg", x); });
  }
  Value reshape(Value tile, ArrayRef<int64_t> shape) {
    TileType type = shaped(shape, typeOf(tile).getElementType());
    if (type == tile.getType())
      return tile;
    return TileReshapeOp::create(b, loc, type, tile);
  }
  Value broadcast(Value tile, ArrayRef<int64_t> shape) {
    TileType type = shaped(shape, typeOf(tile).getElementType());
    if (type == tile.getType())
      return tile;
    return TileBroadcastOp::create(b, loc, type, tile);
  }
  Value transpose(Value tile) {
    TileType type = typeOf(tile);
    return TileTransposeOp::create(
        b, loc,
        shaped({type.getShape()[1], type.getShape()[0]}, type.getElementType()),
        tile, ArrayRef<int64_t>{1, 0});
  }
  Value reduce(Value tile, std::optional<int64_t> axis) {
    TileType type = typeOf(tile);
    return TileReduceOp::create(
        b, loc, getReducedType(type, axis, type.getElementType()),
        TileReduction::add, tile,
        axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
  }
  /// What has lost a dimension gets it back, with extent 1.
  Value expand(Value tile, ArrayRef<int64_t> shape,
               std::optional<int64_t> axis) {
    SmallVector<int64_t> kept(shape);
    for (auto [d, extent] : llvm::enumerate(kept))
      if (!axis || int64_t(d) == *axis)
        extent = 1;
    return broadcast(reshape(tile, kept), shape);
  }
  Value iota(int64_t count) {
    return TileIotaOp::create(
        b, loc, shaped({count}, b.getIntegerType(32, true)), index(0),
        index(1));
  }
  /// Numbers along one dimension, in the shape of a tile.
  Value numbers(ArrayRef<int64_t> shape, int64_t axis) {
    SmallVector<int64_t> flat(shape.size(), 1);
    flat[axis] = shape[axis];
    return broadcast(reshape(iota(shape[axis]), flat), shape);
  }
  Value multiply(Value x, Value y, bool transposeX, bool transposeY,
                 Value alpha = {}) {
    TileType a = typeOf(x), c = typeOf(y);
    TileType type =
        shaped({a.getShape()[transposeX], c.getShape()[!transposeY]},
               a.getElementType().getIntOrFloatBitWidth() >=
                       c.getElementType().getIntOrFloatBitWidth()
                   ? a.getElementType()
                   : c.getElementType());
    return TileMatmulOp::create(b, loc, type, x, y, Value(), alpha, Value(),
                                transposeX ? b.getUnitAttr() : UnitAttr(),
                                transposeY ? b.getUnitAttr() : UnitAttr());
  }
  Value solve(Value matrix, Value rhs, bool upper, bool transposed) {
    return TileSolveOp::create(b, loc, rhs.getType(), matrix, rhs,
                               upper ? b.getUnitAttr() : UnitAttr(),
                               transposed ? b.getUnitAttr() : UnitAttr());
  }

  Value overThreads(Value tile, Type type);
  Value take(unsigned result = 0) {
    return reverse.takeCotangent(op->getResult(result));
  }
  void give(Value primal, Value cotangent) {
    reverse.addCotangent(primal, cotangent);
  }
  bool wants(Value primal) { return reverse.isActive(primal); }
  SmallVector<Value> recover(ValueRange values) {
    return reverse.recover(values);
  }

  LogicalResult reverseMap(TileMapOp map);
  LogicalResult reverseLoad(TileLoadOp load);
  LogicalResult reverseStore(TileStoreOp store);
  LogicalResult reverseAtomic(TileAtomicOp atomic);
  LogicalResult reverseSet(TileSetOp set);
  LogicalResult reverseReduce(TileReduceOp reduce);
  LogicalResult reverseScan(TileScanOp scan);
  LogicalResult reverseMatmul(TileMatmulOp matmul);
  LogicalResult reverseCholesky(TileCholeskyOp factor);
  LogicalResult reverseSolve(TileSolveOp solve);
  LogicalResult reversePart();
  LogicalResult refuse();

  template <typename Op> Value loadGradient(Op access, TileType type);

  ReverseBuilder &reverse;
  OpBuilder &b;
  Location loc;
  Operation *op;
  int64_t threads;
};

} // namespace

LogicalResult TileReverse::refuse() {
  for (Value result : op->getResults())
    if (take())
      return op->emitError("'")
             << op->getName().stripDialect()
             << "' has no derivative here; write a custom derivative, or "
                "stop_gradient(...) around its operands";
  return success();
}

/// Element e is of thread e mod B; each thread gets the sum of its elements.
Value TileReverse::overThreads(Value tile, Type type) {
  TileType shape = typeOf(tile);
  int64_t count = shape.getNumElements();
  int64_t rows = llvm::divideCeil(count, threads);
  Value flat = reshape(tile, {count});
  if (rows * threads != count) {
    Value none = zeroOf(shaped({rows * threads}, shape.getElementType()));
    flat = TileInsertOp::create(b, loc, none.getType(), flat, none,
                                ValueRange(index(0)), ArrayRef<int64_t>(1));
  }
  Value sums = reduce(reshape(flat, {rows, threads}), 0);
  return TileToThreadsOp::create(b, loc, type, sums);
}

//===----------------------------------------------------------------------===//
// Elementwise
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseMap(TileMapOp map) {
  SmallVector<Value> inputs = recover(map.getInputs()), cotangents;
  SmallVector<unsigned> given;
  for (unsigned i = 0; i < map.getNumResults(); ++i)
    if (Value g = take(i)) {
      cotangents.push_back(g);
      given.push_back(i);
    }
  if (given.empty())
    return success();
  SmallVector<unsigned> wanted;
  SmallVector<Type> types;
  ArrayRef<int64_t> shape = typeOf(map.getResult(0)).getShape();
  for (auto [i, input] : llvm::enumerate(map.getInputs()))
    if (wants(input)) {
      wanted.push_back(i);
      auto tile = dyn_cast<TileType>(input.getType());
      types.push_back(shaped(
          shape, differentialType(tile ? tile.getElementType()
                                       : input.getType())));
    }
  if (wanted.empty())
    return success();
  llvm::append_range(inputs, cotangents);
  auto adjoint = TileMapOp::create(b, loc, types, inputs);
  {
    OpBuilder::InsertionGuard guard(b);
    Block *body = b.createBlock(&adjoint.getBody());
    for (Value input : inputs) {
      auto tile = dyn_cast<TileType>(input.getType());
      body->addArgument(tile ? tile.getElementType() : input.getType(), loc);
    }
    Block &primal = map.getBody().front();
    unsigned count = primal.getNumArguments();
    reverse.setRecovered(primal.getArguments(),
                         body->getArguments().take_front(count));
    SmallVector<Value> results;
    auto captures = reverse.inScope([&]() -> LogicalResult {
      if (failed(reverse.replay(primal)))
        return failure();
      for (auto [g, i] :
           llvm::zip_equal(body->getArguments().drop_front(count), given))
        give(primal.getTerminator()->getOperand(i), g);
      if (failed(reverse.reverse(primal)))
        return failure();
      for (unsigned i : wanted)
        results.push_back(
            reverse.takeCotangentOrZero(primal.getArgument(i)));
      return success();
    });
    if (failed(captures))
      return failure();
    TileYieldOp::create(b, loc, results);
  }
  for (auto [i, result] : llvm::zip_equal(wanted, adjoint.getResults())) {
    Value input = map.getInputs()[i];
    give(input, isa<TileType>(input.getType())
                    ? result
                    : overThreads(result, differentialType(input.getType())));
  }
  return success();
}

//===----------------------------------------------------------------------===//
// Memory
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseLoad(TileLoadOp load) {
  Value g = take();
  if (!g)
    return success();
  Value picked = load.getPicked() ? reverse.recover(load.getPicked()) : Value();
  TileAtomicOp::create(b, loc, g.getType(), TileUpdate::add, g,
                       reverse.gradOf(load.getArray()),
                       recover(load.getOffsets()), picked, load.getAxis(),
                       load.getChecked());
  return success();
}

template <typename Op>
Value TileReverse::loadGradient(Op access, TileType type) {
  Value picked =
      access.getPicked() ? reverse.recover(access.getPicked()) : Value();
  return TileLoadOp::create(b, loc, type, reverse.gradOf(access.getArray()),
                            recover(access.getOffsets()), picked,
                            access.getAxis(), access.getChecked());
}

LogicalResult TileReverse::reverseStore(TileStoreOp store) {
  if (!reverse.getActivity().isActiveArray(store.getArray()) ||
      !differentialType(store.getTile().getType()))
    return success();
  TileType type = cotangentType(store.getTile());
  if (wants(store.getTile()))
    give(store.getTile(), loadGradient(store, type));
  Value picked =
      store.getPicked() ? reverse.recover(store.getPicked()) : Value();
  TileStoreOp::create(b, loc, zeroOf(type), reverse.gradOf(store.getArray()),
                      recover(store.getOffsets()), picked, store.getAxis(),
                      store.getChecked());
  return success();
}

LogicalResult TileReverse::reverseAtomic(TileAtomicOp atomic) {
  if (!reverse.getActivity().isActiveArray(atomic.getArray()) ||
      !wants(atomic.getTile()))
    return success();
  bool subtracts = atomic.getKind() == TileUpdate::sub;
  if (atomic.getKind() != TileUpdate::add && !subtracts)
    return op->emitError("an update other than a sum has no derivative");
  Value g = loadGradient(atomic, cotangentType(atomic.getTile()));
  give(atomic.getTile(), subtracts ? negate(g) : g);
  return success();
}

//===----------------------------------------------------------------------===//
// Parts
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseSet(TileSetOp set) {
  Value g = take();
  if (!g)
    return success();
  Type element = typeOf(g).getElementType();
  SmallVector<Value> at = recover(set.getIndices());
  Value where = set.getWhere() ? reverse.recover(set.getWhere()) : Value();
  bool assigns = set.getKind() == TileUpdate::assign;
  bool subtracts = set.getKind() == TileUpdate::sub;
  if (!assigns && !subtracts && set.getKind() != TileUpdate::add)
    return op->emitError("an update other than a sum has no derivative");
  if (wants(set.getValue())) {
    Value part = TileGetOp::create(b, loc, element, g, at);
    if (where)
      part = apply("where", {where, part, zeroOf(element)});
    give(set.getValue(), subtracts ? apply("neg", part) : part);
  }
  if (assigns)
    g = TileSetOp::create(b, loc, g.getType(), TileUpdate::assign,
                          zeroOf(element), g, at, where);
  give(set.getTile(), g);
  return success();
}

LogicalResult TileReverse::reversePart() {
  Value g = take();
  if (!g)
    return success();
  return llvm::TypeSwitch<Operation *, LogicalResult>(op)
      .Case([&](TileTransposeOp view) {
        SmallVector<int64_t> back(view.getAxes().size());
        for (auto [i, axis] : llvm::enumerate(view.getAxes()))
          back[axis] = i;
        give(view.getTile(),
             TileTransposeOp::create(b, loc, cotangentType(view.getTile()), g,
                                     back));
        return success();
      })
      .Case([&](TileReshapeOp view) {
        give(view.getTile(), reshape(g, typeOf(view.getTile()).getShape()));
        return success();
      })
      .Case([&](TileBroadcastOp view) {
        TileType from = typeOf(view.getTile()), to = typeOf(g);
        SmallVector<int64_t> shape(to.getRank() - from.getRank(), 1);
        llvm::append_range(shape, from.getShape());
        for (int64_t d = to.getRank(); d-- > 0;)
          if (shape[d] == 1 && to.getShape()[d] != 1) {
            SmallVector<int64_t> kept(typeOf(g).getShape());
            kept[d] = 1;
            g = reshape(reduce(g, d), kept);
          }
        give(view.getTile(), reshape(g, from.getShape()));
        return success();
      })
      .Case([&](TileSliceOp view) {
        Value none = zeroOf(cotangentType(view.getTile()));
        give(view.getTile(),
             TileInsertOp::create(b, loc, none.getType(), g, none,
                                  recover(view.getOffsets()), view.getSteps()));
        return success();
      })
      .Case([&](TileInsertOp insert) {
        SmallVector<Value> at = recover(insert.getOffsets());
        TileType part = cotangentType(insert.getPart());
        give(insert.getPart(), TileSliceOp::create(b, loc, part, g, at,
                                                   insert.getSteps()));
        give(insert.getTile(),
             TileInsertOp::create(b, loc, g.getType(), zeroOf(part), g, at,
                                  insert.getSteps()));
        return success();
      })
      .Case([&](TileGetOp get) {
        Value none = zeroOf(cotangentType(get.getTile()));
        give(get.getTile(),
             TileSetOp::create(b, loc, none.getType(), TileUpdate::add, g, none,
                               recover(get.getIndices()), Value()));
        return success();
      })
      .Case([&](TileGatherOp gather) {
        Value none = zeroOf(cotangentType(gather.getTile()));
        give(gather.getTile(),
             TileScatterOp::create(b, loc, none.getType(), g, none,
                                   reverse.recover(gather.getPositions())));
        return success();
      })
      .Case([&](TileScatterOp scatter) {
        give(scatter.getPart(),
             TileGatherOp::create(b, loc, cotangentType(scatter.getPart()), g,
                                  reverse.recover(scatter.getPositions())));
        give(scatter.getTile(), g);
        return success();
      })
      .Case([&](TileSplatOp splat) {
        if (wants(splat.getValue()))
          give(splat.getValue(),
               overThreads(g, differentialType(splat.getValue().getType())));
        return success();
      })
      .Case([&](TileFromThreadsOp from) {
        give(from.getValue(),
             TileToThreadsOp::create(
                 b, loc, differentialType(from.getValue().getType()), g));
        return success();
      })
      .Case([&](TileToThreadsOp to) {
        give(to.getTile(), TileFromThreadsOp::create(
                               b, loc, cotangentType(to.getTile()), g));
        return success();
      })
      .Case([&](TileDiagAddOp add) {
        int64_t n = typeOf(add.getDiagonal()).getShape()[0];
        Value positions = TileIotaOp::create(
            b, loc, shaped({n}, b.getIntegerType(32, true)), index(0),
            index(n + 1));
        give(add.getTile(), g);
        give(add.getDiagonal(),
             TileGatherOp::create(b, loc, cotangentType(add.getDiagonal()), g,
                                  positions));
        return success();
      })
      .Case([&](TileFftOp fft) {
        give(fft.getTile(),
             TileFftOp::create(b, loc, g.getType(), g,
                               fft.getInverse() ? UnitAttr()
                                                : b.getUnitAttr()));
        return success();
      });
}

//===----------------------------------------------------------------------===//
// Reductions
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseReduce(TileReduceOp reduce) {
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
      reverse.recover(tile),
      axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
  Value place = axis ? numbers(shape, *axis)
                     : reshape(iota(typeOf(tile).getNumElements()), shape);
  Value wins = expand(winner, shape, axis);
  give(tile, map({spread, place, wins}, [&](ValueRange x) {
         return apply("where", {apply("eq", {x[1], x[2]}), x[0],
                                zeroOf(x[0].getType())});
       }));
  return success();
}

LogicalResult TileReverse::reverseScan(TileScanOp scan) {
  if (scan.getKind() != TileReduction::add)
    return refuse();
  if (Value g = take())
    give(scan.getTile(),
         TileScanOp::create(b, loc, g.getType(), TileReduction::add, g,
                            scan.getExclusive(), !scan.getReverse()));
  return success();
}

//===----------------------------------------------------------------------===//
// Linear algebra
//===----------------------------------------------------------------------===//

LogicalResult TileReverse::reverseMatmul(TileMatmulOp matmul) {
  Value g = take();
  if (!g)
    return success();
  Value x = reverse.recover(matmul.getA()), y = reverse.recover(matmul.getB());
  bool tx = matmul.getTransposeA(), ty = matmul.getTransposeB();
  auto factor = [&](Value value) -> Value {
    if (!value)
      return {};
    Value known = reverse.recover(value);
    Type type = typeOf(g).getElementType();
    return known.getType() == type ? known
                                   : CastOp::create(b, loc, type, known);
  };
  Value alpha = factor(matmul.getAlpha()), beta = factor(matmul.getBeta());
  auto fit = [&](Value cotangent, Value primal) {
    TileType type = cotangentType(primal);
    if (cotangent.getType() == type)
      return cotangent;
    return map(cotangent, [&](ValueRange e) -> Value {
      return CastOp::create(b, loc, type.getElementType(), e[0]);
    });
  };
  if (wants(matmul.getA()))
    give(matmul.getA(), fit(tx ? multiply(y, g, ty, true, alpha)
                               : multiply(g, y, false, !ty, alpha),
                            matmul.getA()));
  if (wants(matmul.getB()))
    give(matmul.getB(), fit(ty ? multiply(g, x, true, tx, alpha)
                               : multiply(x, g, !tx, false, alpha),
                            matmul.getB()));
  auto inner = [&](Value other, Value scale) {
    Value products = map({g, other}, [&](ValueRange e) {
      return apply("mul", {e[0], CastOp::create(b, loc, e[0].getType(), e[1])
                                     .getResult()});
    });
    return overThreads(products, differentialType(scale.getType()));
  };
  if (matmul.getAlpha() && wants(matmul.getAlpha()))
    give(matmul.getAlpha(), inner(multiply(x, y, tx, ty), matmul.getAlpha()));
  if (!matmul.getC())
    return success();
  if (matmul.getBeta() && wants(matmul.getBeta()))
    give(matmul.getBeta(),
         inner(reverse.recover(matmul.getC()), matmul.getBeta()));
  if (wants(matmul.getC()) && beta)
    g = map({g, beta},
            [&](ValueRange e) { return apply("mul", {e[0], e[1]}); });
  give(matmul.getC(), g);
  return success();
}

/// With L: S = L^-T P L^-1, where P is the lower triangle of L^T g, its
/// diagonal halved; what is read is the lower triangle of a symmetric matrix.
/// Iain Murray, Differentiation of the Cholesky decomposition, 2016.
LogicalResult TileReverse::reverseCholesky(TileCholeskyOp factor) {
  Value g = take();
  if (!g)
    return success();
  bool upper = factor.getUpper();
  Value l = reverse.recover(factor.getResult());
  if (upper) {
    l = transpose(l);
    g = transpose(g);
  }
  ArrayRef<int64_t> shape = typeOf(g).getShape();
  Value i = numbers(shape, 0), j = numbers(shape, 1);
  Type real = typeOf(g).getElementType();
  Value half = constant(b, loc, cast<FloatType>(real), 0.5);
  auto lower = [&](Value tile, bool halved) {
    return map({tile, i, j}, [&](ValueRange x) {
      Value diagonal = halved ? apply("mul", {x[0], half}) : x[0];
      Value isDiagonal = apply("eq", {x[1], x[2]});
      Value chosen = apply("where", {isDiagonal, diagonal, x[0]});
      return apply("where",
                   {apply("ge", {x[1], x[2]}), chosen, zeroOf(real)});
    });
  };
  Value p = lower(multiply(l, g, true, false), true);
  Value left = solve(l, p, false, true);
  Value s = solve(l, transpose(left), false, true);
  Value both = map({s, transpose(s)},
                   [&](ValueRange x) { return apply("add", {x[0], x[1]}); });
  Value result = lower(both, true);
  give(factor.getTile(), upper ? transpose(result) : result);
  return success();
}

LogicalResult TileReverse::reverseSolve(TileSolveOp op) {
  Value g = take();
  if (!g)
    return success();
  bool upper = op.getUpper(), transposed = op.getTransposed();
  Value matrix = reverse.recover(op.getMatrix());
  Value rhs = solve(matrix, g, upper, !transposed);
  give(op.getRhs(), rhs);
  if (!wants(op.getMatrix()))
    return success();
  Value x = reverse.recover(op.getResult());
  TileType type = typeOf(rhs);
  int64_t n = type.getShape()[0];
  int64_t columns = type.getRank() == 2 ? type.getShape()[1] : 1;
  Value bars = reshape(rhs, {n, columns}), xs = reshape(x, {n, columns});
  Value product = transposed ? multiply(xs, bars, false, true)
                             : multiply(bars, xs, false, true);
  ArrayRef<int64_t> shape = typeOf(product).getShape();
  Value i = numbers(shape, 0), j = numbers(shape, 1);
  give(op.getMatrix(), map({product, i, j}, [&](ValueRange e) {
         Value inside = apply(upper ? "le" : "ge", {e[1], e[2]});
         return apply("where", {inside, apply("neg", e[0]),
                                zeroOf(e[0].getType())});
       }));
  return success();
}

LogicalResult TileReverse::run() {
  return llvm::TypeSwitch<Operation *, LogicalResult>(op)
      .Case([&](TileMapOp map) { return reverseMap(map); })
      .Case([&](TileLoadOp load) { return reverseLoad(load); })
      .Case([&](TileStoreOp store) { return reverseStore(store); })
      .Case([&](TileAtomicOp atomic) { return reverseAtomic(atomic); })
      .Case([&](TileSetOp set) { return reverseSet(set); })
      .Case([&](TileReduceOp reduce) { return reverseReduce(reduce); })
      .Case([&](TileScanOp scan) { return reverseScan(scan); })
      .Case([&](TileMatmulOp matmul) { return reverseMatmul(matmul); })
      .Case([&](TileCholeskyOp factor) { return reverseCholesky(factor); })
      .Case([&](TileSolveOp solve) { return reverseSolve(solve); })
      .Case<TileFoldOp>([&](auto) { return refuse(); })
      .Case<TileTransposeOp, TileReshapeOp, TileBroadcastOp, TileSliceOp,
            TileInsertOp, TileGetOp, TileGatherOp, TileScatterOp, TileSplatOp,
            TileFromThreadsOp, TileToThreadsOp, TileDiagAddOp, TileFftOp>(
          [&](auto) { return reversePart(); })
      // Positions and numbers; and nothing.
      .Default([](Operation *) { return success(); });
}

LogicalResult reverseTile(ReverseBuilder &reverse, Operation *op) {
  return TileReverse(reverse, op).run();
}

} // namespace warp::autodiff
