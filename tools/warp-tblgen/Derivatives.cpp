//===- Derivatives.cpp - The rules of differentiation for C++ -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Writes the formulas of the records as functions on warp::autodiff::Expr, for
// lib/Transforms/Autodiff/Rules.cpp to include.
//
//===----------------------------------------------------------------------===//

#include "Formula.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/StringSet.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/TableGenBackend.h"

using namespace llvm;
using namespace warp::tblgen;

//===----------------------------------------------------------------------===//
// Expressions
//===----------------------------------------------------------------------===//

static std::string toCpp(const FormulaNode &node);

static std::string getCall(StringRef name, ArrayRef<FormulaNode> operands) {
  std::string text = ("f.call(\"" + name + "\", {").str();
  ListSeparator comma;
  for (const FormulaNode &operand : operands)
    text += StringRef(comma).str() + toCpp(operand);
  return text + "})";
}

static std::string toCpp(const FormulaNode &node) {
  switch (node.kind) {
  case FormulaNode::Number:
    return ("f.number(" + node.text + ")").str();
  case FormulaNode::Name:
    return node.text.str();
  case FormulaNode::Call:
    return getCall(node.text, node.operands);
  case FormulaNode::Unary:
    return node.text == "not" ? getCall("unot", node.operands)
                              : "-" + toCpp(node.operands[0]);
  case FormulaNode::Binary:
    if (node.text == "and")
      return getCall("bit_and", node.operands);
    if (node.text == "or")
      return getCall("bit_or", node.operands);
    return ("(" + toCpp(node.operands[0]) + " " + node.text + " " +
            toCpp(node.operands[1]) + ")")
        .str();
  }
  llvm_unreachable("unknown kind of node");
}

//===----------------------------------------------------------------------===//
// Functions
//===----------------------------------------------------------------------===//

namespace {

/// Writes the statements that evaluate one formula.
class FormulaWriter {
public:
  FormulaWriter(const Builtin &builtin, const Rule &rule, size_t overload,
                raw_ostream &os)
      : rule(rule), parameters(builtin.signatures[overload].parameters),
        os(os) {}

  void write(const Formula &formula) {
    define(formula.value);
    if (formula.unless)
      define(*formula.unless);
    if (formula.requirement) {
      define(*formula.requirement);
      os << "    f.require(" << toCpp(*formula.requirement) << ",\n"
         << "              " << quote(formula.message) << ");\n";
    }
    std::string value = toCpp(formula.value);
    if (!formula.unless) {
      os << "    return " << value << ";\n";
      return;
    }
    if (StringRef factor = formula.getFactor(); isOperand(factor))
      os << "    if (!f.mayBeInfinite(" << factor << "))\n      return " << value
         << ";\n";
    os << "    return f.unless([&] { return " << toCpp(*formula.unless)
       << "; },\n                    [&] { return " << value << "; }, "
       << (formula.isGuarded() ? "false" : "true") << ");\n";
  }

private:
  bool isOperand(StringRef name) const {
    return any_of(parameters, [&](const warp::Parameter &parameter) {
      return parameter.name == name;
    });
  }

  /// Defines the names that a formula uses, and those that they use.
  void define(const FormulaNode &node) {
    node.forEachName([&](StringRef name) { define(name); });
  }

  void define(StringRef name) {
    if (!defined.insert(name).second)
      return;
    for (const Definition &definition : rule.given)
      if (definition.name == name) {
        define(definition.value);
        os << "    Expr " << name << " = " << toCpp(definition.value) << ";\n";
        return;
      }
    os << "    Expr " << name << " = " << getSource(name) << ";\n";
  }

  std::string getSource(StringRef name) {
    for (auto [i, parameter] : enumerate(parameters)) {
      if (parameter.name == name)
        return "f.operand(" + std::to_string(i) + ")";
      if ("d" + parameter.name == name)
        return "f.tangent(" + std::to_string(i) + ")";
    }
    return name == "g" ? "f.cotangent()" : "f.result()";
  }

  const Rule &rule;
  ArrayRef<warp::Parameter> parameters;
  raw_ostream &os;
  StringSet<> defined;
};

} // namespace

