//===- ThreadVariance.h - Divergence analysis over threads ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_THREADVARIANCE_H
#define WARP_LIB_ANALYSIS_THREADVARIANCE_H

#include "CalledFunctions.h"
#include "Ranges.h"

#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/Interfaces/FunctionInterfaces.h"

#include "llvm/ADT/DenseMap.h"
#include "llvm/ADT/SetVector.h"

#include <optional>

namespace warp {

/// Sets of threads, the largest first.
enum class Scope {
  /// All threads of a launch.
  Launch,
  /// The threads of a block on a GPU, of a range on a CPU.
  Group,
  /// Threads that follow each other in the last dimension: lanes of a vector,
  /// or of a warp that lies in a row. They need not agree with those elsewhere.
  Lanes,
};

/// True if the threads of a set have the same value.
enum class Agreement {
  No,
  /// If they are in the same iteration of the loops around it, and load at the
  /// same moment: lanes of a vector are, those of a warp have to compare.
  InStep,
  Yes,
};

/// An argument of a function that the lanes of a vector call together.
struct LaneArgument {
  /// It differs from lane to lane.
  bool varies = false;
  /// For an array: the launch writes to its memory.
  bool isWritten = false;

  bool operator==(const LaneArgument &other) const {
    return varies == other.varies && isWritten == other.isWritten;
  }
};

/// How the values of a kernel in structured form vary over its threads.
///
/// Thread indices are the results of `warp.tid`, the arguments of the block of
/// `warp.threads`, or in an entry for a GPU what is read from the grid. Values
/// that do not belong to the function have no answer.
class ThreadVariance {
public:
  /// `disjoint`: no array that the kernel writes overlaps another one; by
  /// default what the launch says. `lanes`: the first lane of so many has an
  /// index in the last dimension that is a multiple of that; 0 if it may have
  /// any.
  explicit ThreadVariance(mlir::FunctionOpInterface function,
                          std::optional<bool> disjoint = std::nullopt,
                          int64_t lanes = 0);
  /// The same of a function that lanes call; `anyWrites`: the launch writes to
  /// some array.
  ThreadVariance(mlir::func::FuncOp function,
                 llvm::ArrayRef<LaneArgument> arguments, bool anyWrites);

  /// The largest number of lanes that would share a quotient of the thread
  /// index if the first lane had such an index; 1 if no quotient is shared.
  int64_t getLongestRun() const { return longestRun; }

  Agreement agreement(mlir::Value value, Scope scope) const;
  /// Trips agree if the threads are in the same iteration.
  Agreement agreement(Symbol symbol, Scope scope) const;

  /// True if threads of a set have the same value, for lanes: those that run
  /// the code together.
  bool isUniform(mlir::Value value, Scope scope) const {
    Agreement found = agreement(value, scope);
    return found == Agreement::Yes ||
           (found == Agreement::InStep && scope == Scope::Lanes);
  }

  /// True if it counts when a value is computed: in which iteration, or after
  /// which writes of other threads.
  bool dependsOnMoment(mlir::Value value) const {
    return get(value).sources & Moment;
  }
  /// True if it does because of other threads.
  bool dependsOnWrites(mlir::Value value) const {
    return get(value).sources & Written;
  }

  /// True if the lanes of a warp have the same value if they agree on those
  /// that this adds: counters of loops, and thread indices of the axes y and z.
  /// So that they can compare them, and compute the value again, it takes
  /// nothing but arithmetic to get from those to it.
  bool isUniformIfEqual(mlir::Value value,
                        llvm::SetVector<mlir::Value> &ifEqual) const;

  /// By how much a value grows from iteration to iteration of a loop, if that
  /// is a constant and the rest of it is uniform as above.
  std::optional<int64_t>
  strideIfEqual(mlir::Value value, mlir::scf::ForOp loop,
                llvm::SetVector<mlir::Value> &ifEqual) const;

  /// By how much the value of the next thread in the last dimension is larger,
  /// if that is a constant, for a value that is used as an index: that no sum
  /// wraps is assumed, as the access would be out of bounds. 0 if uniform.
  std::optional<int64_t> step(mlir::Value value) const;

