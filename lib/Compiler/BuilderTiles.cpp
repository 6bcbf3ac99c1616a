//===- BuilderTiles.cpp - Operations on tiles -----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Operands are those of the operations in WarpTileOps.td, in order. The front
// end says which shapes and types do not fit, in the words of its language;
// what it misses, verifiers report.
//
//===----------------------------------------------------------------------===//

#include "BuilderImpl.h"

#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"
#include "warp/TileBuilder.h"

#include "mlir/IR/Verifier.h"
#include "llvm/ADT/StringSwitch.h"

using namespace mlir;

warp::TileBuilder::TileBuilder(Builder &builder) : impl(*builder.impl) {}

void warp::TileBuilder::markStays(bool isElse) {
  ContextLock lock;
  auto &ifs = impl.function().ifs;
  if (ifs.empty())
    impl.fail(Error::Kind::Value, "no branch is open");
  ifs.back()->setAttr(attr::stays,
                      impl.builder.getStringAttr(isElse ? "else" : "then"));
}

void warp::TileBuilder::setBlockThreads(int64_t threads, bool ragged) {
  ContextLock lock;
  Operation *outermost = impl.functions.front().op;
  outermost->setAttr(attr::blockThreads,
                     impl.builder.getI64IntegerAttr(threads));
  if (ragged)
    outermost->setAttr(attr::ragged, impl.builder.getUnitAttr());
}

namespace {

/// Makes one operation; a method per group of them.
class TileOpMaker {
public:
  TileOpMaker(warp::Builder::Impl &impl, ValueRange operands,
              const warp::TileOptions &options)
      : impl(impl), b(impl.builder), loc(impl.loc), operands(operands),
        options(options) {}

  /// Null if there is no such operation.
  Operation *make(StringRef name) {
    Operation *op = makeBare(name);
    if (!op)
      return nullptr;
    for (const std::string &flag : options.flags) {
      if (!llvm::is_contained(op->getName().getAttributeNames(), flag))
        impl.fail(warp::Error::Kind::Value,
                  "'tile_" + name.str() + "' has no flag '" + flag + "'");
      op->setAttr(flag, b.getUnitAttr());
    }
    return op;
  }

private:
  /// Without flags.
  Operation *makeBare(StringRef name) {
    if (Operation *op = makeValue(name))
      return op;
    if (Operation *op = makeMemory(name))
      return op;
    if (Operation *op = makePart(name))
      return op;
    if (Operation *op = makeReduction(name))
      return op;
    return makeAlgebra(name);
  }
  warp::TileType shaped(mlir::Type element = {}) {
    mlir::Type type = element ? element : warp::unwrap(options.element);
    auto checked = warp::TileType::getChecked(
        [&] { return mlir::emitError(loc); }, b.getContext(),
        ArrayRef<int64_t>(options.shape), type);
    if (!checked)
      impl.failType("impossible tile");
    return checked;
  }
  warp::TileType typeOf(unsigned operand) {
    auto type = dyn_cast<warp::TileType>(operands[operand].getType());
    if (!type)
      impl.failType("expects a tile, but got " +
                    warp::quoted(operands[operand].getType()));
    return type;
  }
  IntegerAttr axis() {
    return options.axis ? b.getI64IntegerAttr(*options.axis) : IntegerAttr();
  }
  warp::TileReduction reduction() {
    return *warp::symbolizeTileReduction(options.kind);
  }

  Operation *makeValue(StringRef name) {
    if (name == "splat")
      return warp::TileSplatOp::create(b, loc, shaped(), operands[0]);
    if (name == "iota")
      return warp::TileIotaOp::create(b, loc, shaped(), operands[0],
                                      operands[1]);
    if (name == "from_threads")
      return warp::TileFromThreadsOp::create(b, loc, shaped(), operands[0]);
    if (name == "to_threads")
      return warp::TileToThreadsOp::create(
          b, loc, warp::unwrap(options.element), operands[0]);
    return nullptr;
  }

