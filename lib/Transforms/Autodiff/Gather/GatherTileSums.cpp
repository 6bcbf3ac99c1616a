//===- GatherTileSums.cpp - Sums of products over blocks without atomics --===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A block of a matrix product has a tile of the result and goes through the
// depth. In the adjoint it adds to a tile of each factor's gradient on its way,
// as do all blocks of a row, or a column, of the result. Here they change
// places, in a kernel of its own that runs before what is left of the adjoint:
//
//   block (i, j):                           block (i, j):
//     g = dc[i, j];  dc[i, j] = 0             for k = j, j + J, ... of K:
//     for k of K:                    ==>        s = 0
//       da[i, k] += g b[k, j]^T                 for l of J: s += dc[i, l] b[k,
//       l]^T
//                                               da[i, k] += s
//
// so that a sum stays with a block until it is complete. Where there are more
// blocks than steps of the depth, P = J / K of them share a sum: block j has
// step k = j % K and adds every P-th product from j / K on. Where they do not,
// and each step has its own tile, the addition is marked as one that needs not
// be atomic.
//
//===----------------------------------------------------------------------===//

#include "GatherTileSums.h"

#include "FindTileSums.h"

#include "Tiles/DisjointUpdates.h"
#include "Tiles/TileBuffers.h"

#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;
using namespace warp;
using warp::autodiff::TileSum;

namespace {

class TileGatherer {
public:
  explicit TileGatherer(func::FuncOp adjoint)
      : adjoint(adjoint), b(adjoint.getContext()), loc(adjoint.getLoc()) {}

  void build(ArrayRef<TileSum> sums) {
    createFunction();
    for (const TileSum &sum : sums)
      add(sum);
  }

private:
  /// Like that of other sums, see GatherBuilder.cpp.
  void createFunction() {
    TidOp of = *adjoint.getOps<TidOp>().begin();
    unsigned rank = of.getNumResults() + 1;
    SmallVector<Type> types(adjoint.getArgumentTypes());
    types.append(rank,
                 IntegerType::get(b.getContext(), 32, IntegerType::Signed));
    b.setInsertionPoint(adjoint);
    auto function =
        func::FuncOp::create(b, loc, (adjoint.getName() + "_sums").str(),
                             b.getFunctionType(types, {}));
    if (auto known = adjoint->getAttrOfType<ArrayAttr>(attr::argNames)) {
      SmallVector<Attribute> names(known.begin(), known.end());
      for (unsigned i = 0; i < rank; ++i)
        names.push_back(b.getStringAttr("launch." + Twine(i)));
      function->setAttr(attr::argNames, b.getArrayAttr(names));
    }
    function->setAttr(attr::halo,
                      b.getDenseI64ArrayAttr(SmallVector<int64_t>(rank, 0)));
    for (StringRef kept :
         {StringRef(attr::primal), StringRef(attr::blockThreads)})
      if (Attribute value = adjoint->getAttr(kept))
        function->setAttr(kept, value);
    Block *body = function.addEntryBlock();
    b.setInsertionPointToStart(body);
    tid = TidOp::create(b, loc, of.getResultTypes());
    extents = body->getArguments().take_back(rank);
    map.map(adjoint.getArguments(), body->getArguments().drop_back(rank));
    map.map(of.getResults(), tid.getResults());
    auto end = func::ReturnOp::create(b, loc);
    b.setInsertionPoint(end);
  }

  Value number(int64_t value) {
    return arith::ConstantOp::create(b, loc, b.getI32IntegerAttr(value));
  }
  Value toIndex(Value value) {
    return CastOp::create(b, loc, b.getI32Type(), value);
  }

  /// A value for the blocks and the step of the loop that `map` knows.
  Value clone(Value value, IRMapping &map) {
    if (map.contains(value))
      return map.lookup(value);
    Operation *def = value.getDefiningOp();
    for (Value operand : def->getOperands())
      clone(operand, map);
    b.clone(*def, map);
    return map.lookup(value);
  }

  scf::ForOp loop(Value begin, Value end, Value step, ValueRange carried) {
    auto made = scf::ForOp::create(b, loc, begin, end, step, carried);
    b.setInsertionPointToStart(made.getBody());
    return made;
  }

