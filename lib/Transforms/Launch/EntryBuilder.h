//===- EntryBuilder.h - Building the entry of a launch ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// State of warp-emit-entry. EmitEntryCpu.cpp has the loops over a range of
// threads, EmitEntryBatches.cpp those of interleaved blocks, EmitEntry.cpp
// the rest. On a GPU schedules have mapped threads to the grid.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ENTRYBUILDER_H
#define WARP_LIB_TRANSFORMS_ENTRYBUILDER_H

#include "ThreadsBuilder.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"

namespace warp {

struct Batches;
struct SystemCalls;

/// Builds the entry of one kernel of phase `launch`.
class EntryBuilder : ThreadsBuilder {
public:
  EntryBuilder(mlir::FunctionOpInterface kernel, ThreadsOp threads)
      : ThreadsBuilder(kernel, threads),
        rank(getTarget(kernel).isSimt() ? variant.getRank() : threads.getIndices().size()) {}

  void build();

private:
  void createEntry();
  void readArguments();
  Values buildGpu();
  void lowerGroupOps();
  mlir::Value parameter(mlir::Type type, int64_t offset);

  // EmitEntryCpu.cpp
  Values buildCpu();
  Values buildRows(mlir::Value begin, mlir::Value end, mlir::ValueRange sums);
  Values buildRange(mlir::Value begin, mlir::Value end, mlir::ValueRange outer,
                    mlir::ValueRange sums);
  Values buildScalarLoop(mlir::Value begin, mlir::Value end,
                         mlir::ValueRange outer, mlir::ValueRange sums);
  /// A loop over the last index; `take` runs the threads of an iteration.
  Values buildLoop(mlir::Value begin, mlir::Value end, mlir::Value step,
                   mlir::ValueRange outer, mlir::ValueRange sums,
                   llvm::function_ref<Values(const Values &)> take);
  Values buildFullLanes(mlir::Value begin, mlir::Value end,
                        mlir::ValueRange outer, mlir::ValueRange sums);
  Values buildLastLanes(mlir::Value begin, mlir::Value end,
                        mlir::ValueRange outer, mlir::ValueRange sums);
  Values buildMaskedLanes(mlir::Value begin, mlir::Value end,
                          mlir::ValueRange outer, mlir::ValueRange sums);
  Values buildAlignedLanes(mlir::Value begin, mlir::Value end,
                           mlir::ValueRange outer, mlir::ValueRange sums);
  Values buildPart(mlir::Value any, mlir::Value first, mlir::ValueRange outer,
                   mlir::ValueRange sums,
                   llvm::function_ref<mlir::Value()> findLive);
  mlir::Value liveLanes(mlir::Value count);

  // EmitEntryBatches.cpp
  void buildBatches(const Batches &batches, mlir::Value begin, mlir::Value end);
  void callForBatch(const SystemCalls &calls, const Batches &batches,
                    mlir::Value count);
  mlir::Value placeInBatch(int64_t offset);
  void describeBatches(const Batches &batches);

  int64_t rank;
  mlir::LLVM::LLVMFuncOp entry;
  mlir::Value block;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ENTRYBUILDER_H
