//===- EntryBuilder.h - Building the entry of a launch ----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// State of warp-emit-entry. EmitEntry.cpp has what both targets share,
// EmitEntryCpu.cpp the loops over a range of threads, EmitEntryBatches.cpp
// those of blocks that take turns, EmitEntryGpu.cpp the thread of a GPU, and
// the files of Schedules/ one schedule each.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_ENTRYBUILDER_H
#define WARP_LIB_TRANSFORMS_ENTRYBUILDER_H

#include "GpuBlock.h"
#include "KernelFunction.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"
#include "mlir/IR/IRMapping.h"

#include "llvm/ADT/SmallPtrSet.h"

namespace warp {

class ThreadVariance;
struct Batches;
struct SystemCalls;

/// Items of a GPU thread whose block combines what they add up to.
constexpr int64_t summedItems = 32;

/// Parts that the warps of a GPU block can split a loop into: 8 at most.
int64_t countParts(mlir::Operation *kernel);

constexpr auto noWrap =
    mlir::arith::IntegerOverflowFlags::nsw | mlir::arith::IntegerOverflowFlags::nuw;

/// Builds the entry of one kernel of phase `launch`.
class EntryBuilder {
public:
  EntryBuilder(mlir::FunctionOpInterface kernel, ThreadsOp threads)
      : kernel(kernel), threads(threads), loc(kernel.getLoc()),
        b(kernel->getContext()), rank(threads.getIndices().size()),
        variant(getVariant(kernel)), index32(variant.getIndex32()),
        flat(variant.getFlat()) {}

  void build();

private:
  using Values = llvm::SmallVector<mlir::Value>;

  void createEntry();
  void readArguments();
  Values identities(bool inLanes);
  Values combine(mlir::ValueRange sums, mlir::ValueRange terms);
  Values cloneThread(mlir::ValueRange indices, mlir::Value live);
  Values takeThread(mlir::ValueRange indices);
  Values unravel(mlir::Value row, int count);

  // EmitEntryCpu.cpp
  Values buildCpu();
  Values buildRows(mlir::Value begin, mlir::Value end, mlir::ValueRange sums);
  Values buildRange(mlir::Value begin, mlir::Value end,
                    mlir::ValueRange outer, mlir::ValueRange sums);
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
  mlir::Value liveLanes(mlir::Value count);

  // EmitEntryBatches.cpp
  void buildBatches(const Batches &batches, mlir::Value begin,
                    mlir::Value end);
  void callForBatch(const SystemCalls &calls, const Batches &batches,
                    mlir::Value count);
  mlir::Value placeInBatch(int64_t offset);
  void describeBatches(const Batches &batches);

  // EmitEntryGpu.cpp and Schedules/
  Values buildGpu();
  Values buildForm();
  Values buildOneItem();
  Values buildOneBlock();
  Values buildStream();
  Values buildPlanes();
  Values buildSums();
  Values buildItems(llvm::ArrayRef<Values> indices, mlir::Value allExist,
                    llvm::function_ref<void()> buildAlone);
  mlir::Value buildLoop(mlir::Value begin, mlir::Value end, mlir::Value extent,
                        mlir::Value step);
  mlir::Value cloneInterleaved(llvm::ArrayRef<Values> items,
                               mlir::Block *body,
                               llvm::MutableArrayRef<mlir::IRMapping> clones);
  int64_t countItems();
  bool sumsManyItems();
  void planGpu();
  void planForm();
  void dependOn(int facts);
  Values buildJammed();
  mlir::scf::ForOp findSharedLoop();
  Values buildSplit();
  mlir::scf::ForOp findSplitLoop();
  Values joinParts(mlir::ValueRange sums, mlir::Value lane, mlir::Value part,
                   mlir::Value isFirst, int64_t parts);
  Values buildTiles();
  bool planTiles();
  bool isTurned(mlir::Operation *op, const ThreadVariance &variance);
  void buildSquare(llvm::MutableArrayRef<mlir::IRMapping> own,
                   llvm::MutableArrayRef<mlir::IRMapping> other,
                   llvm::ArrayRef<mlir::Value> ownPlaces,
                   llvm::ArrayRef<mlir::Value> otherPlaces,
                   mlir::Value memory);
  // Schedules/ReverseOrder.cpp
  bool canAlternate();
  mlir::Value blockIndex(Axis axis = Axis::x);
  Values gridIndices(mlir::Value &inside);
  mlir::Value gridIndex(Axis axis, mlir::Type type);
  mlir::Value countAll();

  // Small arithmetic, in the order of operands.
  mlir::Value constant(mlir::Type type, int64_t value) {
    return mlir::arith::ConstantOp::create(b, loc, b.getIntegerAttr(type, value));
  }
  mlir::Value cmp(mlir::arith::CmpIPredicate predicate, mlir::Value x, mlir::Value y) {
    return mlir::arith::CmpIOp::create(b, loc, predicate, x, y);
  }
  mlir::Value add(mlir::Value x, mlir::Value y) {
    return mlir::arith::AddIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value sub(mlir::Value x, mlir::Value y) {
    return mlir::arith::SubIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value mul(mlir::Value x, mlir::Value y) {
    return mlir::arith::MulIOp::create(b, loc, x, y, noWrap);
  }
  mlir::Value div(mlir::Value x, mlir::Value y) { return mlir::arith::DivUIOp::create(b, loc, x, y); }
  mlir::Value narrow(mlir::Value x, mlir::Type type) {
    unsigned from = x.getType().getIntOrFloatBitWidth();
    unsigned to = type.getIntOrFloatBitWidth();
    if (from == to)
      return x;
    if (from < to)
      return mlir::arith::ExtUIOp::create(b, loc, type, x);
    return mlir::arith::TruncIOp::create(b, loc, type, x, noWrap);
  }
  mlir::Value parameter(mlir::Type type, int64_t offset) {
    return ParameterOp::create(b, loc, type, block, offset,
                               /*packed=*/false, mlir::StringAttr());
  }

  mlir::FunctionOpInterface kernel;
  ThreadsOp threads;
  mlir::Location loc;
  mlir::OpBuilder b;
  int64_t rank;
  VariantAttr variant;
  bool index32, flat;
  mlir::LLVM::LLVMFuncOp entry;
  mlir::Value block;
  /// Extents of the launch, i32.
  Values dims;
  /// GPU: how the threads of the kernel become those of the launch. What is
  /// about kernels is decided before the entry takes their operations over.
  enum class Form { One, Block, Sums, Items, Jammed, Split, Tiles };
  Form form = Form::One;
  /// Indices of a thread in form `Items`.
  int64_t items = 1;
  /// The loop that indices, or threads, share.
  mlir::scf::ForOp loop;
  /// Whether launches may run the blocks of a GPU from the last to the first.
  bool alternates = false;
  /// Accesses whose elements the threads of a block exchange.
  llvm::SmallPtrSet<mlir::Operation *, 4> turned;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_ENTRYBUILDER_H
