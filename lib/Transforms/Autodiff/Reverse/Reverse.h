//===- Reverse.h - The builder of an adjoint --------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_REVERSE_H
#define WARP_TRANSFORMS_AUTODIFF_REVERSE_H

#include "Autodiff/Activity.h"
#include "Autodiff/HiddenArguments.h"
#include "Autodiff/Loops/MemoryLog.h"
#include "Autodiff/MemoryClasses.h"
#include "Autodiff/Rules/Rules.h"
#include "Cotangents.h"

#include "mlir/Dialect/Func/IR/FuncOps.h"

namespace mlir::scf {
class ForOp;
class IfOp;
class WhileOp;
} // namespace mlir::scf

namespace warp {
class AccessOp;
class ExtractOp;
class TileAccessOp;
} // namespace warp

namespace warp::attr {
/// On a load of the adjoint: the launch may have overwritten what it is meant
/// to read; the text says how. An error if something uses it.
constexpr llvm::StringLiteral unrecoverable = "warp.unrecoverable";
/// On a load of the adjoint: right if one thread ran the launch.
constexpr llvm::StringLiteral assumesOneThread = "warp.assumes_one_thread";
/// On a store of the adjoint: it only concerns the global tape.
constexpr llvm::StringLiteral taped = "warp.taped";
} // namespace warp::attr

namespace warp::autodiff {

/// An argument that only the adjoint has. The values are part of the interface
/// to the runtime; see include/warp/Autodiff.h.

struct ReverseOptions {
  /// Per array leaf: it has a gradient.
  llvm::SmallVector<bool> active;
  Singular singular = Singular::Pinned;
  /// No two array arguments overlap.
  bool unique = true;
  /// Bytes that a loop with a known number of trips may keep per thread.
  int64_t maxLocalTape = 256;
  /// Loops that would need checkpoints keep all of their iterations, except
  /// for `untaped`.
  bool globalTape = false;
  llvm::DenseSet<mlir::Operation *> untaped;
  /// Says how each value that a loop carries is recovered.
  bool dumpRecovery = false;
  /// The values that a second run of the kernel keeps; null without one.
  const MemoryLog *log = nullptr;
  /// Loads whose values the launch or a copy from before it has.
  OrderedReads ordered;
  int64_t logSites() const { return log ? log->sites : 0; }
};

/// Counts of what the adjoint costs.
struct ReverseMetrics {
  int64_t tapeBytes = 0, replayLoops = 0;
  /// In the global tape, for one trip of each loop that is in it.
  int64_t tapeBytesPerTrip = 0;
};

/// Builds the adjoint of one kernel; Reverse.cpp explains how.
class ReverseBuilder {
public:
  ReverseBuilder(mlir::func::FuncOp primal, mlir::func::FuncOp adjoint,
                 const ReverseOptions &options);

  /// Fills the body of the adjoint.
  mlir::LogicalResult build();

  //===--------------------------------------------------------------------===//
  // Values of the forward sweep
  //===--------------------------------------------------------------------===//

  /// The value of the adjoint that stands for a primal value.
  mlir::Value recover(mlir::Value primal) const;
  llvm::SmallVector<mlir::Value> recover(mlir::ValueRange primals) const;
  /// Says what stands for a primal value from now on.
  void setRecovered(mlir::Value primal, mlir::Value recovered) {
    values[primal] = recovered;
  }
  void setRecovered(mlir::ValueRange primals, mlir::ValueRange recovered);

  /// Clones what the block computes, without its effects and without its
  /// terminator, at the builder's insertion point. The arguments of the block
  /// must have been recovered. Loops and branches within are cloned whole.
  mlir::LogicalResult replay(mlir::Block &block);
  mlir::LogicalResult replay(mlir::Operation *op);
  /// Primal values that the replay of an operation without regions uses.
  llvm::SmallVector<mlir::Value> getReplayUses(mlir::Operation *op) const;

  //===--------------------------------------------------------------------===//
  // Cotangents
  //===--------------------------------------------------------------------===//

  bool isActive(mlir::Value primal) const { return activity.isActive(primal); }
  /// Adds to the cotangent of a primal value; nothing unless it is active and
  /// `cotangent` is not null.
  void addCotangent(mlir::Value primal, mlir::Value cotangent);
  /// The cotangent of a primal value, which has none afterwards. Null: zero.
  mlir::Value takeCotangent(mlir::Value primal);
  /// The same, with a constant zero instead of null.
  mlir::Value takeCotangentOrZero(mlir::Value primal);
  /// A zero of the type that cotangents of the value have.
  mlir::Value zeroCotangent(mlir::Value primal);

  /// Cotangents that code in a region contributes to values outside of it.
  using Captures = llvm::SmallVector<std::pair<mlir::Value, mlir::Value>>;
  /// Runs `body` with all cotangents zero and returns those that are left
  /// after it, summed up at the insertion point that `body` leaves. Earlier
  /// sums there before is restored; the caller adds the captures, brought out
  /// of the region, with `addCotangent`.
  mlir::FailureOr<Captures>
  inScope(llvm::function_ref<mlir::LogicalResult()> body);

  /// Walks the operations of a replayed block backwards, except for the
  /// terminator: the cotangents of what it yields have been added before.
  mlir::LogicalResult reverse(mlir::Block &block);
  mlir::LogicalResult reverse(mlir::Operation *op);

