//===- Formula.h - Formulas of derivatives ----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The language of the `derivative` slot of a record, which is described at
// class `Formulas` in WarpBuiltinBase.td. A formula is parsed to a tree; what
// is wrong with it is reported at its record.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TBLGEN_FORMULA_H
#define WARP_TBLGEN_FORMULA_H

#include "Records.h"

#include "llvm/ADT/STLFunctionalExtras.h"

#include <memory>

namespace warp::tblgen {

/// A node of a formula.
struct FormulaNode {
  enum Kind { Number, Name, Call, Unary, Binary } kind;
  /// The digits, the name, the function, or the sign.
  llvm::StringRef text;
  std::vector<FormulaNode> operands;

  /// Calls `visit` on every node that is a name.
  void forEachName(llvm::function_ref<void(llvm::StringRef)> visit) const;
};

/// One formula with its conditions.
struct Formula {
  FormulaNode value;
  std::optional<FormulaNode> unless, requirement;
  /// The message where the requirement does not hold.
  llvm::StringRef message;

  bool uses(llvm::StringRef name) const;
  /// The condition asks about the cotangent alone: no point is singular, but
  /// the value might be zero times an infinity.
  bool isGuarded() const;
  /// For a guarded product of the cotangent and an operand, that operand.
  llvm::StringRef getFactor() const;
};

/// `name = formula` of a record's `given`.
struct Definition {
  llvm::StringRef name;
  FormulaNode value;
  /// It is of the adjoint alone; a formula for tangents can't use it.
  bool usesCotangent;
};

/// The derivative of a builtin, for every overload.
struct Rule {
  /// Per overload and operand; nothing for a derivative of zero.
  std::vector<std::vector<std::optional<Formula>>> adjoints;
  /// Per overload: `partials`, `substitution` or a formula.
  std::vector<llvm::StringRef> tangents;
  std::vector<std::optional<Formula>> tangentFormulas;
  std::vector<Definition> given;

  bool isExpanded(size_t overload) const { return adjoints[overload].empty(); }
};

/// Reads the formulas of a record and checks every name in them against the
/// operands and against `builtins`. Nothing for a record without formulas.
std::optional<Rule> readRule(const Builtin &builtin,
                             llvm::ArrayRef<Builtin> builtins);

} // namespace warp::tblgen

#endif // WARP_TBLGEN_FORMULA_H
