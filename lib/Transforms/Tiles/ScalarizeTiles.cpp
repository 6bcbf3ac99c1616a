//===- ScalarizeTiles.cpp - Scalar replacement of 1-element tiles ---------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// On a CPU a block has one thread unless the user asks for more, and what its
// threads hold together is what that one holds. A kernel all of whose tiles
// have one element is a kernel without tiles: its threads can be lanes, and its
// sums are made as those of any other.
//
//   t = tile(x)                       if (0 < n)
//   tile_atomic_add(a, tile_sum(t))     atomic_add(a, 0, x)
//
//===----------------------------------------------------------------------===//

#include "KernelFunction.h"
#include "LowerTiles.h"
#include "TileBuffers.h"

#include "WarpDialect/Registry.h"
#include "WarpDialect/TileOps.h"
#include "WarpDialect/TilePasses.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

#include "llvm/ADT/TypeSwitch.h"

namespace warp {
#define GEN_PASS_DEF_SCALARIZETILES
#include "WarpDialect/TilePasses.h.inc"
} // namespace warp

using namespace mlir;
using namespace warp;
using namespace warp::tiles;

static Type elementOf(Value tile) { return tileType(tile).getElementType(); }

static bool hasOneElement(Value value) {
  auto type = dyn_cast<TileType>(value.getType());
  return !type || type.getNumElements() == 1;
}

static bool hasTiles(Operation *op) {
  return llvm::any_of(op->getOperands(), isTile) ||
         llvm::any_of(op->getResults(), isTile);
}

/// True if there is a form without tiles.
static bool isSupported(Operation *op) {
  if (!hasTiles(op))
    return true;
  if (!llvm::all_of(op->getOperands(), hasOneElement) ||
      !llvm::all_of(op->getResults(), hasOneElement))
    return false;
  return llvm::TypeSwitch<Operation *, bool>(op)
      .Case([](TileFromThreadsOp op) {
        return op.getValue().getType() == elementOf(op.getResult());
      })
      .Case([](TileToThreadsOp op) {
        return op.getResult().getType() == elementOf(op.getTile());
      })
      .Case<TileLoadOp, TileStoreOp>([](auto op) { return !op.getPicked(); })
      .Case([](TileAtomicOp op) {
        return !op.getPicked() && !isa<StructType>(elementOf(op.getTile()));
      })
      .Case([](TileScanOp op) { return !op.getExclusive(); })
      .Case<TileSplatOp, TileMapOp, TileReduceOp, TileGetOp, TileTransposeOp,
            TileReshapeOp, TileBroadcastOp, TileSliceOp>(
          [](Operation *) { return true; })
      .Default(false);
}

namespace {

/// Values in the place of tiles, in program order.
class Scalars {
public:
  explicit Scalars(MLIRContext *context) : b(context) {}
  void replace(Operation *op);

private:
  Value of(Value value) const {
    return isTile(value) ? scalars.lookup(value) : value;
  }
  void replaceMap(TileMapOp op);
  /// True if the only element of the tile is within the array; null if that is
  /// promised.
  template <typename Op> Value isInside(Op op);
  /// The value of `make` there, and elsewhere zero.
  Value ifInside(Value inside, Type type, function_ref<Value()> make);

  OpBuilder b;
  llvm::DenseMap<Value, Value> scalars;
};

} // namespace

template <typename Op> Value Scalars::isInside(Op op) {
  Value inside;
  if (!op.getChecked())
    return inside;
  Location loc = op.getLoc();
  for (auto [d, offset] : llvm::enumerate(op.getOffsets())) {
    Value extent = DimOp::create(b, loc, b.getIntegerType(32, true),
                                 op.getArray(), b.getI64IntegerAttr(d));
    // As unsigned numbers, negative ones are too large.
    bool isWide = offset.getType().getIntOrFloatBitWidth() > 32;
    Type type = b.getIntegerType(isWide ? 64 : 32);
    Value holds = arith::CmpIOp::create(b, loc, arith::CmpIPredicate::ult,
                                        CastOp::create(b, loc, type, offset),
                                        CastOp::create(b, loc, type, extent));
    inside = inside ? arith::AndIOp::create(b, loc, inside, holds) : holds;
  }
  return inside;
}

