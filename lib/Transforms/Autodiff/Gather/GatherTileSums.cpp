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
// step k = j % K and adds every P-th product from j / K on.
//
//===----------------------------------------------------------------------===//

#include "GatherTileSums.h"

#include "Analysis/Forms.h"
#include "Autodiff/DeadValues.h"
#include "Tiles/OwnWindows.h"

#include "WarpDialect/Passes.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/IRMapping.h"

using namespace mlir;
using namespace warp;

namespace {

/// An addition to gradients, in a loop, of a product that was converted if
/// there is a map, by all blocks along a dimension of the launch.
struct TileSum {
  TileAtomicOp update;
  TileMapOp conversion;
  TileMatmulOp product;
  scf::ForOp loop;
  unsigned dim;
};

/// The argument behind an array, and whether its gradients are meant.
struct Root {
  Value base;
  bool isGradient = false;
  SmallVector<Value> leading;

  explicit Root(Value array) : base(array) {
    while (Operation *def = base.getDefiningOp()) {
      if (auto view = dyn_cast<ViewOp>(def))
        leading.insert(leading.begin(), view.getIndices().begin(),
                       view.getIndices().end());
      else if (isa<GradOp>(def))
        isGradient = true;
      else
        break;
      base = def->getOperand(0);
    }
  }
  bool is(const Root &other) const {
    return base == other.base && isGradient == other.isGradient;
  }
};

class Finder {
public:
  explicit Finder(func::FuncOp adjoint) : adjoint(adjoint) {
    adjoint.walk([&](TidOp op) { tids.push_back(op); });
  }

  SmallVector<TileSum> find() {
    SmallVector<TileSum> sums;
    if (tids.size() != 1)
      return sums;
    for (auto loop : adjoint.getBody().front().getOps<scf::ForOp>())
      for (auto update : loop.getBody()->getOps<TileAtomicOp>())
        if (std::optional<TileSum> sum = match(update, loop))
          sums.push_back(*sum);
    return sums;
  }

private:
  std::optional<TileSum> match(TileAtomicOp update, scf::ForOp loop) {
    if (update.getKind() != TileUpdate::add || update.getPicked() ||
        !update.getOld().use_empty() || !isOnlyAddedTo(update.getArray()))
      return std::nullopt;
    TileSum sum{update, {}, {}, loop, 0};
    Operation *def = update.getTile().getDefiningOp();
    if (auto map = dyn_cast_or_null<TileMapOp>(def);
        map && map.getInputs().size() == 1 && isConversion(map)) {
      sum.conversion = map;
      def = map.getInputs()[0].getDefiningOp();
    }
    sum.product = dyn_cast_or_null<TileMatmulOp>(def);
    if (!sum.product || sum.product.getC() ||
        sum.product->getBlock() != loop.getBody())
      return std::nullopt;
    llvm::SetVector<Operation *> place, value;
    bool hasSlices = collect(update.getOffsets(), loop, place) &&
                     collect(update.getArray(), loop, place) &&
                     collect(loop.getLowerBound(), loop, place) &&
                     collect(loop.getUpperBound(), loop, place) &&
                     collect(loop.getStep(), loop, place) &&
                     collect(sum.product->getOperands(), loop, value);
    bool movesAlong = llvm::any_of(update.getOffsets(), [&](Value offset) {
      return reaches(offset, loop.getInductionVar());
    });
    if (!hasSlices || !movesAlong ||
        !loop.getInductionVar().getType().isInteger(32))
      return std::nullopt;
    TidOp tid = tids.front();
    for (unsigned d = tid.getNumResults(); d-- > 0;)
      if (!dependsOn(place, update, tid.getResult(d)) &&
          !dependsOn(place, loop, tid.getResult(d)) &&
          dependsOn(value, sum.product, tid.getResult(d))) {
        sum.dim = d;
        return sum;
      }
    return std::nullopt;
  }

  static bool isConversion(TileMapOp map) {
    Block &body = map.getBody().front();
    auto cast = dyn_cast<CastOp>(body.front());
    return cast && cast->getNextNode() == body.getTerminator() &&
           cast->getOperand(0) == body.getArgument(0);
  }

  static bool reaches(Value value, Value from) {
    if (value == from)
      return true;
    Operation *def = value.getDefiningOp();
    return def && llvm::any_of(def->getOperands(), [&](Value operand) {
             return reaches(operand, from);
           });
  }

