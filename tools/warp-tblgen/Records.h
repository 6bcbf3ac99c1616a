//===- Records.h - The registry's records as the back ends see them -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Reads every record of a builtin, checks it, and sorts by Python name. All
// back ends start from this list, so what is wrong with a record is reported
// once, at the record.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TBLGEN_RECORDS_H
#define WARP_TBLGEN_RECORDS_H

#include "CallSignature.h"

#include "WarpDialect/Signature.h"

#include "llvm/TableGen/Record.h"

namespace warp::tblgen {

/// One name under `warp`.
struct Builtin {
  const llvm::Record *record;
  llvm::StringRef pythonName, symbol, group, summary;
  std::vector<llvm::StringRef> overloads;
  /// The overloads, parsed; empty for a special name.
  std::vector<Signature> signatures;
  /// Name of the operation and of its C++ class; empty for a special name.
  std::string opName, className;
  /// The module of warp._src with the function, if it is a library function.
  llvm::StringRef module;
  /// The kind of the handle that its first parameter is, if it is one.
  llvm::StringRef handle;
  /// The kind of the derivative and its name in the documentation.
  llvm::StringRef derivativeKind = "None", derivative;
  std::vector<llvm::StringRef> domain, smoothDomain;
  /// The parsed overloads of a special name with a call.
  std::vector<CallSignature> callSignatures;

  bool isSpecial() const { return opName.empty(); }
  bool isLibraryFunction() const { return !module.empty(); }
  bool isDifferentiable() const { return derivativeKind == "Function"; }
};

std::vector<Builtin> readBuiltins(const llvm::RecordKeeper &records);

/// A name that the package imports.
struct PublicName {
  std::string name, module, attribute;
  /// Imported when it is first asked for: for type checkers only it stands in
  /// the package's file.
  bool isLazy;

  /// True for `from warp import name`.
  bool isModule() const { return module == "warp"; }
};

/// The names that the file of option --public-names imports, in its order.
std::vector<PublicName> readPublicNames();

/// Groups in the order of their first record, which is the reading order.
std::vector<llvm::StringRef> getGroups(const llvm::RecordKeeper &records);

/// The overloads as users read them, each starting with the name.
std::vector<std::string> getDisplayedOverloads(const Builtin &builtin);

/// Text between quotes, escaped for C++ and Python alike.
std::string quote(llvm::StringRef text);

} // namespace warp::tblgen

#endif // WARP_TBLGEN_RECORDS_H
