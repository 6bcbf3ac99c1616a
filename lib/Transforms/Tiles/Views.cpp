//===- Views.cpp - Models of tile views -----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The elements of a view are elements of its first operand, computed where they
// are used unless the view has to be kept.
//
//===----------------------------------------------------------------------===//

#include "Models.h"

using namespace mlir;

namespace warp::tiles {

namespace {

struct ViewAdjoint : autodiff::TileReverse {
  using TileReverse::TileReverse;
  Value transposed(TileTransposeOp view, Value g);
  Value summed(TileBroadcastOp view, Value g);
  Value inserted(TileSliceOp view, Value g);
};

} // namespace

Value ViewAdjoint::transposed(TileTransposeOp view, Value g) {
  if (auto product = g.getDefiningOp<TileMatmulOp>();
      product && !product.getC())
    return multiply(product.getB(), product.getA(), !product.getTransposeB(),
                    !product.getTransposeA(), product.getAlpha());
  SmallVector<int64_t> back(view.getAxes().size());
  for (auto [i, axis] : llvm::enumerate(view.getAxes()))
    back[axis] = i;
  return TileTransposeOp::create(b, loc, cotangentType(view.getTile()), g,
                                 back);
}

Value ViewAdjoint::summed(TileBroadcastOp view, Value g) {
  TileType from = typeOf(view.getTile()), to = typeOf(g);
  if (from.getNumElements() == 1)
    return reshape(reduce(g, std::nullopt), from.getShape());
  SmallVector<int64_t> shape(to.getRank() - from.getRank(), 1);
  llvm::append_range(shape, from.getShape());
  for (int64_t d = to.getRank(); d-- > 0;)
    if (shape[d] == 1 && to.getShape()[d] != 1) {
      SmallVector<int64_t> kept(typeOf(g).getShape());
      kept[d] = 1;
      g = reshape(reduce(g, d), kept);
    }
  return reshape(g, from.getShape());
}

Value ViewAdjoint::inserted(TileSliceOp view, Value g) {
  Value none = zeroOf(cotangentType(view.getTile()));
  return TileInsertOp::create(b, loc, none.getType(), g, none,
                              recover(view.getOffsets()), view.getSteps());
}

namespace {

/// A derived class has `indicesOf` and `cotangentOf` of the operand.
template <typename Model, typename Op> struct ViewModel : TileModel<Model, Op> {
  bool isView(Operation *) const { return true; }
  bool isElementwise(Operation *) const { return true; }
  TileRead getRead(Operation *, OpOperand &) const { return TileRead::Once; }
  Value element(Operation *op, TileLowering &lowering,
                ValueRange indices) const {
    return lowering.element(
        op->getOperand(0),
        Model::indicesOf(mlir::cast<Op>(op), lowering, indices));
  }
  void lower(Operation *op, TileLowering &lowering) const { lowering.keep(op); }
  LogicalResult adjoint(Operation *op, autodiff::TileReverse &reverse) const {
    if (Value g = reverse.take()) {
      ViewAdjoint adjoint(reverse.reverse, op);
      reverse.give(op->getOperand(0),
                   Model::cotangentOf(mlir::cast<Op>(op), adjoint, g));
    }
    return success();
  }
};

struct TransposeModel : ViewModel<TransposeModel, TileTransposeOp> {
  static Values indicesOf(TileTransposeOp view, TileLowering &,
                          ValueRange indices) {
    Values source(indices.size());
    for (auto [axis, index] : llvm::zip_equal(view.getAxes(), indices))
      source[axis] = index;
    return source;
  }
  static Value cotangentOf(TileTransposeOp view, ViewAdjoint &adjoint,
                           Value g) {
    return adjoint.transposed(view, g);
  }
};

struct ReshapeModel : ViewModel<ReshapeModel, TileReshapeOp> {
  static Values indicesOf(TileReshapeOp view, TileLowering &lowering,
                          ValueRange indices) {
    Value i = lowering.linear(tileType(view.getResult()).getShape(), indices);
    return lowering.unravel(i, tileType(view.getTile()).getShape());
  }
  static Value cotangentOf(TileReshapeOp view, ViewAdjoint &adjoint, Value g) {
    return adjoint.reshape(g, tileType(view.getTile()).getShape());
  }
};

struct BroadcastModel : ViewModel<BroadcastModel, TileBroadcastOp> {
  static Values indicesOf(TileBroadcastOp view, TileLowering &lowering,
                          ValueRange indices) {
    TileType from = tileType(view.getTile());
    Values source;
    for (auto [extent, index] :
         llvm::zip_equal(from.getShape(), indices.take_back(from.getRank())))
      source.push_back(extent == 1 ? lowering.number(0) : index);
    return source;
  }
  static Value cotangentOf(TileBroadcastOp view, ViewAdjoint &adjoint,
                           Value g) {
    return adjoint.summed(view, g);
  }
};

struct SliceModel : ViewModel<SliceModel, TileSliceOp> {
  static Values indicesOf(TileSliceOp view, TileLowering &lowering,
                          ValueRange indices) {
    Values source;
    for (auto [offset, step, index] :
         llvm::zip_equal(view.getOffsets(), view.getSteps(), indices))
      source.push_back(
          lowering.add(lowering.toIndex(offset),
                       lowering.mul(index, lowering.number(step))));
    return source;
  }
  static Value cotangentOf(TileSliceOp view, ViewAdjoint &adjoint, Value g) {
    return adjoint.inserted(view, g);
  }
};

} // namespace

void attachViews(MLIRContext &context) {
  TileTransposeOp::attachInterface<TransposeModel>(context);
  TileReshapeOp::attachInterface<ReshapeModel>(context);
  TileBroadcastOp::attachInterface<BroadcastModel>(context);
  TileSliceOp::attachInterface<SliceModel>(context);
}

} // namespace warp::tiles
