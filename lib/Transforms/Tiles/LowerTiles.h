//===- LowerTiles.h - Tiles as loops over elements --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_TILES_LOWERTILES_H
#define WARP_TRANSFORMS_TILES_LOWERTILES_H

#include "OwnWindows.h"
#include "TileScratch.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"

#include <map>

namespace warp::tiles {

struct ProductForm;

using mlir::Value;
using mlir::ValueRange;
using Values = llvm::SmallVector<Value>;

AtomicKind toAtomic(TileUpdate kind);

/// Writes code for operations on tiles; LowerTiles.cpp explains how. Indices
/// are signless i32 values.
class TileLowering {
public:
  TileLowering(mlir::FunctionOpInterface kernel, int64_t threads);
  mlir::LogicalResult run();

private:
  //===--------------------------------------------------------------------===//
  // Scalars
  //===--------------------------------------------------------------------===//

  Value number(int64_t value);
  template <typename Op> Value combined(Value x, Value y, int64_t neutral);
  Value add(Value a, Value b);
  Value mul(Value a, Value b);
  Value sub(Value a, Value b);
  Value less(Value a, Value b);
  Value both(Value a, Value b);
  bool isConstant(Value value, int64_t number);
  /// An integer of the dialect as an i32.
  Value toIndex(Value value);
  /// The same of an index, which counts from the end if it is below zero.
  Value toPlace(Value index, int64_t extent);
  Value cast(Value value, mlir::Type type);
  /// A builtin of the dialect by its Python name.
  Value builtin(llvm::StringRef name, ValueRange operands);
  Value zero(mlir::Type type);
  Value constant(mlir::Type type, double value);
  /// What a region of elements yields for these arguments.
  Values inlineBody(mlir::Block &body, ValueRange arguments);

  //===--------------------------------------------------------------------===//
  // Elements
  //===--------------------------------------------------------------------===//

  Value arrayAt(int64_t offset, int64_t count, mlir::Type element);
  Value memoryOf(Value tile);
  Value linear(llvm::ArrayRef<int64_t> shape, ValueRange indices);
  Values unravel(Value index, llvm::ArrayRef<int64_t> shape);
  Value placeIn(Value tile, ValueRange indices);
  Value stripeOf(Value tile);
  Value placeInStripe(Value tile);
  Value load(Value tile, ValueRange indices);
  void store(Value tile, ValueRange indices, Value value);
  /// An element, computed here if the tile is not kept.
  Value element(Value tile, ValueRange indices);
  Value elementOf(mlir::Operation *op, ValueRange indices);
  Value loadElement(TileLoadOp op, ValueRange indices);
  /// Indices of the array, and whether they are inside; null if that is known.
  template <typename Op>
  Values arrayIndices(Op op, TileType tile, ValueRange indices, Value &inside);
  /// A value under a condition, and otherwise zero.
  Value ifHolds(Value condition, mlir::Type type,
                llvm::function_ref<Value()> make);
  void ifHolds(Value condition, llvm::function_ref<void()> make);

  //===--------------------------------------------------------------------===//
  // Loops
  //===--------------------------------------------------------------------===//

  using Body = llvm::function_ref<Values(ValueRange indices, ValueRange sums)>;
  /// From `begin` to `end`, by one thread.
  Values loop(Value begin, Value end, Value step, ValueRange sums,
              llvm::function_ref<Values(Value, ValueRange)> body);
  void loop(int64_t end, llvm::function_ref<void(Value)> body);
  /// Over all indices of a shape, shared by the threads of the block.
  Values share(llvm::ArrayRef<int64_t> shape, ValueRange sums, Body body);
  void share(llvm::ArrayRef<int64_t> shape,
             llvm::function_ref<void(ValueRange)> body);
  Values nest(llvm::ArrayRef<int64_t> shape, Values &indices, ValueRange sums,
              Body body);
  /// The same for an operation: twice if accesses are tested, with the tests
  /// and, if all of them hold, without.
  Values elements(mlir::Operation *op, llvm::ArrayRef<int64_t> shape,
                  ValueRange sums, Body body);
  void elements(mlir::Operation *op, llvm::ArrayRef<int64_t> shape,
                llvm::function_ref<void(ValueRange)> body);
  void testWindow(mlir::Operation *op, Value &inside);
  void collectTested(mlir::Operation *op, Value &inside);
  bool touchesStripes(mlir::Operation *op);
  void barrier();
  void byFirstThread(llvm::function_ref<void()> make);

  //===--------------------------------------------------------------------===//
  // Operations
  //===--------------------------------------------------------------------===//

  void lower(mlir::Operation *op);
  void keep(mlir::Operation *op);
  void lowerMap(TileMapOp op);
  void lowerStore(TileStoreOp op);
  Value update(TileUpdate kind, Value value, Value array, ValueRange at);
  Value isAlone(llvm::ArrayRef<int64_t> steps);
  void lowerAtomic(TileAtomicOp op);
  void updateElements(TileAtomicOp op, bool plainly);
  void updateOwnElements(TileAtomicOp op, ValueRange early);
  Value updated(TileAtomicOp op, Value value, Value old);
  Values placeOfTurn(TileAtomicOp op, Value number);
  Values loadEarly(TileAtomicOp op, Value &alone);
  void lowerFromThreads(TileFromThreadsOp op);
  void lowerToThreads(TileToThreadsOp op);
  void lowerGet(TileGetOp op);
  void lowerSet(TileSetOp op);
  void updatePart(TileSetOp op, ValueRange indices);
  void lowerInsert(TileInsertOp op);
  void lowerGather(TileGatherOp op);
  void lowerScatter(TileScatterOp op);
  /// Before a change of a tile's elements: the result has those of the operand.
  void begin(mlir::Operation *op, Value tile);

