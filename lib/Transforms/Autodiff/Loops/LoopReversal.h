//===- LoopReversal.h - Reversing a loop of either kind ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_LOOPREVERSAL_H
#define WARP_TRANSFORMS_AUTODIFF_LOOPREVERSAL_H

#include "Autodiff/Reverse/Reverse.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "llvm/ADT/STLFunctionalExtras.h"

namespace warp::autodiff {

/// How the values that a loop carries are recovered, iteration by iteration.
/// The numbers are those that --dump-recovery prints.
enum class RecoveryRank {
  NotNeeded = 0,
  /// The same in every iteration, or a step times the iteration.
  ClosedForm = 1,
  /// Iterations may be reversed in any order, so they run forward.
  CarriedAlong = 3,
  /// From the value after the iteration, by exact inverses of integers.
  Inverted = 4,
  /// All iterations are kept.
  Tape = 5,
  /// A few checkpoints; what is between two of them is run again.
  Checkpoints = 6,
  /// All iterations are kept, in memory that the runtime allocates.
  GlobalTape = 7,
};

/// One loop, as states that follow each other: `getStates` are the carried
/// values at the start of an iteration, `getNexts` those after it. Subclasses
/// know what an iteration is. LoopReversal.cpp explains the rest.
class LoopReversal {
public:
  LoopReversal(ReverseBuilder &reverse, mlir::Operation *loop)
      : reverse(reverse), b(reverse.builder), loc(loop->getLoc()), loop(loop) {}
  virtual ~LoopReversal() = default;

protected:
  /// The carried values of the primal loop before and after an iteration, and
  /// what they are before the first.
  virtual mlir::ValueRange getStates() = 0;
  virtual mlir::ValueRange getNexts() = 0;
  virtual mlir::ValueRange getInits() = 0;
  /// A carried value after the last iteration, in the adjoint.
  virtual mlir::Value getFinal(unsigned state) = 0;
  /// The counter of the primal loop; null if there is none.
  virtual mlir::Value getCounter() { return nullptr; }
  /// The source of a value that is a plain copy within an iteration.
  virtual mlir::Value trace(mlir::Value value) { return value; }
  /// Says what iteration it is.
  virtual void recoverIteration(mlir::Value number) {}
  /// Clones what one iteration computes, from the recovered states.
  virtual mlir::LogicalResult replayIteration() = 0;
  /// Reverses a replayed iteration; `getNexts` have their cotangents.
  virtual mlir::LogicalResult reverseIteration() = 0;

  /// True if threads may make different numbers of trips of loops that began
  /// together, so that they are better reversed in step.
  virtual bool mayEndApart() { return false; }
  /// True if the reverse loop, whose iterations have no order, can be one of
  /// the primal loop's kind, which needs no number of trips.
  virtual bool mayRunAlong(mlir::scf::ForOp reversed) { return false; }
  /// Makes it one: returns what the reverse loop leaves.
  virtual mlir::FailureOr<llvm::SmallVector<mlir::Value>>
  runAlong(mlir::scf::ForOp reversed) {
    return mlir::failure();
  }
  /// The most trips that the loop can make, if its forward sweep counts them
  /// and a constant bounds them.
  virtual std::optional<int64_t> getMostTrips() { return std::nullopt; }
  /// The loop that does.
  virtual mlir::Operation *getForwardSweep() { return nullptr; }
  /// Has it keep states in a tape with a slot for each of these trips.
  virtual void keepWhileCounting(llvm::ArrayRef<unsigned> states,
                                 mlir::ValueRange tape) {}
  /// Replays what the first draft of the reverse loop has placeholders for.
  virtual mlir::LogicalResult completeDraft() { return mlir::success(); }

  /// Emits the reverse of all `trips` iterations. `cotangents` are those of the
  /// states after the last, null for zero, and become those of `getInits`.
  mlir::LogicalResult reverseAll(mlir::Value trips,
                                 llvm::ArrayRef<mlir::Value> cotangents);
  /// Nothing flows back from these results of the loop, nor from memory.
  bool isZero(llvm::ArrayRef<mlir::Value> cotangents);
  mlir::Value constant(mlir::Type type, int64_t value);
  mlir::Value placeholder(mlir::Type type);
  void keep(mlir::ValueRange memory, mlir::Value slot, mlir::ValueRange values);
  /// The states before the loop.
  llvm::SmallVector<mlir::Value> recoverInits(llvm::ArrayRef<unsigned> states);
  /// Operations that have to stay while the reverse loop is not finished.
  llvm::SmallVector<mlir::Value> getHeld();
  /// No state is needed, nor the number of the iteration.
  bool needsNoState();
  void note(llvm::ArrayRef<unsigned> states, RecoveryRank rank, int64_t bytes);

  /// Stand for values within an iteration that `completeDraft` computes.
  llvm::SmallVector<mlir::Value> drafted;

  ReverseBuilder &reverse;
  mlir::OpBuilder &b;
  mlir::Location loc;
  mlir::Operation *loop;

private:
  /// The scratch memory of rank 6.
  struct Checkpoints {
    llvm::SmallVector<unsigned> needed, stateNumbers;
    /// The first is a power of two.
    int64_t ringSlots, checkpointSlots;
    llvm::SmallVector<mlir::Value> ring, states;
    mlir::Value starts;

    /// The last slot takes what nobody reads again.
    int64_t stateSlots() const { return checkpointSlots + 1; }
  };

