//===- FindTileSums.cpp - Sums of products over blocks --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "FindTileSums.h"

#include "Analysis/Forms.h"
#include "Tiles/DisjointWindows.h"

using namespace mlir;
using namespace warp;
using warp::autodiff::TileSum;

namespace {

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
    TileSum sum{update, {}, {}, loop, 0, false};
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
        sum.isApart = isApart(sum);
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

  /// True if an operation, or one that computes something for it, uses a value.
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

  /// The operations that a value is computed from, by any block before the
  /// launch.
  bool collect(Value value, scf::ForOp loop,
               llvm::SetVector<Operation *> &slice) {
    Operation *def = value.getDefiningOp();
    if (!def)
      return value == loop.getInductionVar() ||
             value.getParentBlock() == &adjoint.getBody().front();
    if (isa<TidOp>(def) || slice.contains(def))
      return true;
    auto load = dyn_cast<TileAccessOp>(def);
    bool isKnown = def->getBlock() == loop.getBody() ||
                   def->getBlock() == loop->getBlock();
    bool isPure = isMemoryEffectFree(def) &&
                  (isa<TileOpInterface>(def) || def->getNumRegions() == 0);
    bool isRead = load && !load.mayWrite() && isUnchanged(load);
    if (!isKnown || !(load ? isRead : isPure) ||
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

  /// True if what a block loads is there before the launch: nobody writes it,
  /// or the block itself does so afterwards.
  bool isUnchanged(TileAccessOp load) {
    Root root(load.getArray());
    if (!isa<BlockArgument>(root.base) || load.getPicked())
      return false;
    bool isWritten = !everyAccess(root, [](Operation *op) {
      auto access = dyn_cast<AccessOp>(op);
      auto tiles = dyn_cast<TileAccessOp>(op);
      return (tiles && !tiles.mayWrite()) || (access && !access.mayWrite());
    });
    if (!isWritten)
      return true;
    return isOwn(load, root) && everyAccess(root, [&](Operation *op) {
             auto store = dyn_cast<TileAccessOp>(op);
             return op == load ||
                    (store && store.getEffect() == AccessEffect::Write &&
                     !store.getPicked() &&
                     store.getArray() == load.getArray() &&
                     store.getOffsets() == load.getOffsets() &&
                     store->getBlock() == load->getBlock() &&
                     load->isBeforeInBlock(store));
           });
  }

  /// True if blocks that differ in another dimension than that of the sum, and
  /// steps of the loop, add to different elements, and nothing else does.
  bool isApart(TileSum sum) {
    bool isOnly = everyAccess(Root(sum.update.getArray()),
                              [&](Operation *op) { return op == sum.update; });
    Forms forms;
    auto hasAxis = [&](function_ref<bool(const Form &, int64_t)> separates) {
      return llvm::any_of(
          llvm::zip_equal(sum.update.getOffsets(),
                          tiles::tileType(sum.update.getTile()).getShape()),
          [&](auto axis) {
            auto [offset, extent] = axis;
            return separates(forms.of(offset), extent);
          });
    };
    bool areSteps = hasAxis([&](const Form &form, int64_t extent) {
      return form.terms.size() == 1 && form.terms[0].product.size() == 1 &&
             form.terms[0].product[0] == Symbol::trip(sum.loop) &&
             std::abs(form.terms[0].factor) >= extent;
    });
    for (unsigned d = 0; d < tids.front().getNumResults(); ++d)
      isOnly &= d == sum.dim || hasAxis([&](const Form &form, int64_t extent) {
                  return tiles::getDisjointStep(form, extent, d) != 0;
                });
    return isOnly && areSteps;
  }

  /// True if no two blocks have elements of the tile in common.
  bool isOwn(TileAccessOp load, const Root &root) {
    SmallVector<std::pair<Value, int64_t>> axes;
    for (Value index : root.leading)
      axes.emplace_back(index, 1);
    for (auto [offset, extent] :
         llvm::zip_equal(load.getOffsets(), load.getTileType().getShape()))
      axes.emplace_back(offset, extent);
    Forms forms;
    for (unsigned d = 0; d < tids.front().getNumResults(); ++d)
      if (llvm::none_of(axes, [&](auto &axis) {
            return tiles::getDisjointStep(forms.of(axis.first), axis.second,
                                          d) != 0;
          }))
        return false;
    return load->getBlock() == &adjoint.getBody().front();
  }

  func::FuncOp adjoint;
  SmallVector<TidOp> tids;
};

} // namespace

SmallVector<TileSum> warp::autodiff::findTileSums(func::FuncOp adjoint) {
  return Finder(adjoint).find();
}
