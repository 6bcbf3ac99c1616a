//===- StageElements.h - Coalesced accesses of wide elements ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_STAGEELEMENTS_H
#define WARP_LIB_TRANSFORMS_STAGEELEMENTS_H

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/LLVMIR/LLVMDialect.h"
#include "mlir/IR/Builders.h"
#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/DenseSet.h"

namespace warp {

/// Accesses of an entry that whole warps perform together.
struct StagedAccesses {
  /// Loads that are in flight together, under the first; the others have an
  /// empty group.
  llvm::DenseMap<mlir::Operation *, llvm::SmallVector<LoadComponentsOp>> loads;
  llvm::DenseSet<mlir::Operation *> stores;
  /// Accesses of both kinds to elements of rows, one of each thread: the
  /// dimension of the array that tells threads apart.
  llvm::DenseMap<mlir::Operation *, unsigned> rows;
  /// True if the launch has threads enough for lines of rows to be a limit;
  /// null without accesses to rows.
  mlir::Value isCrowded;
  /// Number of the thread in its warp, i32.
  mlir::Value lane;
  /// Shared memory of the warp.
  mlir::Value slab;
  /// Bytes of the slab that are a thread's own where the warp lacks some.
  int64_t slotBytes = 0;
  /// True if threads of a warp differ in the last index of the launch only;
  /// null if that is so anyway.
  mlir::Value inRow;
};

/// Finds them in an entry for a GPU, and moves loads next to each other.
StagedAccesses findStagedAccesses(mlir::LLVM::LLVMFuncOp entry);

/// Words of a stretch between two of padding in the slab, where elements have
/// `count` words.
int64_t getSlabPeriod(int64_t count, int64_t warpSize);

/// Words of the slab from one element to the next, where elements of `count`
/// words are of rows: an odd number, so that threads are at different banks.
constexpr int64_t getRowPitch(int64_t count) { return count | 1; }

/// Address of the first lane's element, if elements follow each other.
mlir::Value beginOfRow(mlir::OpBuilder &b, mlir::Location loc,
                       const StagedAccesses &staged, mlir::Value pointer,
                       int64_t size);

/// True if all threads of a warp come to the insertion point together, and lie
/// in a row.
mlir::Value isWholeWarp(mlir::OpBuilder &b, mlir::Location loc,
                        const StagedAccesses &staged);
/// The same for threads of several rows, if the elements that `pointers` are of
/// follow each other all the same.
mlir::Value areStretches(mlir::OpBuilder &b, mlir::Location loc,
                         const StagedAccesses &staged,
                         mlir::ValueRange pointers,
                         llvm::ArrayRef<int64_t> sizes);

/// Threads of a warp that lacks some, each number an i32.
struct LaneGroup {
  /// A bit for each.
  mlir::Value lanes;
  /// The first lane, the one behind the last, and how many there are.
  mlir::Value first, end, size;
  /// How many lie before this one.
  mlir::Value rank;
};

/// The threads that come to the insertion point together.
LaneGroup findGroup(mlir::OpBuilder &b, mlir::Location loc,
                    const StagedAccesses &staged);
/// True if the elements that `pointers` are of follow each other in the lanes
/// of a group, and few lanes between them are missing.
mlir::Value isDense(mlir::OpBuilder &b, mlir::Location loc,
                    const StagedAccesses &staged, const LaneGroup &group,
                    mlir::ValueRange pointers, llvm::ArrayRef<int64_t> sizes);

/// Stores elements of a group that is dense, each by way of its thread's slot.
class PartialStage {
public:
  /// `pointer` is that of the thread's own element.
  PartialStage(mlir::OpBuilder &b, mlir::Location loc,
               const StagedAccesses &staged, const LaneGroup &group,
               mlir::Type element, mlir::Value pointer);

  /// `words` are those of the thread's own element.
  void store(mlir::ValueRange words);
  /// Stores elements all words of which are `value`.
  void fill(mlir::Value value);

private:
  mlir::Value constant(int64_t value);
  llvm::SmallVector<mlir::Value> ownSlot();
  void moveWords(mlir::Value index, int64_t number, mlir::Value value);
  void move(mlir::Value value = {});

  mlir::OpBuilder &b;
  mlir::Location loc;
  const StagedAccesses &staged;
  const LaneGroup &group;
  mlir::Type word;
  int64_t bytes, count;
  /// The element of the first thread in memory.
  mlir::Value begin;
};

/// The elements of a whole warp, which lie side by side, or a row apart. A
/// thread's share of them are words next to those of its neighbours.
class ElementStage {
public:
  /// `pointer` is that of the thread's own element; `rowBytes` are from there
  /// to the next thread's, null if elements lie side by side.
  ElementStage(mlir::OpBuilder &b, mlir::Location loc,
               const StagedAccesses &staged, mlir::Type element,
               mlir::Value pointer, mlir::Value rowBytes = nullptr);

  /// Words that a thread moves.
  int64_t getShareWords() const { return shareWords; }
  llvm::SmallVector<mlir::Value> loadShare();
  void storeShare(mlir::ValueRange words);
  /// Words of the thread's own element, from those of its share.
  llvm::SmallVector<mlir::Value> shareToElement(mlir::ValueRange words);
  llvm::SmallVector<mlir::Value> elementToShare(mlir::ValueRange words);

private:
  using Slot = llvm::function_ref<mlir::Value(int64_t)>;
  void placeStretch(mlir::Value lane, mlir::Value pointer, mlir::Value slab);
  void placeRows(mlir::Value lane, mlir::Value pointer, mlir::Value slab);
  mlir::Value advance(mlir::Value base, int64_t words);
  mlir::Value advance(mlir::Value base, mlir::Value words);
  mlir::Value constant(int64_t value);
  mlir::Value inMemory(int64_t i);
  mlir::Value inShare(int64_t i);
  llvm::SmallVector<mlir::Value> load(int64_t words, Slot from);
  void store(mlir::ValueRange words, Slot to);

  mlir::OpBuilder &b;
  mlir::Location loc;
  mlir::Type word;
  int64_t bytes, count, warpSize, period;
  /// Rows: bytes between those of two words of the share, i64.
  mlir::Value step;
  /// Words of the share, and in the slab from one of them to the next where
  /// elements are of rows.
  int64_t shareWords, shareStep = 0;
  /// The start of the thread's share in memory; share and element in the slab.
  mlir::Value memory, share, element;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_STAGEELEMENTS_H