  // In LowerTilesReductions.cpp.
  Value isBetter(TileReduction kind, Value candidate, Value best, bool orEqual);
  Value worst(TileReduction kind, mlir::Type type);
  Values combine(TileReduction kind, ValueRange best, ValueRange next);
  void reduceOrdered(mlir::Operation *op, TileReduction kind, Value tile,
                     bool positions);
  void lowerReduce(mlir::Operation *op, TileReduction kind, Value tile,
                   std::optional<int64_t> axis, bool positions);
  Values overBlock(mlir::Operation *op, TileReduction kind, Values sums);
  Values overWarps(mlir::Operation *op, TileReduction kind, Values sums);
  void lowerFold(TileFoldOp op);
  void lowerScan(TileScanOp op);

  // In LowerTilesSort.cpp.
  Value toOrdered(Value key);
  void lowerSort(TileSortOp op);
  void sortNetwork(Value keys, Value places, int64_t count);
  void orderPair(Value keys, Value places, Value i, Value j, int64_t run);

  // In LowerTilesAlgebra.cpp.
  void lowerMatmul(TileMatmulOp op);
  void lowerCholesky(TileCholeskyOp op);
  void lowerCholeskyAdjoint(TileCholeskyAdjointOp op);
  // LowerTilesChecks.cpp, of debug kernels.
  void checkFactor(TileCholeskyOp op);
  void lowerSolve(TileSolveOp op);
  void lowerDiagAdd(TileDiagAddOp op);

  // In LowerTilesTransforms.cpp.
  void lowerFft(TileFftOp op);
  int transform(std::array<Value, 2> memory, int64_t rows, int64_t n,
                bool inverse);
  void lowerFftStages(TileFftOp op);
  void lowerFftChirps(TileFftOp op);
  void lowerFftSums(TileFftOp op);
  Value twiddle(mlir::Type real, Value step, int64_t period, bool inverse);
  Value complexMul(Value a, Value b);

  // In LowerTilesLibrary.cpp.
  Value addressOf(Value memory);
  void callLibrary(const llvm::Twine &name, mlir::Type real, ValueRange args);
  int64_t scratchOf(mlir::Operation *op);
  Value copyTo(int64_t offset, Value tile, mlir::Type type, bool transposed);
  Strided matrixFor(mlir::Operation *op, Value tile, int64_t behind);
  void callProduct(TileMatmulOp op);
  void callCholesky(TileCholeskyOp op);
  void callCholeskyAdjoint(TileCholeskyAdjointOp op);
  void callSolve(TileSolveOp op);

  // In LowerTilesProducts.cpp.
  Value sumsOf(Value tile, int64_t slots);
  void callForSums(const llvm::Twine &name, const ProductForm &form,
                   TileType type, ValueRange arguments);
  void callHeld(llvm::StringRef verb, Value tile, Values arguments);
  void setHeld(mlir::Operation *op);
  void giveHeld(TileMapOp op);
  void storeHeld(TileStoreOp op);
  void addHeld(TileAtomicOp op);
  template <typename Op>
  Values windowOf(Op op, Value array, TileType tile, ValueRange offsets);
  void multiply(TileMatmulOp op, Value sums, Value turn);
  void lowerHeldProduct(TileMatmulOp op);
  void limitWindow(Values &window, int64_t axis, Value count);
  Value placeOf(Value tile, Value turn);
  void fetch(TileLoadOp load, mlir::scf::ForOp loop, Value iteration,
             Value turn);
  Values offsetsAt(TileLoadOp load, mlir::scf::ForOp loop, Value iteration,
                   Value *array = nullptr);
  Value iterationAfter(mlir::scf::ForOp loop, Value iteration, Value steps);
  Value isIteration(mlir::scf::ForOp loop, Value iteration);
  Value stepsBefore(mlir::scf::ForOp loop);
  void lowerAhead(mlir::scf::ForOp loop);

  // In LowerTilesRings.cpp.
  Values tmaFactorOf(TileLoadOp load, mlir::scf::ForOp loop);
  void lowerRing(mlir::scf::ForOp loop);

  // In LowerTilesForms.cpp.
  bool isCopied(TileLoadOp op);
  void copyMatrix(TileLoadOp op);
  void callForm(llvm::StringRef verb, mlir::Operation *op, Values arguments);
  void factor(TileCholeskyOp op);
  void differentiateFactor(TileCholeskyAdjointOp op);
  void substitute(TileSolveOp op);
  void transformRows(TileFftOp op);

  void detach();

  mlir::FunctionOpInterface kernel;
  int64_t threads;
  TileBuffers buffers;
  std::map<std::tuple<int64_t, int64_t, const void *>, Value> arrays;
  /// Of updates that blocks of a CPU may make plainly.
  llvm::DenseMap<mlir::Operation *, OwnSteps> ownSteps;
  /// Where what those add to may be loaded.
  llvm::DenseMap<mlir::Operation *, mlir::Operation *> earliest;
  /// By the tile that stands for others.
  llvm::DenseMap<Value, Value> heldSums;
  mlir::OpBuilder b, entry;
  mlir::Location loc;
  mlir::Type i32;
  Value thread;
  bool debug, testing = true;
  /// Whether it is known if an operation's accesses are tested.
  bool isDecided = false;
  /// Within `share`: how many elements the thread has had before, and whether
  /// that is to be a constant.
  Value turn;
  bool isStriped = false;
};

} // namespace warp::tiles

#endif // WARP_TRANSFORMS_TILES_LOWERTILES_H