  /// True if these indices tell threads apart by a dimension of the launch: all
  /// are c * thread index + r with the same c, and 0 <= r < |c|. With `mayWrap`
  /// they may all have more terms, the same in all threads and indices.
  bool tellThreadsApart(llvm::ArrayRef<const Form *> indices, unsigned dim,
                        bool mayWrap) const;

  /// True if threads may come to different decisions at a branch, or leave a
  /// loop in different iterations.
  bool isDivergent(mlir::Operation *branchOrLoop,
                   Scope scope = Scope::Lanes) const;

  /// True if an array may be written by the kernel.
  bool isWritten(mlir::Value array) const;
  /// True if it writes to arrays that are no arguments.
  bool hasUnknownWrites() const { return writesUnknown; }
  bool hasWrites() const { return writesUnknown || !written.empty(); }
  /// True if a function reads what the launch may write.
  bool readsWritten(mlir::func::CallOp call) const;
  /// True if a call does the same for all lanes, so that one will do.
  bool isOneCall(mlir::func::CallOp call) const;

  /// An integer as a sum over thread indices, trips, extents and other values.
  const Form &form(mlir::Value value) const { return forms.of(value); }
  Interval range(mlir::Value value, mlir::Block *at = nullptr,
                 Use use = Use::Exact) const {
    return ranges.of(value, at, use);
  }
  /// True if an index does not count from the end, in a block if that helps.
  bool isNonNegative(mlir::Value index, mlir::Block *at) const {
    return ranges.of(index, at, Use::Index).low >= 0;
  }

private:
  /// On what a value depends.
  enum : uint16_t {
    /// Bits 0 to 3: a thread index.
    AnyIndex = 15,
    /// A value that only this thread knows.
    Own = 16,
    /// The iteration, or the moment: the same for threads that run in step.
    Moment = 32,
    /// The place of the group in the launch.
    Place = 64,
    /// A value that other threads may have written; it is also time-varying.
    Written = 128,
    /// The last index without what tells the lanes of a vector apart.
    Run = 256,
  };
  static constexpr int64_t noStep = INT64_MIN;
  struct State {
    uint16_t sources = 0;
    /// The step of the last dimension's index; `noStep` if unknown or not
    /// constant.
    int64_t step = 0;
    bool operator==(const State &other) const {
      return sources == other.sources && step == other.step;
    }
  };

  void collectWrites();
  void propagate();
  void visit(mlir::Region &region);
  void visit(mlir::Operation *op);
  bool visitIndices(mlir::Operation *op);
  void visitIf(mlir::Operation *op);
  void visitFor(mlir::Operation *op);
  void visitWhile(mlir::Operation *op);
  void visitScratch(mlir::Operation *op);
  /// The value that decides if, or how often, the regions of an operation run.
  static llvm::SmallVector<mlir::Value, 3> decisionsOf(mlir::Operation *op);
  State transfer(mlir::Operation *op);
  State transferCall(mlir::func::CallOp call);
  int64_t stepOf(mlir::Operation *op) const;
  int64_t stepOfCast(mlir::Operation *op) const;
  State get(mlir::Value value) const;
  Agreement agreement(uint16_t sources, Scope scope) const;
  int64_t runOf(mlir::Operation *op) const;
  /// Joins; a value that has no state yet takes it over.
  void join(mlir::Value value, State state);
  bool varies(State state) const { return state.sources & (lastIndex | Own); }

  mlir::FunctionOpInterface function;
  mutable CalledFunctions called;
  llvm::DenseMap<mlir::Value, State> states;
  /// Roots of arrays that are written; all if one of them is not known.
  llvm::DenseSet<mlir::Value> written;
  bool writesUnknown = false;
  /// Arguments may overlap, so that a write to one is one to all.
  bool mayOverlap = true;
  uint16_t lastIndex = 1;
  int64_t lanes;
  int64_t longestRun = 1;
  bool changed = false;
  mutable Forms forms;
  mutable Ranges ranges{forms};
};

} // namespace warp

#endif // WARP_LIB_ANALYSIS_THREADVARIANCE_H
