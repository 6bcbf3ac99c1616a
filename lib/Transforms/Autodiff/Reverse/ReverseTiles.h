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

/// Writes the adjoint of one operation; ReverseTiles.cpp has a table of rules.
class TileReverse {
public:
  TileReverse(ReverseBuilder &reverse, mlir::Operation *op);
  mlir::LogicalResult run();

private:
  using Value = mlir::Value;
  using ValueRange = mlir::ValueRange;
  using Type = mlir::Type;
  using LogicalResult = mlir::LogicalResult;
  using Shape = mlir::ArrayRef<int64_t>;

  static TileType typeOf(Value tile) {
    return mlir::cast<TileType>(tile.getType());
  }
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
  /// Restores a lost dimension, with extent 1.
  Value expand(Value tile, Shape shape, std::optional<int64_t> axis);
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

  //===--------------------------------------------------------------------===//
  // Rules
  //===--------------------------------------------------------------------===//

  LogicalResult reverseMap(TileMapOp map);
  LogicalResult reverseLoad(TileLoadOp load);
  LogicalResult reverseStore(TileStoreOp store);
  LogicalResult reverseAtomic(TileAtomicOp atomic);
  template <typename Op> Value loadGradient(Op access, TileType type);
  LogicalResult refuse();

  // In ReverseTilesParts.cpp.
  LogicalResult reversePart();
  Value reverseBroadcast(TileBroadcastOp view, Value g);
  void reverseInsert(TileInsertOp insert, Value g);
  Value partOf(Value element, mlir::ArrayAttr path, ValueRange components);
  LogicalResult reverseSet(TileSetOp set);
  LogicalResult reverseReduce(TileReduceOp reduce);
  LogicalResult reverseScan(TileScanOp scan);

  // In ReverseTilesAlgebra.cpp.
  Value multiply(Value x, Value y, bool transposeX, bool transposeY,
                 Value alpha = {});
  Value solve(Value matrix, Value rhs, bool upper, bool transposed);
  Value outer(Value x, Value y);
  /// Applies `function` to the elements of a triangle; the others are zero.
  Value triangle(Value tile, bool upper,
                 llvm::function_ref<Value(Value)> function);
  LogicalResult reverseMatmul(TileMatmulOp matmul);
  LogicalResult reverseCholesky(TileCholeskyOp factor);
  LogicalResult reverseSolve(TileSolveOp solve);
  void reverseSystem(TileCholeskyOp factor, TileSolveOp first,
                     TileSolveOp second, Value g);

  ReverseBuilder &reverse;
  mlir::OpBuilder &b;
  mlir::Location loc;
  mlir::Operation *op;
  int64_t threads;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_REVERSETILES_H
