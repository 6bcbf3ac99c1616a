//===- Formula.cpp - Formulas of derivatives ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Formula.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/StringSet.h"
#include "llvm/TableGen/Error.h"

using namespace llvm;
using namespace warp::tblgen;

void FormulaNode::forEachName(function_ref<void(StringRef)> visit) const {
  if (kind == Name)
    visit(text);
  for (const FormulaNode &operand : operands)
    operand.forEachName(visit);
}

bool Formula::uses(StringRef name) const {
  bool found = false;
  auto visit = [&](StringRef other) { found |= other == name; };
  value.forEachName(visit);
  if (unless)
    unless->forEachName(visit);
  if (requirement)
    requirement->forEachName(visit);
  return found;
}

bool Formula::isGuarded() const {
  bool found = bool(unless);
  if (unless)
    unless->forEachName([&](StringRef name) { found &= name == "g"; });
  return found;
}

StringRef Formula::getFactor() const {
  if (!isGuarded() || value.kind != FormulaNode::Binary || value.text != "*")
    return {};
  const FormulaNode &a = value.operands[0], &b = value.operands[1];
  if (a.kind != FormulaNode::Name || b.kind != FormulaNode::Name)
    return {};
  return a.text == "g" ? b.text : b.text == "g" ? a.text : StringRef();
}

//===----------------------------------------------------------------------===//
// Parser
//===----------------------------------------------------------------------===//

namespace {

class Parser {
public:
  Parser(const Builtin &builtin, StringRef text)
      : record(builtin.record), whole(text), rest(text) {
    advance();
  }

  Formula parseFormula() {
    Formula formula;
    formula.value = parseAny();
    if (take("unless"))
      formula.unless = parseAny();
    if (take("requires")) {
      formula.requirement = parseAny();
      if (!take(":"))
        fail("':' and a message");
      formula.message = whole.take_back(token.size() + rest.size());
      token = "";
    }
    if (!token.empty())
      fail("an operator");
    return formula;
  }

private:
  [[noreturn]] void fail(Twine expected) {
    size_t column = whole.size() - rest.size() - token.size() + 1;
    PrintFatalError(record, "expects " + expected + " at column " +
                                Twine(column) + " of formula '" + whole + "'");
  }

  static bool isWordStart(char c) { return isAlpha(c) || c == '_'; }

  void advance() {
    rest = rest.ltrim();
    size_t length = rest.empty() ? 0 : 1;
    auto isWord = [](char c) { return isAlnum(c) || c == '_' || c == '.'; };
    if (!rest.empty() && isWord(rest[0]))
      length = std::min(rest.size(), rest.find_if_not(isWord));
    else if (rest.size() > 1 && rest[1] == '=' && StringRef("=!<>").contains(rest[0]))
      length = 2;
    token = rest.take_front(length);
    rest = rest.drop_front(length);
  }

  bool take(StringRef wanted) {
    if (token != wanted)
      return false;
    advance();
    return true;
  }

  using Level = FormulaNode (Parser::*)();

  /// Operands of `next` joined by any of these signs, from the left.
  FormulaNode parseChain(ArrayRef<StringRef> signs, Level next) {
    FormulaNode left = (this->*next)();
    while (is_contained(signs, token)) {
      StringRef sign = token;
      advance();
      FormulaNode right = (this->*next)();
      left = {FormulaNode::Binary, sign, {std::move(left), std::move(right)}};
    }
    return left;
  }

  FormulaNode parseAny() { return parseChain({"or"}, &Parser::parseAll); }
  FormulaNode parseAll() { return parseChain({"and"}, &Parser::parseNot); }
  FormulaNode parseNot() {
    if (take("not"))
      return {FormulaNode::Unary, "not", {parseNot()}};
    return parseChain({"==", "!=", "<", "<=", ">", ">="}, &Parser::parseSum);
  }
  FormulaNode parseSum() {
    return parseChain({"+", "-"}, &Parser::parseProduct);
  }
  FormulaNode parseProduct() {
    return parseChain({"*", "/"}, &Parser::parseSigned);
  }
  FormulaNode parseSigned() {
    if (take("-"))
      return {FormulaNode::Unary, "-", {parseSigned()}};
    return parseAtom();
  }

  FormulaNode parseAtom() {
    StringRef text = token;
    if (take("(")) {
      FormulaNode inner = parseAny();
      if (!take(")"))
        fail("')'");
      return inner;
    }
    if (text.empty() || !(isWordStart(text[0]) || isDigit(text[0])))
      fail("a name, a number or '('");
    advance();
    double number;
    if (isDigit(text[0])) {
      if (text.getAsDouble(number))
        fail("a number before this");
      return {FormulaNode::Number, text, {}};
    }
    if (!take("("))
      return {FormulaNode::Name, text, {}};
    FormulaNode call{FormulaNode::Call, text, {}};
    do
      call.operands.push_back(parseAny());
    while (take(","));
    if (!take(")"))
      fail("')'");
    return call;
  }

  const Record *record;
  StringRef whole, rest, token;
};

/// Checks names and calls of a formula.
class Checker {
public:
  Checker(const Builtin &builtin, ArrayRef<Builtin> builtins)
      : builtin(builtin), builtins(builtins) {}