  Operation *makeMemory(StringRef name) {
    auto dimensions = [&](unsigned array) -> unsigned {
      return cast<warp::ArrayType>(operands[array].getType()).getRank();
    };
    auto pickedAt = [&](unsigned first) {
      return options.picked ? operands[first] : Value();
    };
    int64_t along = options.axis.value_or(0);
    if (name == "load") {
      unsigned rank = dimensions(0);
      auto array = cast<warp::ArrayType>(operands[0].getType());
      return warp::TileLoadOp::create(
          b, loc, shaped(array.getElementType()), operands[0],
          operands.slice(1, rank), pickedAt(1 + rank), along, options.checked);
    }
    bool isStore = name == "store";
    if (!isStore && name != "atomic")
      return nullptr;
    unsigned rank = dimensions(1);
    ValueRange offsets = operands.slice(2, rank);
    if (isStore)
      return warp::TileStoreOp::create(b, loc, operands[0], operands[1],
                                       offsets, pickedAt(2 + rank), along,
                                       options.checked);
    return warp::TileAtomicOp::create(
        b, loc, operands[0].getType(), *warp::symbolizeTileUpdate(options.kind),
        operands[0], operands[1], offsets, pickedAt(2 + rank), along,
        options.checked);
  }

  Operation *makePart(StringRef name) {
    ArrayRef<int64_t> axes = options.axes;
    if (name == "transpose")
      return warp::TileTransposeOp::create(
          b, loc, shaped(typeOf(0).getElementType()), operands[0], axes);
    if (name == "reshape")
      return warp::TileReshapeOp::create(
          b, loc, shaped(typeOf(0).getElementType()), operands[0]);
    if (name == "broadcast")
      return warp::TileBroadcastOp::create(
          b, loc, shaped(typeOf(0).getElementType()), operands[0]);
    if (name == "slice")
      return warp::TileSliceOp::create(
          b, loc, shaped(typeOf(0).getElementType()), operands[0],
          operands.drop_front(), axes);
    if (name == "insert")
      return warp::TileInsertOp::create(b, loc, typeOf(1), operands[0],
                                        operands[1], operands.drop_front(2),
                                        axes);
    if (name == "get")
      return warp::TileGetOp::create(b, loc, typeOf(0).getElementType(),
                                     operands[0], operands.drop_front());
    if (name == "set") {
      // The condition comes last.
      ValueRange indices = operands.drop_front(2);
      Value where = options.where ? indices.back() : Value();
      if (options.where)
        indices = indices.drop_back();
      size_t rank = std::min<size_t>(typeOf(1).getRank(), indices.size());
      return warp::TileSetOp::create(
          b, loc, typeOf(1), *warp::symbolizeTileUpdate(options.kind),
          operands[0], operands[1], indices.take_front(rank),
          indices.drop_front(rank), where, path());
    }
    return nullptr;
  }

  ArrayAttr path() {
    SmallVector<Attribute> steps;
    for (const std::string &step : options.path)
      steps.push_back(step == "1" || step == "2"
                          ? Attribute(b.getI64IntegerAttr(step[0] - '0'))
                          : Attribute(b.getStringAttr(step)));
    return steps.empty() ? ArrayAttr() : b.getArrayAttr(steps);
  }

  Operation *makeReduction(StringRef name) {
    mlir::Type index = b.getIntegerType(32, /*isSigned=*/true);
    if (name == "reduce")
      return warp::TileReduceOp::create(
          b, loc,
          warp::getReducedType(typeOf(0), options.axis,
                               typeOf(0).getElementType()),
          reduction(), operands[0], axis());
    if (name == "arg_reduce")
      return warp::TileArgReduceOp::create(
          b, loc, warp::getReducedType(typeOf(0), options.axis, index),
          reduction(), operands[0], axis());
    if (name == "scan")
      return warp::TileScanOp::create(b, loc, typeOf(0), reduction(),
                                      operands[0], /*exclusive=*/false,
                                      /*reverse=*/false);
    if (name == "sort")
      return warp::TileSortOp::create(
          b, loc,
          warp::TileType::get(b.getContext(), typeOf(0).getShape(), index),
          operands[0]);
    if (name == "gather")
      return warp::TileGatherOp::create(
          b, loc,
          warp::TileType::get(b.getContext(), typeOf(1).getShape(),
                              typeOf(0).getElementType()),
          operands[0], operands[1]);
    if (name == "scatter")
      return warp::TileScatterOp::create(b, loc, typeOf(1), operands[0],
                                         operands[1], operands[2]);
    return nullptr;
  }

  /// Operands are a, b, alpha, then c and beta if there is one.
  Operation *makeMatmul() {
    Value alpha = operands.size() > 2 ? operands[2] : Value();
    Value c = operands.size() > 3 ? operands[3] : Value();
    Value beta = operands.size() > 4 ? operands[4] : Value();
    return warp::TileMatmulOp::create(b, loc, shaped(), operands[0],
                                      operands[1], c, alpha, beta, UnitAttr(),
                                      UnitAttr());
  }

