//===- ReverseTiles.h - Adjoints of operations on tiles ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_REVERSETILES_H
#define WARP_TRANSFORMS_AUTODIFF_REVERSETILES_H

#include "Reverse.h"

#include "WarpDialect/TileOps.h"

namespace warp::autodiff {

/// The operation whose adjoint is written, and helpers for it. Models of
/// operations derive from it (lib/Transforms/Tiles/Models.h).
class TileReverse {
public:
  using Value = mlir::Value;
  using ValueRange = mlir::ValueRange;
  using Type = mlir::Type;
  using LogicalResult = mlir::LogicalResult;
  using Shape = mlir::ArrayRef<int64_t>;

  static TileType typeOf(Value tile) {
    return mlir::cast<TileType>(tile.getType());
  }
  TileReverse(ReverseBuilder &reverse, mlir::Operation *op);

  TileType shaped(Shape shape, Type element) {
    return TileType::get(b.getContext(), shape, element);
  }
  /// The type of the cotangent of a tile.
  TileType cotangentType(Value tile) {
    return mlir::cast<TileType>(differentialType(tile.getType()));
  }
  mlir::UnitAttr unit(bool flag) {
    return flag ? b.getUnitAttr() : mlir::UnitAttr();
  }
  Value index(int64_t value);
  Value zeroOf(Type type) { return zero(b, loc, type); }
  Value apply(mlir::StringRef name, ValueRange operands) {
    return createBuiltin(b, loc, name, operands)->getResult(0);
  }
  Value map(ValueRange inputs, llvm::function_ref<Value(ValueRange)> function) {
    return mapTiles(b, loc, inputs, function);
  }

  //===--------------------------------------------------------------------===//
  // Shapes
  //===--------------------------------------------------------------------===//

  Value reshape(Value tile, Shape shape);
  Value broadcast(Value tile, Shape shape);
  Value transpose(Value tile);
  Value reduce(Value tile, std::optional<int64_t> axis);
  Value iota(int64_t count, int64_t step = 1);
  /// Numbers along one dimension, in the shape of a tile.
  Value numbers(Shape shape, int64_t axis);
  /// Element e is of thread e mod B; each thread gets the sum of its elements.
  Value overThreads(Value tile, Type type);

  //===--------------------------------------------------------------------===//
  // Cotangents
  //===--------------------------------------------------------------------===//

  Value take(unsigned result = 0) {
    return reverse.takeCotangent(op->getResult(result));
  }
  void give(Value primal, Value cotangent) {
    reverse.addCotangent(primal, cotangent);
  }
  bool wants(Value primal) { return reverse.isActive(primal); }
  mlir::SmallVector<Value> recover(ValueRange values) {
    return reverse.recover(values);
  }
  /// An operand that may be absent.
  Value recoverOptional(Value value) {
    return value ? reverse.recover(value) : Value();
  }

  /// The product, of which the shorter factor is cast to the other's type.
  Value multiply(Value x, Value y, bool transposeX, bool transposeY,
                 Value alpha = {});
  /// The gradient of the elements that an access writes.
  Value loadGradient(TileAccessOp access);
  /// The error for an operation without a derivative.
  LogicalResult refuse();

  ReverseBuilder &reverse;
  mlir::OpBuilder &b;
  mlir::Location loc;
  mlir::Operation *op;
  int64_t threads;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_REVERSETILES_H
