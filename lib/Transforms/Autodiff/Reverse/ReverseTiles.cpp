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
//   Cholesky                an operation of its own, of the triangle that is
//   read solve                   a triangular solve and a product Fourier
//   transform       the other one
//
//===----------------------------------------------------------------------===//

#include "ReverseTiles.h"
#include "Tiles/TileBuffers.h"

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

TileReverse::TileReverse(ReverseBuilder &reverse, Operation *op)
    : reverse(reverse), b(reverse.builder), loc(op->getLoc()), op(op) {
  threads = std::max<int64_t>(
      1, tiles::getBlockThreads(op->getParentOfType<func::FuncOp>()));
}

LogicalResult TileReverse::refuse() {
  if (!take())
    return success();
  return op->emitError("'")
         << op->getName().stripDialect()
         << "' has no derivative here; write a custom derivative, or "
            "stop_gradient(...) around its operands";
}

//===----------------------------------------------------------------------===//
// Shapes
//===----------------------------------------------------------------------===//

Value TileReverse::index(int64_t value) {
  return ConstantOp::create(
      b, loc, b.getIntegerAttr(b.getIntegerType(32, true), value));
}

Value TileReverse::reshape(Value tile, Shape shape) {
  TileType type = shaped(shape, typeOf(tile).getElementType());
  if (type == tile.getType())
    return tile;
  return TileReshapeOp::create(b, loc, type, tile);
}

Value TileReverse::broadcast(Value tile, Shape shape) {
  TileType type = shaped(shape, typeOf(tile).getElementType());
  if (type == tile.getType())
    return tile;
  return TileBroadcastOp::create(b, loc, type, tile);
}

Value TileReverse::transpose(Value tile) {
  TileType type = typeOf(tile);
  return TileTransposeOp::create(
      b, loc,
      shaped({type.getShape()[1], type.getShape()[0]}, type.getElementType()),
      tile, ArrayRef<int64_t>{1, 0});
}

Value TileReverse::reduce(Value tile, std::optional<int64_t> axis) {
  TileType type = typeOf(tile);
  // All threads take part in the sum of all elements.
  if (type.getRank() == 1)
    axis.reset();
  return TileReduceOp::create(
      b, loc, getReducedType(type, axis, type.getElementType()),
      TileReduction::add, tile,
      axis ? b.getI64IntegerAttr(*axis) : IntegerAttr());
}

Value TileReverse::expand(Value tile, Shape shape,
                          std::optional<int64_t> axis) {
  SmallVector<int64_t> kept(shape);
  for (auto [d, extent] : llvm::enumerate(kept))
    if (!axis || int64_t(d) == *axis)
      extent = 1;
  return broadcast(reshape(tile, kept), shape);
}

Value TileReverse::iota(int64_t count, int64_t step) {
  return TileIotaOp::create(b, loc, shaped({count}, b.getIntegerType(32, true)),
                            index(0), index(step));
}

Value TileReverse::numbers(Shape shape, int64_t axis) {
  SmallVector<int64_t> flat(shape.size(), 1);
  flat[axis] = shape[axis];
  return broadcast(reshape(iota(shape[axis]), flat), shape);
}

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

/// Leaves out what a function of elements computes or gets for nothing, so that
/// loops need not keep it.
static void dropUnused(TileMapOp map, unsigned keptOperand) {
  Block &body = map.getBody().front();
  for (Operation &op : llvm::make_early_inc_range(llvm::reverse(body)))
    if (isOpTriviallyDead(&op))
      op.erase();
  for (unsigned i = map.getNumOperands(); i-- > 0;)
    if (i != keptOperand && body.getArgument(i).use_empty()) {
      body.eraseArgument(i);
      map->eraseOperand(i);
    }
}

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
          shape,
          differentialType(tile ? tile.getElementType() : input.getType())));
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
        results.push_back(reverse.takeCotangentOrZero(primal.getArgument(i)));
      return success();
    });
    if (failed(captures))
      return failure();
    TileYieldOp::create(b, loc, results);
  }
  // The cotangents have the shape of the results.
  dropUnused(adjoint, map.getNumOperands());
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
  TileAtomicOp::create(
      b, loc, g.getType(), TileUpdate::add, g, reverse.gradOf(load.getArray()),
      recover(load.getOffsets()), recoverOptional(load.getPicked()),
      load.getAxis(), load.getChecked());
  return success();
}

template <typename Op>
Value TileReverse::loadGradient(Op access, TileType type) {
  return TileLoadOp::create(b, loc, type, reverse.gradOf(access.getArray()),
                            recover(access.getOffsets()),
                            recoverOptional(access.getPicked()),
                            access.getAxis(), access.getChecked());
}

LogicalResult TileReverse::reverseStore(TileStoreOp store) {
  if (!reverse.getActivity().isActiveArray(store.getArray()) ||
      !differentialType(store.getTile().getType()))
    return success();
  TileType type = cotangentType(store.getTile());
  if (wants(store.getTile()))
    give(store.getTile(), loadGradient(store, type));
  TileStoreOp::create(b, loc, zeroOf(type), reverse.gradOf(store.getArray()),
                      recover(store.getOffsets()),
                      recoverOptional(store.getPicked()), store.getAxis(),
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
  if (subtracts)
    g = map(g, [&](ValueRange x) { return apply("neg", x); });
  give(atomic.getTile(), g);
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
      .Case<TileFoldOp, TileCholeskyAdjointOp>([&](auto) { return refuse(); })
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
