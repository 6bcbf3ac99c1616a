//===- Forms.h - Affine forms of integers -----------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// An index is mostly a sum: of thread indices, trips of loops, extents and
// arguments, times constants or one another. Two indices are compared, told
// apart or bounded by comparing such sums.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_ANALYSIS_FORMS_H
#define WARP_LIB_ANALYSIS_FORMS_H

#include "mlir/IR/AsmState.h"
#include "mlir/IR/Value.h"

#include "llvm/ADT/DenseMap.h"

#include <memory>
#include <optional>

namespace warp {

/// A symbol of a form: an integer that is not decomposed.
struct Symbol {
  enum class Kind : uint8_t {
    /// Index of the thread in dimension `number` of the launch.
    Thread,
    /// Iterations that the loop `key` has finished.
    Trip,
    /// Extent `number` of the array `key`, which is no view that has the
    /// extents of another array.
    Extent,
    /// Any other value, `key`.
    Opaque,
  };
  Kind kind = Kind::Opaque;
  unsigned number = 0;
  void *key = nullptr;

  static Symbol thread(unsigned dim) { return {Kind::Thread, dim, nullptr}; }
  static Symbol trip(mlir::Operation *loop) { return {Kind::Trip, 0, loop}; }
  static Symbol opaque(mlir::Value value) {
    return {Kind::Opaque, 0, value.getAsOpaquePointer()};
  }
  /// The array of an extent, the value of an opaque symbol; null for others.
  mlir::Value getValue() const;
  /// The loop of a trip number; null for others.
  mlir::Operation *getLoop() const;
  /// True if the symbol is one value for as long as the region is executed.
  bool isDefinedOutside(mlir::Operation *op) const;
  bool operator==(const Symbol &other) const {
    return kind == other.kind && number == other.number && key == other.key;
  }
};

/// A number times a product of symbols.
struct Term {
  int64_t factor;
  llvm::SmallVector<Symbol, 2> product;

  bool has(Symbol symbol) const { return llvm::is_contained(product, symbol); }
  bool isLike(const Term &other) const;
};

/// constant + sum of terms, modulo two to the number of bits of the value that
/// it stands for. Terms differ in their products, and no factor is zero.
class Form {
public:
  static constexpr size_t maxTerms = 6, maxFactors = 3;

  Form() = default;
  explicit Form(int64_t constant) : constant(constant) {}
  explicit Form(Symbol symbol) : terms{Term{1, {symbol}}} {}

  int64_t constant = 0;
  llvm::SmallVector<Term, 2> terms;
  /// False if the value is this only if no sum on the way to it left the range
  /// of its type. An index may be taken to be so: beyond it is out of bounds.
  bool isExact = true;

  std::optional<int64_t> getConstant() const;
  /// The only symbol, if the form is nothing else.
  std::optional<Symbol> getSymbol() const;
  bool has(Symbol symbol) const;
  bool isDefinedOutside(mlir::Operation *op) const;
  /// The factor of the symbol; none if it is also in a product with
  /// itself.
  std::optional<Form> coefficientOf(Symbol symbol) const;
  /// The terms without the symbol.
  Form without(Symbol symbol) const;
  /// The largest number that divides the value, whatever the symbols are; 0 if
  /// the value is 0.
  uint64_t getDivisor() const;

  /// A sum with too many terms has no form.
  std::optional<Form> operator+(const Form &other) const;
  std::optional<Form> operator-(const Form &other) const;
  std::optional<Form> operator*(const Form &other) const;
  /// True if the values are equal where the symbols are.
  bool equals(const Form &other) const;
  /// Takes numbers modulo two to the number of bits, as signed ones.
  Form reduced(unsigned bits) const;

  void print(llvm::raw_ostream &stream, mlir::AsmState &names) const;

private:
  bool add(const Form &other, int64_t factor);
};

/// Finds forms, each once. Ask a new one after a change of the program.
class Forms {
public:
  /// The form of an integer, or of a constant boolean. A
  /// counter of a loop, and a value that every iteration adds the same to, are
  /// sums with the loop's trips.
  const Form &of(mlir::Value value);
  /// How often the body of a `scf.for` runs, if it does: the step must be
  /// constant and divide what it goes through.
  std::optional<Form> countTrips(mlir::Operation *loop);

private:
  const Form &raw(mlir::Value value);
  std::optional<Form> combine(mlir::Value value);
  std::optional<Form> combineCast(mlir::Operation *op);
  std::optional<Form> substitute(const Form &form, unsigned bits);
  std::optional<Form> resolveArgument(mlir::BlockArgument argument);
  std::optional<Form> resolveCarried(mlir::Operation *loop, mlir::Value carried,
                                     mlir::Value init, mlir::Value yielded);
  bool isNumber(const Form &form, unsigned bits);
  Form expandPassed(mlir::Operation *loop, const Form &form);

  /// A block argument, and whether the form holds for it as a number, not
  /// only modulo two to the number of its bits.
  struct Resolved {
    Form form;
    bool isNumber;
  };
  const Resolved &resolve(Symbol symbol);

  /// With arguments of blocks as opaque symbols, and what becomes of those.
  llvm::DenseMap<mlir::Value, std::unique_ptr<Form>> raws, forms;
  llvm::DenseMap<void *, std::unique_ptr<Resolved>> resolved;
};

/// The value of an integer constant, through casts.
std::optional<int64_t> getConstantInteger(mlir::Value value);

/// Bits of an integer or index type; 0 for other types.
unsigned getIntegerBits(mlir::Type type);

} // namespace warp

#endif // WARP_LIB_ANALYSIS_FORMS_H
