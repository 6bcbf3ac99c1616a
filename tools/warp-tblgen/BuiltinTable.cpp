//===- BuiltinTable.cpp - The registry's table for C++ --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/TableGenBackend.h"

using namespace llvm;
using namespace warp::tblgen;

static void emitBuiltinTable(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("Builtins, sorted by Python name", os, records);
  std::vector<Builtin> builtins = readBuiltins(records);
  llvm::erase_if(builtins, std::mem_fn(&Builtin::isLibraryFunction));
  for (const Builtin &builtin : builtins) {
    os << "static constexpr llvm::StringLiteral overloadsOf_"
       << builtin.pythonName << "[] = {\n";
    for (StringRef overload : builtin.overloads)
      os << "    " << quote(overload) << ",\n";
    os << "};\n";
  }
  os << "\nstatic constexpr warp::BuiltinSpec builtinTable[] = {\n";
  for (const Builtin &builtin : builtins)
    os << "    {" << quote(builtin.pythonName) << ", " << quote(builtin.symbol)
       << ", " << quote(builtin.opName) << ", " << quote(builtin.group)
       << ",\n     " << quote(builtin.summary) << ",\n     overloadsOf_"
       << builtin.pythonName
       << ", warp::DerivativeKind::" << builtin.derivativeKind << ", "
       << (builtin.isSpecial() ? "true" : "false") << "},\n";
  os << "};\n";
}

/// How each operation is lowered, for warp-lower-composites to include.
static void emitLowerings(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("How builtins become scalar operations", os, records);
  os << "// WARP_ELEMENTWISE(Op, FloatOp, SignedOp, UnsignedOp): per "
        "component, `void` where\n"
        "//   there is none.\n"
        "// WARP_BY_FUNCTION(Op): by the C++ function lower<Op without "
        "suffix>.\n\n"
        "#ifndef WARP_ELEMENTWISE\n"
        "#define WARP_ELEMENTWISE(Op, FloatOp, SignedOp, UnsignedOp)\n"
        "#endif\n"
        "#ifndef WARP_BY_FUNCTION\n"
        "#define WARP_BY_FUNCTION(Op)\n"
        "#endif\n\n";
  auto operation = [](const Record *lowering, StringRef field) {
    StringRef name = lowering->getValueAsString(field);
    return name.empty() ? std::string("void") : ("::mlir::" + name).str();
  };
  for (const Builtin &builtin : readBuiltins(records)) {
    if (builtin.isSpecial())
      continue;
    const Record *lowering = builtin.record->getValueAsDef("lowering");
    if (lowering->isSubClassOf("Elementwise"))
      os << "WARP_ELEMENTWISE(" << builtin.className << ", "
         << operation(lowering, "onFloat") << ", "
         << operation(lowering, "onSigned") << ", "
         << operation(lowering, "onUnsigned") << ")\n";
    else
      os << "WARP_BY_FUNCTION("
         << StringRef(builtin.className).drop_back(strlen("Op")) << ")\n";
  }
  os << "\n#undef WARP_ELEMENTWISE\n#undef WARP_BY_FUNCTION\n";
}

static TableGen::Emitter::Opt table("gen-builtin-table", emitBuiltinTable,
                                    "Generate the C++ table of builtins");
static TableGen::Emitter::Opt lowerings("gen-lowerings", emitLowerings,
                                        "Generate the lowerings as X-macros");
