//===- IterationSolver.h - Inversion of loop iterations ---------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_ITERATIONSOLVER_H
#define WARP_TRANSFORMS_AUTODIFF_ITERATIONSOLVER_H

#include "Autodiff/Reverse/Reverse.h"

#include "llvm/ADT/STLFunctionalExtras.h"

namespace warp::autodiff {

/// Finds values of one iteration of a loop from some of them, by code at the
/// insertion point of the builder. IterationSolver.cpp lists the equations.
class IterationSolver {
public:
  /// `trace` says what a value of the loop is a plain copy of.
  IterationSolver(ReverseBuilder &reverse, mlir::Operation *loop,
                  llvm::function_ref<mlir::Value(mlir::Value)> trace)
      : reverse(reverse), b(reverse.builder), loop(loop), trace(trace) {}

  /// Says what stands for a value of the loop.
  void learn(mlir::Value primal, mlir::Value found);
  /// Finds all that follows from what is known.
  mlir::LogicalResult run();
  /// The expression for a value; null if it is not known.
  mlir::Value find(mlir::Value primal);

private:
  mlir::LogicalResult goForward(mlir::Operation *op);
  void goBackward(mlir::Operation *op);
  void solveArithmetic(mlir::Operation *op, mlir::Value result);
  void solveMul(mlir::Operation *op, mlir::Value result);
  void solveXor(mlir::Operation *op, mlir::Value result);
  void solveRotation(mlir::Operation *op, mlir::Value result);
  void solveRandInit(mlir::Operation *op, mlir::Value result);

  template <typename Op> mlir::Value emit(mlir::ValueRange operands);
  mlir::Value constant(mlir::Type type, const llvm::APInt &value);
  mlir::Value constant(mlir::Type type, uint64_t value);
  template <typename Shift>
  mlir::Value undoShiftedXor(mlir::Value value, mlir::Value shift,
                             unsigned smallest);
  mlir::Value undoPcg(mlir::Value state);

  ReverseBuilder &reverse;
  mlir::OpBuilder &b;
  mlir::Operation *loop;
  llvm::function_ref<mlir::Value(mlir::Value)> trace;
  llvm::DenseMap<mlir::Value, mlir::Value> known;
};

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_ITERATIONSOLVER_H