  //===--------------------------------------------------------------------===//
  // Arrays
  //===--------------------------------------------------------------------===//

  /// The array of gradients of a primal array, at the recovered indices of its
  /// views.
  mlir::Value gradOf(mlir::Value array);

  //===--------------------------------------------------------------------===//
  // State
  //===--------------------------------------------------------------------===//

  mlir::OpBuilder builder;
  const ReverseOptions &options;
  const Activity &getActivity() const { return activity; }
  const MemoryClasses &getMemory() const { return memory; }
  ReverseMetrics metrics;

  /// An argument that the adjoint has beyond those of the primal, added when
  /// first asked for. `leaf` says of which array it keeps contents; -1 without.
  /// An argument that clean-up leaves without a use is dropped.
  mlir::Value getHidden(HiddenKind kind, int64_t leaf, mlir::Type type);
  /// The same, a new one each time.
  mlir::Value addHidden(HiddenKind kind, int64_t leaf, mlir::Type type);

  /// The text of --dump-recovery, and its place.
  llvm::SmallVector<std::pair<mlir::Location, std::string>> remarks;

  /// Loops in the global tape, by their number there, and those of them that
  /// cannot be: `untaped` of the next attempt.
  llvm::SmallVector<mlir::Operation *> taped, untaped;

  /// Places whose singular points are counted, in the order of the counters.
  llvm::ArrayRef<mlir::Location> getSingularPlaces() const {
    return singularPlaces;
  }

private:
  mlir::LogicalResult replayRegions(mlir::Operation *op);
  mlir::LogicalResult replayLoad(AccessOp op);
  void replayOrdered(AccessOp op, mlir::Value isWritten);
  mlir::LogicalResult replayUpdate(AccessOp op);
  mlir::LogicalResult replaySaved(mlir::Operation *op, llvm::StringRef why);
  /// The copy of an array, or of a view, that was made before the launch.
  mlir::Value recoverPreserved(mlir::Value array);
  void addLog();
  void replayLogged(mlir::Operation *op, const LoggedLoad &logged);
  mlir::LogicalResult replayCall(mlir::func::CallOp op);
  mlir::LogicalResult replayTileAccess(TileAccessOp op);

  mlir::LogicalResult reverseIf(mlir::scf::IfOp op);
  void finishIf(mlir::scf::IfOp draft, llvm::ArrayRef<Captures> sides);
  mlir::LogicalResult reverseAccess(AccessOp op);
  mlir::LogicalResult reverseRead(AccessOp op);
  mlir::LogicalResult reverseWrite(AccessOp op);
  mlir::LogicalResult reverseUpdate(AccessOp op);
  mlir::LogicalResult reverseUpTo(mlir::Block &block,
                                  mlir::Block::iterator end);
  bool isOnlySource(mlir::Operation *op) const;
  mlir::LogicalResult reverseAsWinner(AccessOp op);
  mlir::LogicalResult reverseExtremum(AccessOp op, mlir::Value gradient,
                                      mlir::ValueRange indices);
  mlir::LogicalResult reverseCall(mlir::func::CallOp op);
  mlir::LogicalResult reverseScratchLoad(ScratchLoadOp op);
  mlir::LogicalResult reverseByRule(mlir::Operation *op);
  bool addSlots(ExtractOp op);
  mlir::Value narrow(mlir::Value cotangent, mlir::Type type);

  void replayWide(mlir::Operation *op);
  mlir::Value recoverWide(mlir::Value primal);

  RuleContext getContext(mlir::Operation *op);
  void countSingular(mlir::Location loc, mlir::Value isSingular);
  /// The views that lead to an array, of another array.
  mlir::Value rebase(mlir::Value array,
                     llvm::function_ref<mlir::Value(mlir::Value)> replaceRoot);
  mlir::Value recoverRoot(mlir::Value root);

  mlir::func::FuncOp primal, adjoint;
  ArrayLeaves leaves;
  Activity activity;
  MemoryClasses memory;
  llvm::DenseMap<mlir::Value, mlir::Value> values;
  /// The value that rules use for a primal value of 16-bit floats.
  llvm::DenseMap<mlir::Value, mlir::Value> wideValues;
  Cotangents cotangents;
  /// By array argument or field.
  llvm::DenseMap<mlir::Value, mlir::Value> gradients;
  /// Number of the hidden argument by kind and leaf.
  std::map<std::pair<int64_t, int64_t>, unsigned> hidden;
  llvm::SmallVector<mlir::Location> singularPlaces;
  /// By logged load; where the thread's part begins, by site.
  llvm::DenseMap<mlir::Operation *, mlir::Value> logTapes;
  llvm::SmallVector<mlir::Value> logOffsets;
};

/// In ReverseLoops.cpp. The builder's insertion point is where the reverse
/// loop goes; cotangents of the results have been added and are taken here.
mlir::LogicalResult reverseFor(ReverseBuilder &reverse, mlir::scf::ForOp op);
mlir::LogicalResult reverseWhile(ReverseBuilder &reverse,
                                 mlir::scf::WhileOp op);

/// In ReverseMemory.cpp: the error for what an atomic returns.
mlir::LogicalResult refuseReturned(mlir::Location atomic);

/// In ReverseTiles.cpp.
mlir::LogicalResult reverseTile(ReverseBuilder &reverse, mlir::Operation *op);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_REVERSE_H