  Operation *makeAlgebra(StringRef name) {
    if (name == "matmul")
      return makeMatmul();
    if (name == "cholesky")
      return warp::TileCholeskyOp::create(b, loc, typeOf(0), operands[0],
                                          UnitAttr());
    if (name == "solve")
      return warp::TileSolveOp::create(b, loc, typeOf(1), operands[0],
                                       operands[1], UnitAttr(), UnitAttr());
    if (name == "diag_add")
      return warp::TileDiagAddOp::create(b, loc, typeOf(0), operands[0],
                                         operands[1]);
    if (name == "fft")
      return warp::TileFftOp::create(b, loc, typeOf(0), operands[0],
                                     UnitAttr());
    return nullptr;
  }

  warp::Builder::Impl &impl;
  OpBuilder &b;
  Location loc;
  ValueRange operands;
  const warp::TileOptions &options;
};

} // namespace

warp::TileBuilder::Values warp::TileBuilder::make(const std::string &name,
                                                  const Values &operands,
                                                  const TileOptions &options) {
  ContextLock lock;
  Diagnostics diagnostics;
  SmallVector<mlir::Value, 4> values = unwrap(operands);
  Operation *op = TileOpMaker(impl, values, options).make(name);
  if (!op)
    impl.fail(Error::Kind::Value, "no operation 'tile_" + name + "'");
  if (failed(verify(op))) {
    op->erase();
    throw diagnostics.toError(Error::Kind::Type, "tiles do not fit");
  }
  return wrap(op->getResults());
}

warp::TileBuilder::Values
warp::TileBuilder::beginFunction(const Values &operands, bool fold) {
  ContextLock lock;
  OpBuilder &b = impl.builder;
  SmallVector<mlir::Value, 4> values = unwrap(operands);
  Operation *op;
  if (fold)
    op = TileFoldOp::create(b, impl.loc, values[0].getType(), values[0],
                            IntegerAttr(), UnitAttr());
  else
    op = TileMapOp::create(b, impl.loc, TypeRange(), values);
  Block *body = b.createBlock(&op->getRegion(0));
  for (mlir::Value value : values) {
    mlir::Type type = value.getType();
    if (auto tile = dyn_cast<TileType>(type))
      type = tile.getElementType();
    for (int i = 0; i < (fold ? 2 : 1); ++i)
      body->addArgument(type, impl.loc);
  }
  return wrap(ValueRange(body->getArguments()));
}

warp::TileBuilder::Values
warp::TileBuilder::endFunction(const Values &elements,
                               const TileOptions &options) {
  ContextLock lock;
  OpBuilder &b = impl.builder;
  SmallVector<mlir::Value, 4> values = unwrap(elements);
  TileYieldOp::create(b, impl.loc, values);
  Operation *open = b.getInsertionBlock()->getParentOp();
  b.setInsertionPoint(open);
  Operation *closed;
  if (auto fold = dyn_cast<TileFoldOp>(open)) {
    auto tile = cast<TileType>(fold.getTile().getType());
    IntegerAttr axis =
        options.axis ? b.getI64IntegerAttr(*options.axis) : IntegerAttr();
    bool partials = llvm::is_contained(options.flags, "partials");
    TileType type =
        partials ? tile
                 : getReducedType(tile, options.axis, tile.getElementType());
    closed = TileFoldOp::create(b, open->getLoc(), type, fold.getTile(), axis,
                                partials ? b.getUnitAttr() : UnitAttr());
  } else {
    SmallVector<mlir::Type> types;
    for (mlir::Value input : open->getOperands())
      if (auto tile = dyn_cast<TileType>(input.getType())) {
        for (mlir::Value value : values)
          types.push_back(
              TileType::get(b.getContext(), tile.getShape(), value.getType()));
        break;
      }
    closed = TileMapOp::create(b, open->getLoc(), types, open->getOperands());
  }
  closed->getRegion(0).takeBody(open->getRegion(0));
  open->erase();
  b.setInsertionPointAfter(closed);
  Diagnostics diagnostics;
  if (failed(verify(closed)))
    throw diagnostics.toError(Error::Kind::Type, "tiles do not fit");
  return wrap(closed->getResults());
}

void warp::TileBuilder::addBarrier() {
  ContextLock lock;
  BarrierOp::create(impl.builder, impl.loc);
}
