//===- CallSignature.h - Signatures that the front end binds ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The parsed form of an overload of a `Warp_Special` with a call, such as
// `(A: inout tile<F,[N,N]>, fill_mode: 'lower'|'upper' = 'lower') -> None`;
// WarpBuiltinBase.td explains the language. Expressions of the record become
// Python functions of the parameters, in which every other name is a field of
// `call`, the state of the call.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TBLGEN_CALLSIGNATURE_H
#define WARP_TBLGEN_CALLSIGNATURE_H

#include "llvm/ADT/StringRef.h"

#include <optional>
#include <string>
#include <vector>

namespace warp::tblgen {

/// `name<arguments>`; a list of extents has the name `[]`, a choice of strings
/// the name `|`, and a string its quotes.
struct CallType {
  std::string name;
  std::vector<CallType> arguments;
};

struct CallParameter {
  std::string name;
  CallType type;
  bool isInout = false, isVariadic = false, isKeywordOnly = false;
  /// Python's text of the default value; empty if there is none.
  std::string defaultValue;
};

struct CallSignature {
  std::vector<CallParameter> parameters;
  /// Letters that the types of parameters bind, in order.
  std::vector<std::string> letters;

  /// False if the result is None.
  bool hasResult = true;

  bool hasName(llvm::StringRef name) const;
};

/// Parses an overload; on failure `error` says what was expected and where.
std::optional<CallSignature> parseCallSignature(llvm::StringRef text,
                                                std::string &error);

/// The text of a Python expression with `call.` before each name that is called
/// or has a field taken and is neither in the signature nor Python's own; sets
/// `unknown` to any other name.
std::string qualifyNames(llvm::StringRef expression,
                         const CallSignature &signature, std::string &unknown);

/// The type of a parameter, and that of the result of an overload, as a type
/// checker of Python sees it.
std::string getAnnotation(const CallType &type);
std::string getResultAnnotation(llvm::StringRef overload);

} // namespace warp::tblgen

#endif // WARP_TBLGEN_CALLSIGNATURE_H
