//===- DeviceFunctions.cpp - Device functions for C++ and Python ----------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceRecords.h"
#include "Records.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/TableGenBackend.h"

using namespace llvm;
using namespace warp::tblgen;

//===----------------------------------------------------------------------===//
// The table that lib/Dialect/LibraryOps.cpp searches
//===----------------------------------------------------------------------===//

static void emitTable(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("Functions of the device library", os, records);
  for (const DeviceFunction &function : readDeviceFunctions(records))
    os << "{" << quote(function.symbol) << ", " << quote(function.letters())
       << ", " << quote(function.results) << ", " << function.registers << ", "
       << function.shared
       << ", warp::LibraryFunction::Assembly::" << function.assembly << ", "
       << (function.isProduct ? "true" : "false") << ", "
       << (function.findsSlot ? "true" : "false") << "},\n";
}

//===----------------------------------------------------------------------===//
// Prototypes for lib/DeviceLib
//===----------------------------------------------------------------------===//

/// A scalar type in C++ without names of its own.
static StringRef getPlainType(char letter) {
  return letter == 'i'   ? "int"
         : letter == 'f' ? "float"
         : letter == 'd' ? "double"
                         : "unsigned long long";
}

/// The type of a struct's member.
static StringRef getMemberType(StringRef type) {
  return type == "i32"   ? "int"
         : type == "u64" ? "unsigned long long"
         : type == "f32" ? "float"
         : type == "f64" ? "double"
                         : type;
}

static void emitPrototype(const DeviceFunction &function, raw_ostream &os) {
  os << "void " << function.symbol << "(";
  for (const DeviceOperand &operand : function.operands)
    os << getPlainType(operand.letter) << " " << operand.name << ", ";
  if (!function.resultStruct.empty())
    os << "warp::geometry::" << function.resultStruct;
  else
    os << (function.results.empty() ? "void"
                                    : getPlainType(function.results.front()));
  os << " *result);\n";
}

/// Results of lanes are all of one type.
static void emitLanesPrototype(const DeviceFunction &function,
                               raw_ostream &os) {
  os << "void " << function.symbol << "_lanes(";
  for (auto [i, operand] : enumerate(function.operands)) {
    bool isShared = int(i) < function.shared;
    os << (isShared ? "" : "const ") << getPlainType(operand.letter)
       << (isShared ? " " : " *") << operand.name << ", ";
  }
  os << "int lanes, " << getPlainType(function.results.front())
     << " *result);\n";
}

static void emitHeader(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("Prototypes of the device library", os, records);
  os << "#ifndef WARP_DEVICELIB_PROTOTYPES_H\n"
        "#define WARP_DEVICELIB_PROTOTYPES_H\n\n"
        "namespace warp::geometry {\n\n";
  for (const HandleKind &kind : readHandleKinds(records))
    os << "constexpr unsigned long long kindOf" << kind.name << " = "
       << kind.number << ";\n";
  for (const ResultStruct &made : readResultStructs(records)) {
    os << "\nstruct " << made.name << " {\n";
    for (const StructMember &member : made.members) {
      os << "  " << getMemberType(member.type) << " " << member.name;
      if (member.count != 1)
        os << "[" << member.count << "]";
      os << ";\n";
    }
    os << "};\n";
  }
  os << "\n} // namespace warp::geometry\n\nextern \"C\" {\n";
  std::vector<DeviceFunction> functions = readDeviceFunctions(records);
  for (const DeviceFunction &function : functions)
    if (function.hasPrototype())
      emitPrototype(function, os);
  os << "#ifndef WARP_GPU\n";
  for (const DeviceFunction &function : functions)
    if (function.shared >= 0)
      emitLanesPrototype(function, os);
  os << "#endif\n} // extern \"C\"\n\n#endif // WARP_DEVICELIB_PROTOTYPES_H\n";
}

//===----------------------------------------------------------------------===//
// Handle kinds
//===----------------------------------------------------------------------===//