Value Scalars::ifInside(Value inside, Type type, function_ref<Value()> make) {
  if (!inside)
    return make();
  Location loc = inside.getLoc();
  SmallVector<Type, 1> types;
  if (type)
    types.push_back(type);
  auto branch = scf::IfOp::create(b, loc, types, inside,
                                  /*withElseRegion=*/type != nullptr);
  OpBuilder::InsertionGuard guard(b);
  b.setInsertionPointToStart(branch.thenBlock());
  Value made = make();
  if (!type)
    return {};
  scf::YieldOp::create(b, loc, made);
  b.setInsertionPointToStart(branch.elseBlock());
  scf::YieldOp::create(b, loc, makeZero(b, loc, type));
  return branch.getResult(0);
}

void Scalars::replaceMap(TileMapOp op) {
  IRMapping mapping;
  Block &body = op.getBody().front();
  for (auto [argument, input] :
       llvm::zip_equal(body.getArguments(), op.getInputs()))
    mapping.map(argument, of(input));
  for (Operation &inner : body.without_terminator())
    b.clone(inner, mapping);
  for (auto [tile, value] :
       llvm::zip_equal(op.getResults(), body.getTerminator()->getOperands()))
    scalars[tile] = mapping.lookupOrDefault(value);
}

void Scalars::replace(Operation *op) {
  b.setInsertionPoint(op);
  Location loc = op->getLoc();
  llvm::TypeSwitch<Operation *>(op)
      .Case<TileFromThreadsOp, TileSplatOp>(
          [&](auto op) { scalars[op.getResult()] = op.getValue(); })
      .Case<TileToThreadsOp, TileGetOp>(
          [&](auto op) { op.getResult().replaceAllUsesWith(of(op.getTile())); })
      .Case([&](TileMapOp op) { replaceMap(op); })
      .Case([&](TileLoadOp op) {
        Type type = elementOf(op.getResult());
        scalars[op.getResult()] = ifInside(isInside(op), type, [&]() -> Value {
          return LoadOp::create(b, loc, type, op.getArray(), op.getOffsets());
        });
      })
      .Case([&](TileStoreOp op) {
        ifInside(isInside(op), {}, [&]() -> Value {
          StoreOp::create(b, loc, of(op.getTile()), op.getArray(),
                          op.getOffsets());
          return {};
        });
      })
      .Case([&](TileAtomicOp op) {
        Type type = elementOf(op.getTile());
        bool isUsed = !op.getOld().use_empty();
        scalars[op.getOld()] =
            ifInside(isInside(op), isUsed ? type : Type(), [&]() -> Value {
              return AtomicOp::create(b, loc, type, toAtomic(op.getKind()),
                                      of(op.getTile()), op.getArray(),
                                      op.getOffsets());
            });
      })
      .Default([&](Operation *op) {
        // Views, and reductions of one element.
        scalars[op->getResult(0)] = of(op->getOperand(0));
      });
}

namespace {

struct ScalarizeTiles : warp::impl::ScalarizeTilesBase<ScalarizeTiles> {
  void runOnOperation() override {
    FunctionOpInterface kernel = findKernel(getOperation());
    auto threads =
        kernel ? kernel->getAttrOfType<IntegerAttr>(warp::attr::blockThreads)
               : IntegerAttr();
    if (!threads || threads.getInt() != 1 || getTarget(kernel).isSimt() ||
        getVariant(kernel).getDebug())
      return;
    SmallVector<Operation *> ops;
    WalkResult result = kernel->walk([&](Operation *op) {
      if (!isSupported(op))
        return WalkResult::interrupt();
      if (hasTiles(op) || isa<BarrierOp>(op))
        ops.push_back(op);
      return WalkResult::advance();
    });
    if (result.wasInterrupted() || ops.empty())
      return;
    // Tiles come before their users, in regions, too.
    Scalars scalars(&getContext());
    for (Operation *op : ops)
      if (!isa<BarrierOp>(op))
        scalars.replace(op);
    for (Operation *op : llvm::reverse(ops))
      op->erase();
    kernel->removeAttr(warp::attr::blockThreads);
    kernel->removeAttr(warp::attr::ragged);
  }
};

} // namespace
