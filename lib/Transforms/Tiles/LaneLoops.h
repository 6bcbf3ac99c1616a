//===- LaneLoops.h - Loops over the threads of a block ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_LANELOOPS_H
#define WARP_TRANSFORMS_TILES_LANELOOPS_H

#include "BlockVariance.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

namespace warp::tiles {

using mlir::Value;
using mlir::ValueRange;
using Values = llvm::SmallVector<Value>;

/// Writes loops over the threads of a block, and knows where values of the
/// kernel are found that these loops replace. Values are those of the kernel as
/// it was; what the builder makes is new.
class LaneLoops {
public:
  LaneLoops(mlir::FunctionOpInterface kernel, int64_t threads);

  /// Values that threads have each their own of.
  bool isLane(Value value) const {
    return varying.contains(value) || lanes.contains(value);
  }
  /// True if a tile can keep what threads have of a value.
  static bool isStorable(Value value);

protected:
  /// The state of a loop for one thread.
  struct Lane {
    Value number;
    mlir::IRMapping values;
  };
  using Body = llvm::function_ref<Values(Lane &, ValueRange tiles)>;
  using ElementBody =
      llvm::function_ref<Values(Lane &, Value number, ValueRange tiles)>;

  /// True if each thread does an operation by itself.
  bool isLaneOp(mlir::Operation *op) const;
  /// Control flow that threads share, with what they do by themselves inside.
  bool isShared(mlir::Operation *op) const;
  Value constantOf(mlir::Type type, int64_t value);
  Value constant(int64_t value) { return constantOf(index, value); }
  /// True if blocks are threads that follow each other in a launch of any
  /// extents.
  bool isRagged() const { return kernel->hasAttr(warp::attr::ragged); }
  /// The number of a thread in the launch, and of all threads, in 64 bits.
  Value linearIndex(ValueRange indices);
  Value countThreads();
  Value extentOf(int64_t axis);
  /// An index of a thread, given that of the block's first one.
  Value indexOf(const Lane &lane, Value first, int64_t axis);
  Value builtin(llvm::StringRef name, ValueRange operands);
  /// One element per thread; vectors and small matrices are columns.
  TileType laneType(mlir::Type type) const;
  Value read(Value tile, mlir::Type type, Value number);
  Value write(Value value, Value tile, Value number);
  /// `count` iterations, of thread number modulo the block, from these tiles.
  /// As many as there are threads are those that the launch has.
  Values overLanes(int64_t count, ValueRange tiles, Body body);
  /// The same over numbers up to `end`, of at most `count`.
  Values overElements(int64_t count, Value end, ValueRange tiles,
                      ElementBody body);
  Value laneValue(Value value, Lane &lane);
  /// The uniform value.
  Value sharedValue(Value value);
  /// The tile of what threads have of a value.
  Value laneTile(Value value);
  /// A tile of that shape; element e is what thread e mod B has.
  Value spread(Value value, llvm::ArrayRef<int64_t> shape);
  Value fill(TileType type, int64_t count, Value value);
  // In LaneAccesses.cpp.
  Values unravel(Value number, llvm::ArrayRef<int64_t> shape);
  Values arrayIndices(TileAccessOp op, Lane &lane, Value array,
                      ValueRange indices, Value &inside);
  Value ifInside(Value inside, mlir::Type type,
                 llvm::function_ref<Value()> make);
  Value accessElements(
      TileAccessOp op, bool gives,
      llvm::function_ref<Value(Value, ValueRange, ValueRange)> access);
  /// A load, store or update of a tile that threads make each elsewhere, as one
  /// element after the other; false if elements are structs.
  bool emitAccess(TileAccessOp op);
  /// An operation with what its function of elements uses from outside: what
  /// differs between threads becomes an operand.
  mlir::LogicalResult emitWithCaptures(mlir::Operation *op, Values operands,
                                       llvm::ArrayRef<int64_t> shape);
  /// Zero, the elements of threads that the launch does not have.
  Value emptyTile(TileType type);
  /// True if the launch has a thread of the block; null if it has all.
  Value isThere(const Lane &lane);
  /// Moves picked indices outside of the array for absent threads.
  void pickThere(TileAccessOp op);

  mlir::FunctionOpInterface kernel;
  int64_t threads;
  BlockVariance varying;
  mlir::OpBuilder b;
  mlir::Location loc;
  mlir::Type index, wide;
  /// Uniform values, tiles and control flow included.
  mlir::IRMapping shared;
  /// Tiles by what they keep.
  llvm::DenseMap<Value, Value> lanes;
  /// By index of the launch that differs: the one of the block's first thread,
  /// and the axis.
  llvm::DenseMap<Value, std::pair<Value, int64_t>> firstIndices;
  /// The number in the launch of a ragged block's first thread.
  Value firstThread;
  /// Threads that the last block of a launch has, if that may be fewer.
  Value present;
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_LANELOOPS_H
