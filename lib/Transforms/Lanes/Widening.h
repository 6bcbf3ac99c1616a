//===- Widening.h - State of thread vectorisation ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// State of warp-widen-threads while it rewrites the body of a thread.
// WidenThreads.cpp decides and walks straight-line code, WidenControlFlow.cpp
// has branches and loops, WidenAccesses.cpp memory and what is done lane by
// lane.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TRANSFORMS_WIDENING_H
#define WARP_LIB_TRANSFORMS_WIDENING_H

#include "LaneCalls.h"

#include "Analysis/ThreadVariance.h"
#include "WarpDialect/WarpOps.h"

#include "mlir/Dialect/Arith/IR/Arith.h"
#include "mlir/Dialect/SCF/IR/SCF.h"
#include "mlir/IR/Builders.h"

namespace warp {
class AgreeOp;
class LibraryCallOp;
class MostTripsOp;

/// Writes the body of a thread, or of a function that threads call, again for
/// several threads.
///
/// A value that all lanes share stays a scalar; one that differs becomes a
/// vector. One that differs by a constant step from lane to lane, and may be an
/// index, is also kept as the scalar of the first lane.
class Widening {
public:
  Widening(mlir::FunctionOpInterface kernel, const ThreadVariance &variance,
           int64_t lanes, const LaneCalls *calls = nullptr)
      : kernel(kernel), variance(variance), lanes(lanes), calls(calls),
        b(kernel->getContext()), loc(kernel->getLoc()) {}

  /// Replaces the threads of the kernel.
  void run(ThreadsOp threads);
  /// Fills in the body of a function for all lanes.
  void run(const LaneFunction &function);

private:
  using Values = llvm::SmallVector<mlir::Value>;

  bool isVarying(mlir::Value value) const {
    return !variance.isUniform(value, Scope::Lanes);
  }
  /// True if a value also has a scalar of the first lane.
  bool hasBase(mlir::Value value) const;

  // The replacement of a value.
  mlir::Value scalar(mlir::Value value) const { return scalars.lookup(value); }
  mlir::Value vector(mlir::Value value);
  void setScalar(mlir::Value value, mlir::Value made) { scalars[value] = made; }
  void setVector(mlir::Value value, mlir::Value made) { vectors[value] = made; }
  /// The forms in which control flow passes a value on: its vector, and its
  /// scalar if it has one.
  void appendForms(mlir::Value like, mlir::Value value, Values &forms);
  llvm::SmallVector<mlir::Type> formTypes(mlir::ValueRange values);
  /// Takes the forms of values from a list, in the order of `appendForms`.
  void takeForms(mlir::ValueRange values, mlir::ValueRange forms);
  void takeResults(mlir::ValueRange arguments, mlir::ValueRange results,
                   mlir::ValueRange forms);

  // WidenThreads.cpp
  void widen(mlir::Block &block);
  void widen(mlir::Operation *op);
  void cloneScalar(mlir::Operation *op);
  void widenElementwise(mlir::Operation *op);
  void widenConversion(mlir::Operation *op);
  void cloneBase(mlir::Operation *op);
  void widenAgree(AgreeOp op);
  void widenMostTrips(MostTripsOp op);
  void widenCall(mlir::func::CallOp op);
  Values contributions(ThreadsOp threads);

  // WidenDivisions.cpp
  void widenDivision(mlir::Operation *op);
  mlir::Value divideInDoubles(mlir::Value x, mlir::Value divisor,
                              bool isSigned);
  mlir::Value divideLong(mlir::Value x, mlir::Value y);

  // WidenControlFlow.cpp
  void widenIf(mlir::scf::IfOp op);
  void widenUniformIf(mlir::scf::IfOp op);
  void flatten(mlir::scf::IfOp op);
  Values widenArm(mlir::scf::IfOp op, mlir::Block *arm, mlir::Value mask);
  void widenFor(mlir::scf::ForOp op);
  mlir::scf::ForOp widenIterations(mlir::scf::ForOp op, mlir::Value begin,
                                   mlir::Value end, int64_t together,
                                   mlir::ValueRange inits);
  void widenDivergentFor(mlir::scf::ForOp op);
  void widenWhile(mlir::scf::WhileOp op);
  void widenDivergentWhile(mlir::scf::WhileOp op);

  // WidenAccesses.cpp
  void widenLoad(LoadComponentsOp op);
  void loadOfRun(LoadComponentsOp op);
  void storeOfRun(StoreComponentsOp op);
  Values indicesOfRun(AccessOp op, int64_t count);
  void widenStore(StoreComponentsOp op);
  void widenUpdate(AtomicComponentsOp op);
  void updateTogether(AtomicComponentsOp op, mlir::ValueRange indices);
  void updateMaybeTogether(AtomicComponentsOp op);
  void updateOneByOne(AtomicComponentsOp op);
  void widenScratch(mlir::Operation *op);
  mlir::Value slotOf(mlir::Value index);
  int64_t unitStride(mlir::Value array, mlir::ValueRange indices,
                     mlir::Block *where);
  void markNeighbours(mlir::Operation *access, mlir::Value array,
                      mlir::ValueRange indices);
  Values accessIndices(mlir::ValueRange indices, LaneForm form);
  llvm::SmallVector<bool> nonNegative(mlir::ValueRange indices,
                                      mlir::Block *where);
  void eachLane(mlir::Operation *op);
  void widenLibraryCall(LibraryCallOp op);

  // Small pieces.
  mlir::VectorType lanesOf(mlir::Type type) const {
    return mlir::VectorType::get(lanes, type);
  }
  mlir::Value splat(mlir::TypedAttr value);
  mlir::Value broadcast(mlir::Value value);
  mlir::Value any(mlir::Value mask);
  mlir::Value both(mlir::Value x, mlir::Value y);
  mlir::Value without(mlir::Value x, mlir::Value y);
  mlir::Value choose(mlir::Value mask, mlir::Value x, mlir::Value y);

  mlir::FunctionOpInterface kernel;
  const ThreadVariance &variance;
  int64_t lanes;
  const LaneCalls *calls;
  mlir::OpBuilder b;
  mlir::Location loc;
  /// The block of the widened threads or function.
  mlir::Block *body = nullptr;
  /// Lanes that run the code at the insertion point; at least one of them.
  mlir::Value mask;
  llvm::DenseMap<mlir::Value, mlir::Value> scalars, vectors;
  /// Loops with several iterations together: how many, and which of them is
  /// written.
  llvm::DenseMap<mlir::Operation *, std::pair<int64_t, int64_t>> together;
  /// For these the results of loads of rows, and what stores of rows have so
  /// far, with the indices of the first.
  llvm::DenseMap<mlir::Operation *, Values> runs, runIndices;
};

} // namespace warp

#endif // WARP_LIB_TRANSFORMS_WIDENING_H