static void emitAdjoint(const Builtin &builtin, const Rule &rule, size_t i,
                        raw_ostream &os) {
  os << "static Expr adjoint_" << builtin.pythonName << "_" << i
     << "(Formula &f, unsigned operand) {\n  switch (operand) {\n";
  for (auto [operand, formula] : enumerate(rule.adjoints[i])) {
    if (!formula)
      continue;
    os << "  case " << operand << ": {\n";
    FormulaWriter(builtin, rule, i, os).write(*formula);
    os << "  }\n";
  }
  os << "  default:\n    return f.number(0);\n  }\n}\n\n";
}

static void emitTangent(const Builtin &builtin, const Rule &rule, size_t i,
                        raw_ostream &os) {
  if (!rule.tangentFormulas[i])
    return;
  os << "static Expr tangent_" << builtin.pythonName << "_" << i
     << "(Formula &f) {\n";
  FormulaWriter(builtin, rule, i, os).write(*rule.tangentFormulas[i]);
  os << "}\n\n";
}

/// True if the derivative is infinite or undefined somewhere. Only such a
/// builtin makes infinities of finite numbers, apart from overflowing products.
static bool isSingular(const Rule &rule, size_t overload) {
  return any_of(rule.adjoints[overload],
                [](const std::optional<Formula> &formula) {
                  return formula && formula->unless &&
                         formula->getFactor().empty();
                });
}

/// True if an adjoint or a tangent uses the result, in itself or in what it is
/// defined by.
static bool usesResult(const Rule &rule, size_t overload) {
  auto uses = [&](const std::optional<Formula> &formula) {
    if (!formula)
      return false;
    if (formula->uses("result"))
      return true;
    return any_of(rule.given, [&](const Definition &definition) {
      return Formula{definition.value, {}, {}, {}}.uses("result");
    });
  };
  return any_of(rule.adjoints[overload], uses) ||
         uses(rule.tangentFormulas[overload]);
}

static void emitEntry(const Builtin &builtin, const Rule &rule, size_t i,
                      raw_ostream &os) {
  std::string suffix = (builtin.pythonName + "_" + Twine(i)).str();
  os << "    {" << quote(builtin.opName) << ", " << i << ", adjoint_" << suffix
     << ", " << (rule.tangentFormulas[i] ? "tangent_" + suffix : "nullptr")
     << ", " << (rule.tangents[i] == "substitution" ? "true" : "false") << ", "
     << (usesResult(rule, i) ? "true" : "false") << ", "
     << (isSingular(rule, i) ? "true" : "false") << "},\n";
}

/// Builtins whose rules are C++ functions.
static void emitByFunction(ArrayRef<Builtin> builtins, raw_ostream &os) {
  os << "#ifdef WARP_RULE_BY_FUNCTION\n";
  for (const Builtin &builtin : builtins)
    if (!builtin.isSpecial() &&
        builtin.record->getValueAsDef("derivative")->getName() ==
            "RuleByFunction")
      os << "WARP_RULE_BY_FUNCTION("
         << StringRef(builtin.className).drop_back(strlen("Op")) << ")\n";
  os << "#undef WARP_RULE_BY_FUNCTION\n#else\n\n";
}

static void emitDerivatives(const RecordKeeper &records, raw_ostream &os) {
  emitSourceFileHeader("Derivatives of builtins", os, records);
  std::vector<Builtin> builtins = readBuiltins(records);
  emitByFunction(builtins, os);
  std::string entries;
  raw_string_ostream table(entries);
  for (const Builtin &builtin : builtins) {
    std::optional<Rule> rule = readRule(builtin, builtins);
    if (!rule)
      continue;
    for (size_t i = 0; i < builtin.overloads.size(); ++i) {
      if (rule->isExpanded(i))
        continue;
      emitAdjoint(builtin, *rule, i, os);
      emitTangent(builtin, *rule, i, os);
      emitEntry(builtin, *rule, i, table);
    }
  }
  os << "static constexpr RuleEntry ruleTable[] = {\n" << entries << "};\n#endif\n";
}

static TableGen::Emitter::Opt
    derivatives("gen-derivatives", emitDerivatives,
                "Generate the rules of differentiation");
