//===- Docs.cpp - The reference of the builtins ---------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/StringExtras.h"
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

`tile<F, [M, K]>` is a tile of two dimensions, `tile<F, D>` a tile of any shape, `array<k, A>` an array of `k`
dimensions and `value` a value of any type. `shape`, `dtype`, `const` and quoted strings have to be known when the
kernel is compiled. `offsets<a>` stands for one index, or a tuple of them, for the dimensions of parameter `a`;
`axis<a>` for one of these dimensions.

An adjoint says what is added to the gradient of an operand, from the gradient `g` of the result. Behind
`unless` stands where that is singular; zero is added there unless `wp.config.singular` says otherwise. A
builtin whose derivative is by expansion is differentiated like the scalar arithmetic that computes it.

)";

static std::string getAnchor(StringRef group) {
  std::string anchor;
  for (char c : group.lower())
    anchor += c == ' ' ? '-' : c;
  return anchor;
}

/// The adjoints of one overload: `a` += `g * b`, ...
static void emitAdjoints(const warp::Signature &signature,
                         ArrayRef<StringRef> formulas, raw_ostream &os) {
  ListSeparator comma;
  for (auto [formula, parameter] : zip_equal(formulas, signature.parameters))
    if (!formula.empty())
      os << comma << '`' << parameter.name << "` += `" << formula << '`';
}

static void emitDerivative(const Builtin &builtin, raw_ostream &os) {
  const Record *derivative = builtin.record->getValueAsDef("derivative");
  if (!builtin.isDifferentiable()) {
    os << " Derivative: " << builtin.derivative << ".";
    return;
  }
  if (!derivative->isSubClassOf("Formulas")) {
    os << " Derivative: "
       << (derivative->getName() == "Smooth" ? "by expansion"
                                             : "by a rule of its own")
       << ".";
    return;
  }
  const ListInit *adjoints = derivative->getValueAsListInit("adjoints");
  bool perOverload = adjoints->size() > 1;
  os << (perOverload ? " Adjoints:" : " Adjoint: ");
  for (auto [i, entry] : enumerate(*adjoints)) {
    std::vector<StringRef> formulas;
    for (const Init *formula : *cast<ListInit>(entry))
      formulas.push_back(cast<StringInit>(formula)->getValue());
    if (perOverload)
      os << "\n- `" << builtin.overloads[i] << "`: ";
    if (formulas.empty())
      os << "by expansion";
    else
      emitAdjoints(builtin.signatures[i], formulas, os);
  }
  ListSeparator comma;
  std::vector<StringRef> given =
      derivative->getValueAsListOfStrings("given");
  if (!given.empty())
    os << (perOverload ? "\n\nwhere " : " where ");
  for (StringRef definition : given)
    os << comma << '`' << definition << '`';
  if (!perOverload)
    os << ".";
}

static void emitBuiltin(const Builtin &builtin, raw_ostream &os) {
  os << "\n### " << builtin.pythonName;
  if (!builtin.symbol.empty())
    os << " `" << builtin.symbol << "`";
  os << "\n\n";
  os << builtin.summary << ".";
  if (!builtin.isSpecial())
    emitDerivative(builtin, os);
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
