//===- Rules.h - Derivatives of single operations ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The rules of both modes for one operation: how cotangents of its results
// become cotangents of its operands, and tangents of its operands tangents of
// its results. The derivative of a builtin is a formula in its TableGen record,
// from which warp-tblgen writes Derivatives.inc; Formula.h is what those
// functions are written in. The few operations without a record, which build
// composites and take them apart, have rules in RulesOfComposites.cpp.
//
// A null value is a zero: it costs nothing, and no code is made for it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_RULES_H
#define WARP_TRANSFORMS_AUTODIFF_RULES_H

#include "mlir/IR/Builders.h"
#include "mlir/IR/Operation.h"

#include <functional>

namespace warp::autodiff {

/// The derivative at points where a function has none or an infinite one.
enum class Singular {
  /// Zero, the smallest subgradient.
  Pinned,
  /// The result of IEEE arithmetic for the formula: an infinity or NaN.
  Strict,
  /// Zero, and it is counted where that changes anything.
  Report
};

struct RuleContext {
  mlir::OpBuilder &builder;
  mlir::Location loc;
  Singular singular = Singular::Pinned;
  /// Called with an `i1` that says whether this thread was at a singular point.
  std::function<void(mlir::Value isSingular)> report = nullptr;
  /// True if it matters how vectors of values that repeat, or nearly do, turn
  /// into each other. It does not where products with them are complete
  /// (SpectralProducts.h); then the values may also be told apart.
  bool turnsMatter = true;
  /// Puts a value in the place of a primal result from here on: vectors of
  /// repeated values that suit the direction of a tangent. Null where results
  /// have to stay.
  std::function<void(unsigned result, mlir::Value value)> replace = nullptr;
};

/// Cotangents of the operands, null where not `wanted` or zero. The operands
/// and results are primal values, floats of 16 bits widened to f32; a result
/// that `needsResults` does not ask for may be null. `cotangents` has one entry
/// per result. Fails with a diagnostic at `op` if there is no rule.
llvm::FailureOr<llvm::SmallVector<mlir::Value>>
pullback(RuleContext &context, mlir::Operation *op, mlir::ValueRange operands,
         mlir::ValueRange results, llvm::ArrayRef<mlir::Value> cotangents,
         llvm::ArrayRef<bool> wanted);

/// Tangents of the results, from one tangent per operand.
llvm::FailureOr<llvm::SmallVector<mlir::Value>>
pushforward(RuleContext &context, mlir::Operation *op,
            mlir::ValueRange operands, mlir::ValueRange results,
            llvm::ArrayRef<mlir::Value> tangents);

/// True if the rule of an operation uses its primal results.
bool needsResults(mlir::Operation *op);

/// True if the derivative of an operation is infinite or undefined somewhere.
bool isSingular(mlir::Operation *op);

/// True if a derivative of the operation is other than zero somewhere.
bool isDifferentiable(mlir::Operation *op);

/// True if the operation has a rule, or a derivative of zero; a differentiable
/// builtin without one has to be expanded first.
bool hasRule(mlir::Operation *op);

/// Type of the tangents and cotangents of a value: its own, with floats of 16
/// bits widened to f32. Null for what has none: integers, booleans, arrays.
mlir::Type differentialType(mlir::Type type);

/// The zero of a scalar or composite type.
mlir::Value zero(mlir::OpBuilder &builder, mlir::Location loc, mlir::Type type);

/// True if an atomic minimum or maximum may have left the scalar `value` as
/// `left`: both are equal, or NaN, which is left where nothing else was.
mlir::Value isLeft(mlir::OpBuilder &builder, mlir::Location loc,
                   mlir::Value left, mlir::Value value);

/// A scalar constant.
mlir::Value constant(mlir::OpBuilder &builder, mlir::Location loc,
                     mlir::FloatType type, double number);

/// The sum; null stands for zero.
mlir::Value add(mlir::OpBuilder &builder, mlir::Location loc, mlir::Value a,
                mlir::Value b);

/// The tile of what a function gives for corresponding elements; operands that
/// are no tiles are the same for all.
mlir::Value
mapTiles(mlir::OpBuilder &builder, mlir::Location loc, mlir::ValueRange inputs,
         llvm::function_ref<mlir::Value(mlir::ValueRange)> function);

/// The same for one term of many, whose order is free.
mlir::Value addInAnyOrder(mlir::OpBuilder &builder, mlir::Location loc,
                          mlir::Value sum, mlir::Value term);

/// The value with floats of 16 bits widened, and what they were computed from
/// too; the value itself if there are none.
mlir::Value widen(mlir::OpBuilder &builder, mlir::Location loc,
                  mlir::Value value);

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_RULES_H
