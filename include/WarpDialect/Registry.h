//===- Registry.h - Registry of builtins ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The TableGen records of the builtins, as data. A record's overloads are
// matched against operand types in one place, `matchBuiltin`; the builder, the
// verifier of operations and the error messages all use it.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_REGISTRY_H
#define WARPDIALECT_REGISTRY_H

#include "mlir/IR/TypeRange.h"
#include "mlir/IR/ValueRange.h"

#include <optional>
#include <string>

namespace mlir {
class OpBuilder;
} // namespace mlir

namespace warp {

/// The derivative of a builtin: none, zero almost everywhere, or a function
/// of the operands.
enum class DerivativeKind { None, Zero, Function };

/// One TableGen record. Records are static and compared by address.
struct BuiltinSpec {
  /// Name under `warp` in Python; operators are named after their method.
  llvm::StringLiteral pythonName;
  /// The sign of an operator, such as `+`; otherwise empty.
  llvm::StringLiteral symbol;
  /// Full name of the operation; empty for what the front end expands.
  llvm::StringLiteral opName;
  llvm::StringLiteral group;
  llvm::StringLiteral doc;
  llvm::ArrayRef<llvm::StringLiteral> overloads;
  DerivativeKind derivative;
  /// The overloads are only for display: the operation has its own rules.
  bool isSpecial;
};

/// Every record, sorted by Python name.
llvm::ArrayRef<BuiltinSpec> getBuiltins();

/// The record of a Python name, or null.
const BuiltinSpec *lookupBuiltin(llvm::StringRef pythonName);

/// The record of an operation, or null.
const BuiltinSpec *lookupBuiltinOp(llvm::StringRef opName);

/// A fit of operand types to an overload.
struct BuiltinMatch {
  /// Index of the overload in the record.
  unsigned overload = 0;
  /// Types of the results, those of `inout` operands last.
  llvm::SmallVector<mlir::Type, 2> results;
  /// Positions of the `inout` operands.
  llvm::SmallVector<unsigned, 1> inout;
  /// Values of operands that were left out, and their types.
  llvm::SmallVector<mlir::TypedAttr, 1> defaults;
};

/// Finds the first overload that takes operands of these types. On failure
/// `why`, if given, gets a text of several lines for the user: what was
/// passed, what is accepted and, where there is one, the fix.
std::optional<BuiltinMatch> matchBuiltin(const BuiltinSpec &spec,
                                         mlir::MLIRContext *context,
                                         mlir::TypeRange operands,
                                         std::string *why = nullptr);

/// Creates the operation of a builtin, result types inferred and defaults
/// added. Operands that fit no overload are reported at `location`, and null
/// is returned.
mlir::Operation *createBuiltin(mlir::OpBuilder &builder,
                               mlir::Location location, const BuiltinSpec &spec,
                               mlir::ValueRange operands);
mlir::Operation *createBuiltin(mlir::OpBuilder &builder,
                               mlir::Location location,
                               llvm::StringRef pythonName,
                               mlir::ValueRange operands);

/// Verifies an operation against its record.
llvm::LogicalResult verifyBuiltin(mlir::Operation *op, const BuiltinSpec &spec);

} // namespace warp

#endif // WARPDIALECT_REGISTRY_H