  /// Whether an operation, or one that computes something for it, uses a value.
  static bool dependsOn(const llvm::SetVector<Operation *> &slice,
                        Operation *op, Value value) {
    auto uses = [&](Operation *user) {
      return llvm::is_contained(user->getOperands(), value);
    };
    return uses(op) || llvm::any_of(slice, uses);
  }

  bool collect(ValueRange values, scf::ForOp loop,
               llvm::SetVector<Operation *> &slice) {
    return llvm::all_of(
        values, [&](Value value) { return collect(value, loop, slice); });
  }

  /// What has to be computed for a value, by any block before the launch.
  bool collect(Value value, scf::ForOp loop,
               llvm::SetVector<Operation *> &slice) {
    Operation *def = value.getDefiningOp();
    if (!def)
      return value == loop.getInductionVar() ||
             value.getParentBlock() == &adjoint.getBody().front();
    if (isa<TidOp>(def) || slice.contains(def))
      return true;
    auto load = dyn_cast<TileLoadOp>(def);
    bool isKnown = def->getBlock() == loop.getBody() ||
                   def->getBlock() == loop->getBlock();
    bool isPure = isMemoryEffectFree(def) &&
                  (isa<TileMapOp>(def) || def->getNumRegions() == 0);
    if (!isKnown || !(load ? isUnchanged(load) : isPure) ||
        !collect(def->getOperands(), loop, slice))
      return false;
    slice.insert(def);
    return true;
  }

  /// Operations on the elements of an array.
  bool everyAccess(const Root &root, function_ref<bool(Operation *)> holds) {
    bool all = true;
    adjoint.walk([&](Operation *op) {
      if (isa<ViewOp, GradOp, DimOp>(op))
        return;
      for (Value operand : op->getOperands())
        if (isa<ArrayType>(operand.getType()) && Root(operand).is(root))
          all &= holds(op);
    });
    return all;
  }

  bool isOnlyAddedTo(Value array) {
    Root root(array);
    return isa<BlockArgument>(root.base) &&
           everyAccess(root, [](Operation *op) {
             auto update = dyn_cast<TileAtomicOp>(op);
             return update && update.getKind() == TileUpdate::add &&
                    update.getOld().use_empty();
           });
  }

  /// Whether what a block loads is there before the launch: nobody writes it,
  /// or the block itself does so afterwards.
  bool isUnchanged(TileLoadOp load) {
    Root root(load.getArray());
    if (!isa<BlockArgument>(root.base) || load.getPicked())
      return false;
    bool isWritten = !everyAccess(root, [](Operation *op) {
      auto access = dyn_cast<AccessOp>(op);
      return isa<TileLoadOp>(op) || (access && !access.mayWrite());
    });
    if (!isWritten)
      return true;
    return isOwn(load, root) && everyAccess(root, [&](Operation *op) {
             auto store = dyn_cast<TileStoreOp>(op);
             return op == load || (store && !store.getPicked() &&
                                   store.getArray() == load.getArray() &&
                                   store.getOffsets() == load.getOffsets() &&
                                   store->getBlock() == load->getBlock() &&
                                   load->isBeforeInBlock(store));
           });
  }

  /// Whether no two blocks have elements of the tile in common.
  bool isOwn(TileLoadOp load, const Root &root) {
    SmallVector<std::pair<Value, int64_t>> axes;
    for (Value index : root.leading)
      axes.emplace_back(index, 1);
    for (auto [offset, extent] : llvm::zip_equal(
             load.getOffsets(), tiles::tileType(load.getResult()).getShape()))
      axes.emplace_back(offset, extent);
    Forms forms;
    for (unsigned d = 0; d < tids.front().getNumResults(); ++d)
      if (llvm::none_of(axes, [&](auto &axis) {
            return tiles::getOwnStep(forms.of(axis.first), axis.second, d) != 0;
          }))
        return false;
    return load->getBlock() == &adjoint.getBody().front();
  }

  func::FuncOp adjoint;
  SmallVector<TidOp> tids;
};

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
    TileAtomicOp::create(b, loc, tile.getType(), TileUpdate::add, tile,
                         clone(sum.update.getArray(), outer), offsets, Value(),
                         sum.update.getAxis(), sum.update.getChecked());
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
  SmallVector<TileSum> sums = Finder(adjoint).find();
  if (sums.empty())
    return false;
  TileGatherer(adjoint).build(sums);
  for (TileSum &sum : sums)
    sum.update.erase();
  return true;
}