  // LoopReversal.cpp: the reverse loop.
  llvm::SmallVector<bool> findCotangents(llvm::ArrayRef<mlir::Value> given);
  mlir::FailureOr<mlir::scf::ForOp>
  buildReverse(mlir::Value trips, llvm::ArrayRef<mlir::Value> cotangents);
  mlir::LogicalResult fillReverse(mlir::scf::ForOp loop);
  mlir::scf::ForOp appendCaptures(mlir::scf::ForOp loop);
  /// The loop with more carried values, whose next values are still missing.
  mlir::scf::ForOp extend(mlir::scf::ForOp loop, mlir::ValueRange inits);

  mlir::FailureOr<llvm::SmallVector<mlir::Value>>
  recoverBackwards(mlir::scf::ForOp loop, mlir::Value trips,
                   llvm::ArrayRef<unsigned> needed);

  // ClosedForms.cpp: states by a formula.
  /// The state in some iteration; null if there is no formula.
  mlir::Value closedForm(unsigned state, mlir::Value number);
  bool hasClosedForm(unsigned state);
  mlir::Value findStep(unsigned state, bool &isNegative);
  llvm::SmallVector<unsigned> resolveFree();

  // RecoveryInRegisters.cpp: states that the reverse loop carries.
  bool hasFreeOrder(mlir::scf::ForOp loop);
  struct Inverses {
    llvm::SmallVector<unsigned> states;
    /// The states after an iteration, and before it.
    llvm::SmallVector<mlir::Value> after, before;
  };
  mlir::LogicalResult carryAlong(mlir::scf::ForOp &loop,
                                 llvm::ArrayRef<unsigned> needed);
  mlir::FailureOr<Inverses> findInverses(llvm::ArrayRef<unsigned> needed);
  mlir::FailureOr<llvm::SmallVector<mlir::Value>>
  solve(llvm::ArrayRef<unsigned> states, mlir::ValueRange after);
  void carryBackwards(mlir::scf::ForOp &loop, const Inverses &inverses,
                      llvm::ArrayRef<unsigned> needed);
  void startBackwards(mlir::scf::ForOp loop, llvm::ArrayRef<unsigned> states,
                      mlir::ValueRange last);

  // Recovery.cpp: states from scratch memory.
  /// States that the next values of `states` are made of, those included, in
  /// order, except for those with a closed form.
  llvm::SmallVector<unsigned> closure(llvm::ArrayRef<unsigned> states);
  void recoverStates(mlir::Value number, llvm::ArrayRef<unsigned> states,
                     mlir::ValueRange values);
  mlir::FailureOr<llvm::SmallVector<mlir::Value>>
  advance(mlir::Value from, mlir::Value to, llvm::ArrayRef<unsigned> states,
          mlir::ValueRange values,
          llvm::function_ref<void(mlir::Value number)> visit);
  mlir::LogicalResult checkKept(llvm::ArrayRef<unsigned> states);
  bool fitsTape(int64_t trips, mlir::Type number,
                llvm::ArrayRef<unsigned> needed);
  bool fitsTape(mlir::Value trips, llvm::ArrayRef<unsigned> needed);
  bool fitsCountedTape(mlir::Value trips, llvm::ArrayRef<unsigned> needed);
  void recoverFromCountedTape(mlir::scf::ForOp loop, mlir::Value trips,
                              llvm::ArrayRef<unsigned> needed);
  mlir::LogicalResult recoverFromTape(mlir::scf::ForOp loop, mlir::Value trips,
                                      llvm::ArrayRef<unsigned> needed);
  mlir::Value bindNumber(mlir::scf::ForOp loop, mlir::Value end);
  mlir::Value isMade(mlir::Value number);
  void skipOthers(mlir::scf::ForOp loop, mlir::Value number);
  int64_t bytesOf(llvm::ArrayRef<unsigned> states);
  llvm::SmallVector<mlir::Value> makeScratch(llvm::ArrayRef<unsigned> states,
                                             int64_t slots);
  llvm::SmallVector<mlir::Value> load(mlir::ValueRange memory,
                                      mlir::Value slot);
  void loadNeeded(llvm::ArrayRef<unsigned> needed, mlir::ValueRange memory,
                  mlir::Value slot);

  // Checkpoints.cpp: states from memory of a fixed size.
  Checkpoints planCheckpoints(llvm::ArrayRef<unsigned> needed);
  int64_t checkpointBytes(llvm::ArrayRef<unsigned> needed, mlir::Type number);
  mlir::FailureOr<llvm::SmallVector<mlir::Value>>
  recoverFromCheckpoints(mlir::scf::ForOp loop, mlir::Value trips,
                         llvm::ArrayRef<unsigned> needed);
  mlir::LogicalResult fillSegments(mlir::scf::ForOp loop,
                                   mlir::ValueRange carried,
                                   const Checkpoints &memory);

  // GlobalTape.cpp: states from memory that the runtime allocates.
  bool fitsGlobalTape(llvm::ArrayRef<unsigned> states);
  mlir::LogicalResult recoverFromGlobalTape(mlir::scf::ForOp loop,
                                            mlir::Value trips,
                                            llvm::ArrayRef<unsigned> needed);
  /// Loops within this one, which needs states from memory itself, have no
  /// part in a tape.
  void keepTapesOut();

  /// States that get cotangents, in the order of the reverse loop's arguments.
  llvm::SmallVector<unsigned> active;
  /// States that it carries backwards, after the cotangents and captures.
  llvm::SmallVector<unsigned> inverted;
  /// Stand for the number of the iteration and for its states while the
  /// reverse loop is built.
  mlir::Value number;
  llvm::SmallVector<mlir::Value> placeholders;
  ReverseBuilder::Captures captures;
  /// The trips of the thread, where loops run for those of all that are in step
  /// with it; else null.
  mlir::Value ownTrips;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_LOOPREVERSAL_H
