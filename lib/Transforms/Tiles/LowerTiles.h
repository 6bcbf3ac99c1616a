//===- LowerTiles.h - Code of operations on tiles ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_LOWERTILES_H
#define WARP_TRANSFORMS_TILES_LOWERTILES_H

#include "DisjointWindows.h"
#include "TileBuffers.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"

#include <map>

namespace warp::tiles {

using mlir::Value;
using mlir::ValueRange;
using Values = llvm::SmallVector<Value>;

AtomicKind toAtomic(TileUpdate kind);

/// The kernel whose tiles are lowered, and where code is written.
struct LoweringState {
  LoweringState(mlir::FunctionOpInterface kernel, int64_t threads);

  mlir::FunctionOpInterface kernel;
  int64_t threads;
  TileBuffers buffers;
  /// `entry` writes at the start of the kernel.
  mlir::OpBuilder b, entry;
  mlir::Location loc;
  mlir::Type i32;
  /// The number of the thread; null if the block has one.
  Value thread;
  bool debug;

  /// Arrays of shared memory by offset, length and element type.
  std::map<std::tuple<int64_t, int64_t, const void *>, Value> arrays;
  /// Registers of a thread by the tile that stands for others.
  llvm::DenseMap<Value, Value> registers;
  /// Steps of updates that blocks may make plainly.
  llvm::DenseMap<mlir::Operation *, DisjointSteps> disjointSteps;
  /// The earliest point to load the old elements of those.
  llvm::DenseMap<mlir::Operation *, mlir::Operation *> earliest;

  /// Elements that a loop accesses may be outside of their array.
  bool testing = true;
  /// It is known if the accesses of an operation are tested.
  bool isDecided = false;
  /// Within `share`: how many elements the thread has treated before, and
  /// whether that is to be a constant.
  Value round;
  bool isDistributed = false;
};

/// Writes code at `b`: scalars, accesses of tiles and arrays, and loops that
/// the threads of the block share. The lowering of a family of operations
/// derives from it. Indices are signless i32 values.
class TileLowering {
public:
  explicit TileLowering(LoweringState &state);

  LoweringState &state;
  mlir::FunctionOpInterface kernel;
  int64_t threads;
  const TileBuffers &buffers;
  mlir::OpBuilder &b, &entry;
  mlir::Location &loc;
  mlir::Type i32;
  Value thread;

  //===--------------------------------------------------------------------===//
  // Scalars (LowerTilesLoops.cpp)
  //===--------------------------------------------------------------------===//

  Value number(int64_t value);
  Value add(Value a, Value b);
  Value mul(Value a, Value b);
  Value sub(Value a, Value b);
  Value less(Value a, Value b);
  Value both(Value a, Value b);
  /// An integer of the dialect as an i32.
  Value toIndex(Value value);
  Value cast(Value value, mlir::Type type);
  /// A builtin of the dialect by its Python name.
  Value builtin(llvm::StringRef name, ValueRange operands);
  Value zero(mlir::Type type);
  Value constant(mlir::Type type, double value);
  /// The values that a region of elements yields for these arguments.
  Values inlineBody(mlir::Block &body, ValueRange arguments);

  //===--------------------------------------------------------------------===//
  // Memory (LowerTilesMemory.cpp)
  //===--------------------------------------------------------------------===//

  Value arrayAt(int64_t offset, int64_t count, mlir::Type element);
  Value memoryOf(Value tile);
  Value addressOf(Value memory);
  int64_t scratchOf(mlir::Operation *op);
  Value linear(llvm::ArrayRef<int64_t> shape, ValueRange indices);
  Values unravel(Value index, llvm::ArrayRef<int64_t> shape);
  Value placeIn(Value tile, ValueRange indices);
  Value load(Value tile, ValueRange indices);
  void store(Value tile, ValueRange indices, Value value);
  /// An element, computed here if the tile is not kept.
  Value element(Value tile, ValueRange indices);
  /// Computes the elements of a tile and stores them.
  void keep(mlir::Operation *op);
  /// Before a change of a tile's elements: the result has those of the operand.
  void begin(mlir::Operation *op, Value tile);
  /// Elements of a matrix in the order of its rows, or columns if it is
  /// transposed, as another type, from `offset` of shared memory on.
  Value copyTo(int64_t offset, Value tile, mlir::Type type, bool transposed);
  /// A matrix in shared memory, with its steps, or a copy of it `behind` bytes
  /// into the scratch memory of an operation.
  Strided matrixFor(mlir::Operation *op, Value tile, int64_t behind);
  /// Calls a function of the device library, of f32 or f64 if `real` is one.
  void callLibrary(const llvm::Twine &name, mlir::Type real, ValueRange args);
  /// Calls that of an operation which has one on a GPU (TileFunction).
  void callVariant(llvm::StringRef name, mlir::Operation *op, Values arguments);

  //===--------------------------------------------------------------------===//
  // Windows of arrays (LowerTilesWindows.cpp)
  //===--------------------------------------------------------------------===//

  /// Indices of the array, and whether they are inside; null if that is known.
  Values arrayIndices(TileAccessOp op, ValueRange indices, Value &inside);
  /// Data, offsets, extents, steps and shape of a tile in an array, and whether
  /// it is tested.
  Values windowOf(TileAccessOp op, Value array, ValueRange offsets);
  /// An atomic update of an array element; gives the old one.
  Value update(TileUpdate kind, Value value, Value array, ValueRange at);
  void testWindow(mlir::Operation *op, Value &inside);
  void collectTested(mlir::Operation *op, Value &inside);
  bool touchesDistributed(mlir::Operation *op);

  //===--------------------------------------------------------------------===//
  // Control flow (LowerTilesLoops.cpp)
  //===--------------------------------------------------------------------===//

  using Body = llvm::function_ref<Values(ValueRange indices, ValueRange sums)>;
  /// From `begin` to `end`, by one thread.
  Values loop(Value begin, Value end, Value step, ValueRange sums,
              llvm::function_ref<Values(Value, ValueRange)> body);
  void loop(int64_t end, llvm::function_ref<void(Value)> body);
  /// Over all indices of a shape, shared by the threads of the block.
  Values share(llvm::ArrayRef<int64_t> shape, ValueRange sums, Body body);
  Values shareLeft(llvm::ArrayRef<int64_t> shape, int64_t first,
                   ValueRange sums, Body body);
  void share(llvm::ArrayRef<int64_t> shape,
             llvm::function_ref<void(ValueRange)> body);
  /// The same for an operation: twice if accesses are tested, with the tests
  /// and, if all of them hold, without.
  Values elements(mlir::Operation *op, llvm::ArrayRef<int64_t> shape,
                  ValueRange sums, Body body);
  void elements(mlir::Operation *op, llvm::ArrayRef<int64_t> shape,
                llvm::function_ref<void(ValueRange)> body);
  /// A value under a condition, and otherwise zero.
  Value ifHolds(Value condition, mlir::Type type,
                llvm::function_ref<Value()> make);
  void ifHolds(Value condition, llvm::function_ref<void()> make);
  void barrier();
  void byFirstThread(llvm::function_ref<void()> make);

private:
  template <typename Op> Value combined(Value x, Value y, int64_t neutral);
  bool isConstant(Value value, int64_t number);
  Values nest(llvm::ArrayRef<int64_t> shape, Values &indices, ValueRange sums,
              Body body);
  Value registersOf(Value tile);
  Value indexInRegisters(Value tile);
};

/// Finds updates that blocks may make plainly; before anything is lowered.
void findPlainUpdates(LoweringState &state,
                      llvm::ArrayRef<mlir::Operation *> ops);

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_LOWERTILES_H
