//===- Signature.h - Overloads of builtins as data --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The parsed form of an overload string such as
// `(a: vec<n,F>, b: vec<n,F>) -> F`; WarpBuiltinBase.td explains the language.
// Both the registry and warp-tblgen read overloads through this parser.
//
//===----------------------------------------------------------------------===//

#ifndef WARPDIALECT_SIGNATURE_H
#define WARPDIALECT_SIGNATURE_H

#include "llvm/ADT/StringRef.h"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace warp {

/// A type, or the types that a letter may stand for.
struct TypePattern {
  enum class Kind {
    AnyValue,
    AnyNumber,
    AnyFloat,
    AnyInteger,
    Scalar,
    Vec,
    Mat,
    Quat,
    Transform,
    Array,
  };
  /// A number, or a letter that stands for one.
  struct Extent {
    char letter = 0;
    int64_t number = 0;
  };
  enum class Base { Bool, Signed, Unsigned, Float, BFloat };

  Kind kind = Kind::AnyValue;
  /// The name of an Any kind.
  char letter = 0;
  /// The type of a scalar.
  Base base = Base::Bool;
  unsigned width = 1;
  /// Length of a vector, rows and columns of a matrix, rank of an array.
  std::vector<Extent> extents;
  /// The one element type of a composite or array.
  std::vector<TypePattern> element;
};

struct Parameter {
  std::string name;
  TypePattern type;
  bool isInout = false;
  /// Text of the default value; empty if there is none.
  std::string defaultValue;
};

struct Signature {
  std::vector<Parameter> parameters;
  std::vector<TypePattern> results;
};

/// Parses an overload; on failure `error` says what was expected and where.
std::optional<Signature> parseSignature(llvm::StringRef text,
                                        std::string &error);

/// The language's text of a type, with scalars by their Python names.
std::string printPattern(const TypePattern &pattern);
/// The overload of a function, as documentation and errors show it.
std::string printSignature(llvm::StringRef name, const Signature &signature);

} // namespace warp

#endif // WARPDIALECT_SIGNATURE_H