  void add(TileSum sum) {
    OpBuilder::InsertionGuard guard(b);
    loc = sum.update.getLoc();
    IRMapping outer = map;
    Value begin = clone(sum.loop.getLowerBound(), outer),
          end = clone(sum.loop.getUpperBound(), outer),
          step = clone(sum.loop.getStep(), outer);
    // Blocks along the dimension, steps of the loop, and who shares a sum.
    Value blocks = toIndex(extents[sum.dim]), one = number(1);
    Value length = arith::SubIOp::create(b, loc, end, begin);
    Value isSome = arith::CmpIOp::create(b, loc,
                                         sum.loop.getUnsignedCmp()
                                             ? arith::CmpIPredicate::ugt
                                             : arith::CmpIPredicate::sgt,
                                         end, begin);
    Value rest = arith::SubIOp::create(b, loc, length, one);
    Value steps = arith::DivUIOp::create(b, loc, rest, step);
    steps = arith::AddIOp::create(b, loc, steps, one);
    steps = arith::SelectOp::create(b, loc, isSome, steps, number(0));
    Value divisor = arith::MaxUIOp::create(b, loc, steps, one);
    Value parts = arith::DivUIOp::create(b, loc, blocks, divisor);
    parts = arith::MaxUIOp::create(b, loc, parts, one);
    Value items = arith::MulIOp::create(b, loc, steps, parts);
    scf::ForOp items_ =
        loop(toIndex(tid.getResult(sum.dim)), items, blocks, {});
    Value item = items_.getInductionVar();
    Value turn = arith::RemUIOp::create(b, loc, item, divisor);
    Value part = arith::DivUIOp::create(b, loc, item, divisor);
    Value distance = arith::MulIOp::create(b, loc, turn, step);
    outer.map(sum.loop.getInductionVar(),
              arith::AddIOp::create(b, loc, begin, distance).getResult());
    TileType type = tiles::tileType(sum.product.getResult());
    Value zero =
        ConstantOp::create(b, loc, b.getFloatAttr(type.getElementType(), 0));
    Value none = TileSplatOp::create(b, loc, type, zero);
    scf::ForOp products = loop(part, blocks, parts, none);
    IRMapping inner = outer;
    inner.map(adjointTid().getResult(sum.dim),
              CastOp::create(b, loc, tid.getResult(sum.dim).getType(),
                             products.getInductionVar())
                  .getResult());
    auto factor = [&](Value given) {
      return given ? clone(given, inner) : Value();
    };
    Value made = TileMatmulOp::create(
        b, loc, type, factor(sum.product.getA()), factor(sum.product.getB()),
        products.getRegionIterArgs()[0], factor(sum.product.getAlpha()),
        Value(), sum.product.getTransposeAAttr(),
        sum.product.getTransposeBAttr());
    scf::YieldOp::create(b, loc, made);
    b.setInsertionPointAfter(products);
    outer.map(sum.product.getResult(), products.getResult(0));
    Value tile = clone(sum.update.getTile(), outer);
    SmallVector<Value> offsets;
    for (Value offset : sum.update.getOffsets())
      offsets.push_back(clone(offset, outer));
    Value array = clone(sum.update.getArray(), outer);
    auto update = [&] {
      return TileAtomicOp::create(b, loc, tile.getType(), TileUpdate::add, tile,
                                  array, offsets, Value(), sum.update.getAxis(),
                                  sum.update.getChecked());
    };
    if (!sum.isApart) {
      update();
      return;
    }
    Value isWhole =
        arith::CmpIOp::create(b, loc, arith::CmpIPredicate::eq, parts, one);
    auto branch = scf::IfOp::create(b, loc, isWhole, /*withElseRegion=*/true);
    b.setInsertionPointToStart(branch.thenBlock());
    update()->setAttr(attr::disjoint, b.getUnitAttr());
    b.setInsertionPointToStart(branch.elseBlock());
    update();
  }

  TidOp adjointTid() { return *adjoint.getOps<TidOp>().begin(); }

  func::FuncOp adjoint;
  OpBuilder b;
  Location loc;
  TidOp tid;
  ValueRange extents;
  IRMapping map;
};

} // namespace

bool warp::autodiff::gatherTileSums(func::FuncOp adjoint) {
  SmallVector<TileSum> sums = findTileSums(adjoint);
  if (sums.empty())
    return false;
  TileGatherer(adjoint).build(sums);
  for (TileSum &sum : sums)
    sum.update.erase();
  return true;
}
