//===- RulesByFunction.h - Derivative rules in C++ --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// If the record of a builtin says `RuleByFunction`, two functions must exist
// in one of the files RulesOf*.cpp. They get what `pullback` and `pushforward`
// of Rules.h get, and return as much.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TRANSFORMS_AUTODIFF_RULESBYFUNCTION_H
#define WARP_TRANSFORMS_AUTODIFF_RULESBYFUNCTION_H

#include "Rules.h"

namespace warp::autodiff {

/// The operands and results of a rule.
struct RuleInput {
  mlir::Operation *op;
  mlir::ValueRange operands, results;
  /// Cotangents of the results, or tangents of the operands; null for zero.
  llvm::ArrayRef<mlir::Value> seeds;
  /// Operands whose cotangents are asked for; all for tangents.
  llvm::ArrayRef<bool> wanted;
};

using RuleFunction = llvm::SmallVector<mlir::Value> (*)(RuleContext &,
                                                        const RuleInput &);

#define WARP_RULE_BY_FUNCTION(Name)                                            \
  llvm::SmallVector<mlir::Value> pullback##Name(RuleContext &context,          \
                                                const RuleInput &input);       \
  llvm::SmallVector<mlir::Value> pushforward##Name(RuleContext &context,       \
                                                   const RuleInput &input);
#include "WarpDialect/Derivatives.inc"

} // namespace warp::autodiff

#endif // WARP_TRANSFORMS_AUTODIFF_RULESBYFUNCTION_H