static void emitKinds(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("Kinds of handles and layouts of slots", os, records);
  os << "// WARP_HANDLE_KIND(Kind, number)\n"
        "// WARP_HANDLE_BASE(Kind, Base): one of Kind is accepted for Base.\n"
        "// WARP_SLOT_FIELD(Kind, Form, name, word, elementSize, isReadOnly): "
        "Form is\n"
        "//   Number, Pointer or Array.\n\n"
        "#ifndef WARP_HANDLE_KIND\n#define WARP_HANDLE_KIND(...)\n#endif\n"
        "#ifndef WARP_HANDLE_BASE\n#define WARP_HANDLE_BASE(...)\n#endif\n"
        "#ifndef WARP_SLOT_FIELD\n#define WARP_SLOT_FIELD(...)\n#endif\n\n";
  for (const HandleKind &kind : readHandleKinds(records)) {
    os << "WARP_HANDLE_KIND(" << kind.name << ", " << kind.number << ")\n";
    for (StringRef base : kind.bases)
      os << "WARP_HANDLE_BASE(" << kind.name << ", " << base << ")\n";
    for (const SlotField &field : kind.fields)
      os << "WARP_SLOT_FIELD(" << kind.name << ", " << field.form << ", "
         << field.name << ", " << field.word << ", " << field.elementSize
         << ", " << (field.isReadOnly ? "true" : "false") << ")\n";
  }
  os << "\n#undef WARP_HANDLE_KIND\n#undef WARP_HANDLE_BASE\n"
        "#undef WARP_SLOT_FIELD\n";
}

//===----------------------------------------------------------------------===//
// Python
//===----------------------------------------------------------------------===//

static StringRef getStandardType(char letter) {
  return letter == 'i'   ? "int32_t"
         : letter == 'f' ? "float"
         : letter == 'd' ? "double"
                         : "uint64_t";
}

/// For C++ snippets of users, which take structs of results apart themselves.
static void emitDeclarations(ArrayRef<DeviceFunction> functions,
                             raw_ostream &os) {
  os << "DECLARATIONS = \"\"\"extern \"C\" {\n";
  for (const DeviceFunction &function : functions) {
    if (!function.hasPrototype() ||
        StringRef(function.symbol).starts_with("warp_tile_"))
      continue;
    os << "void " << function.symbol << "(";
    for (const DeviceOperand &operand : function.operands)
      os << getStandardType(operand.letter) << " " << operand.name << ", ";
    os << (function.resultStruct.empty()
               ? getStandardType(function.results.front())
               : "void")
       << " *result);\n";
  }
  os << "}\n\"\"\"\n";
}

static void emitPython(const RecordKeeper &records, raw_ostream &os) {
  os << R"("""Handle kinds and device functions. Generated by warp-tblgen from the compiler's registry.

`KINDS[kind]` is the number of a kind of handles, `WORDS[kind]` the words of its slot by name, and
`DECLARATIONS` declares the functions of the device library for C++.
"""

)";
  std::vector<HandleKind> kinds = readHandleKinds(records);
  os << "KINDS = {\n";
  for (const HandleKind &kind : kinds)
    os << "    " << quote(kind.name) << ": " << kind.number << ",\n";
  os << "}\n\nWORDS = {\n";
  for (const HandleKind &kind : kinds) {
    os << "    " << quote(kind.name) << ": {\n";
    for (const SlotField &field : kind.fields)
      os << "        " << quote(field.name) << ": " << field.word << ",\n";
    os << "    },\n";
  }
  os << "}\n\n";
  emitDeclarations(readDeviceFunctions(records), os);
}

static TableGen::Emitter::Opt table("gen-library-functions", emitTable,
                                    "Generate the table of device functions");
static TableGen::Emitter::Opt
    header("gen-library-header", emitHeader,
           "Generate the prototypes of device functions");
static TableGen::Emitter::Opt kinds("gen-handle-kinds", emitKinds,
                                    "Generate the handle kinds as X-macros");
static TableGen::Emitter::Opt python("gen-device-table", emitPython,
                                     "Generate the Python table of handles");
