//===- Docs.cpp - The reference of the builtins ---------------------------===//

#include "Records.h"

#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/TableGenBackend.h"

using namespace llvm;
using namespace warp::tblgen;

static constexpr StringLiteral header = R"(# Builtins

<!-- Written by warp-tblgen from include/WarpDialect/*.td; edit those files. -->

What a kernel can call, as `wp.<name>`. The signs of operators are written beside their names.

In the signatures, a capital letter stands for one type throughout: `S` and `T` for any number, `F` and `G`
for any float, `I` and `J` for any integer, `A` and `B` for any value; a small letter stands for one extent.
`vec<n, S>` is a vector of `n` numbers, `mat<r, c, S>` a matrix, `quat<F>` a quaternion, `transform<F>` a rigid
transform. A function changes the variable that is passed for an `inout` parameter. Integers and floats do not
mix: write `float(i)`.

)";

static std::string getAnchor(StringRef group) {
  std::string anchor;
  for (char c : group.lower())
    anchor += c == ' ' ? '-' : c;
  return anchor;
}

static void emitBuiltin(const Builtin &builtin, raw_ostream &os) {
  os << "\n### " << builtin.pythonName;
  if (!builtin.symbol.empty())
    os << " `" << builtin.symbol << "`";
  os << "\n\n";
  os << builtin.summary << ".";
  if (!builtin.isSpecial() && builtin.derivative != "differentiable")
    os << " Derivative: " << builtin.derivative << ".";
  os << "\n\n```python\n";
  for (const std::string &overload : getDisplayedOverloads(builtin))
    os << overload << "\n";
  os << "```\n";
}

static void emitDocs(const RecordKeeper &records, raw_ostream &os) {
  std::vector<Builtin> builtins = readBuiltins(records);
  std::vector<StringRef> groups = getGroups(records);
  os << header;
  for (StringRef group : groups) {
    os << "- [" << group << "](#" << getAnchor(group) << "):";
    StringRef separator = " ";
    for (const Builtin &builtin : builtins)
      if (builtin.group == group) {
        os << separator << "`" << builtin.pythonName << "`";
        separator = ", ";
      }
    os << "\n";
  }
  for (StringRef group : groups) {
    os << "\n## " << group << "\n";
    for (const Builtin &builtin : builtins)
      if (builtin.group == group)
        emitBuiltin(builtin, os);
  }
}

static TableGen::Emitter::Opt docs("gen-docs", emitDocs,
                                   "Generate the reference of the builtins");