  void allow(StringRef name) { names.insert(name); }

  void check(const FormulaNode &node, StringRef formula) const {
    if (node.kind == FormulaNode::Name && !names.contains(node.text))
      PrintFatalError(builtin.record, "formula '" + formula +
                                          "' has no operand '" + node.text +
                                          "'");
    if (node.kind == FormulaNode::Call &&
        none_of(builtins, [&](const Builtin &other) {
          return other.pythonName == node.text && !other.isSpecial();
        }))
      PrintFatalError(builtin.record, "formula '" + formula +
                                          "' calls '" + node.text +
                                          "', which is not a builtin");
    for (const FormulaNode &operand : node.operands)
      check(operand, formula);
  }

  Formula parse(StringRef text) const {
    Formula formula = Parser(builtin, text).parseFormula();
    check(formula.value, text);
    if (formula.unless)
      check(*formula.unless, text);
    if (formula.requirement)
      check(*formula.requirement, text);
    return formula;
  }

private:
  const Builtin &builtin;
  ArrayRef<Builtin> builtins;
  StringSet<> names;
};

} // namespace

//===----------------------------------------------------------------------===//
// Rules
//===----------------------------------------------------------------------===//

/// One entry per overload, of a list that has one for each or one for all.
template <typename T>
static std::vector<T> spread(const Builtin &builtin, std::vector<T> entries,
                             StringRef what) {
  size_t count = builtin.overloads.size();
  if (entries.size() == 1)
    return std::vector<T>(count, entries.front());
  if (entries.size() != count)
    PrintFatalError(builtin.record,
                    "builtin '" + builtin.pythonName + "' has " + what +
                        " for " + Twine(entries.size()) + " of " +
                        Twine(count) + " overloads");
  return entries;
}

static std::vector<std::vector<StringRef>>
readAdjoints(const Builtin &builtin, const Record *derivative) {
  std::vector<std::vector<StringRef>> adjoints;
  for (const Init *entry : *derivative->getValueAsListInit("adjoints")) {
    std::vector<StringRef> formulas;
    for (const Init *formula : *cast<ListInit>(entry))
      formulas.push_back(cast<StringInit>(formula)->getValue());
    adjoints.push_back(std::move(formulas));
  }
  return spread(builtin, std::move(adjoints), "adjoints");
}

static void readOverload(const Builtin &builtin, Checker checker,
                         size_t overload, ArrayRef<StringRef> adjoints,
                         Rule &rule) {
  const std::vector<warp::Parameter> &parameters =
      builtin.signatures[overload].parameters;
  if (!adjoints.empty() && adjoints.size() != parameters.size())
    PrintFatalError(builtin.record,
                    "builtin '" + builtin.pythonName + "' has " +
                        Twine(adjoints.size()) + " formulas for " +
                        Twine(parameters.size()) + " parameters of '" +
                        builtin.overloads[overload] + "'");
  for (const warp::Parameter &parameter : parameters)
    checker.allow(parameter.name);
  Checker tangentChecker = checker;
  checker.allow("g");
  for (const Definition &definition : rule.given) {
    checker.allow(definition.name);
    if (!definition.usesCotangent)
      tangentChecker.allow(definition.name);
  }
  for (const warp::Parameter &parameter : parameters)
    tangentChecker.allow("d" + parameter.name);

  std::vector<std::optional<Formula>> formulas;
  for (StringRef text : adjoints)
    formulas.push_back(text.empty() ? std::nullopt
                                    : std::optional(checker.parse(text)));
  rule.adjoints.push_back(std::move(formulas));
  StringRef tangent = rule.tangents[overload];
  bool isKeyword = tangent == "partials" || tangent == "substitution";
  rule.tangentFormulas.push_back(
      adjoints.empty() || isKeyword
          ? std::nullopt
          : std::optional(tangentChecker.parse(tangent)));
}

std::optional<Rule> warp::tblgen::readRule(const Builtin &builtin,
                                           ArrayRef<Builtin> builtins) {
  if (builtin.isSpecial())
    return std::nullopt;
  const Record *derivative = builtin.record->getValueAsDef("derivative");
  if (!derivative->isSubClassOf("Formulas"))
    return std::nullopt;
  Rule rule;
  Checker checker(builtin, builtins);
  checker.allow("result");
  Checker givenChecker = checker;
  givenChecker.allow("g");
  for (const warp::Parameter &parameter : builtin.signatures[0].parameters)
    givenChecker.allow(parameter.name);
  for (StringRef text : derivative->getValueAsListOfStrings("given")) {
    auto [name, value] = text.split('=');
    Formula formula = givenChecker.parse(value.trim());
    bool usesCotangent =
        formula.uses("g") || any_of(rule.given, [&](const Definition &other) {
          return other.usesCotangent && formula.uses(other.name);
        });
    rule.given.push_back(
        {name.trim(), std::move(formula.value), usesCotangent});
    givenChecker.allow(name.trim());
  }
  rule.tangents = spread(
      builtin, derivative->getValueAsListOfStrings("tangents"), "tangents");
  auto adjoints = readAdjoints(builtin, derivative);
  for (size_t i = 0; i < builtin.overloads.size(); ++i)
    readOverload(builtin, checker, i, adjoints[i], rule);
  return rule;
}
