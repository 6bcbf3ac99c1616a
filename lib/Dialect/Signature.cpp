//===- Signature.cpp - Overloads of builtins as data ----------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "WarpDialect/Signature.h"

#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/Twine.h"

using llvm::StringRef;
using warp::Parameter;
using warp::Signature;
using warp::TypePattern;
using Kind = TypePattern::Kind;
using Base = TypePattern::Base;

//===----------------------------------------------------------------------===//
// Parsing
//===----------------------------------------------------------------------===//

namespace {
/// Recursive descent; every method returns false once something is wrong.
class Parser {
public:
  Parser(StringRef text, std::string &error)
      : text(text), rest(text), error(error) {}

  bool parse(Signature &signature);

private:
  bool fail(StringRef expected) { return failAt(rest, expected); }
  /// Fails at the word that was read last.
  bool failAtWord(StringRef expected) { return failAt(lastWord, expected); }
  bool failAt(StringRef place, StringRef expected);
  void skipSpace() { rest = rest.ltrim(); }
  bool tryToken(StringRef token);
  bool expect(StringRef token) {
    return tryToken(token) || fail(("'" + token + "'").str());
  }
  StringRef word();
  bool parseParameter(Parameter &parameter);
  bool parseType(TypePattern &pattern);
  bool parseScalar(StringRef name, TypePattern &pattern);
  bool parseArguments(unsigned extents, TypePattern &pattern);
  bool parseExtent(TypePattern &pattern);
  bool parseResults(std::vector<TypePattern> &results);

  StringRef text;
  /// The unread text; `lastWord` is that before the last word was.
  StringRef rest, lastWord;
  std::string &error;
};
} // namespace

bool Parser::failAt(StringRef place, StringRef expected) {
  if (error.empty())
    error = ("expects " + expected + " at column " +
             llvm::Twine(text.size() - place.size() + 1) + " of '" + text + "'")
                .str();
  return false;
}

bool Parser::tryToken(StringRef token) {
  skipSpace();
  return rest.consume_front(token);
}

StringRef Parser::word() {
  skipSpace();
  lastWord = rest;
  StringRef found =
      rest.take_while([](char c) { return llvm::isAlnum(c) || c == '_'; });
  rest = rest.drop_front(found.size());
  return found;
}

bool Parser::parseScalar(StringRef name, TypePattern &pattern) {
  pattern.kind = Kind::Scalar;
  if (name == "bool")
    return true;
  StringRef digits = name;
  pattern.base = digits.consume_front("bf")  ? Base::BFloat
                 : digits.consume_front("f") ? Base::Float
                 : digits.consume_front("i") ? Base::Signed
                 : digits.consume_front("u") ? Base::Unsigned
                                             : Base::Bool;
  if (pattern.base == Base::Bool || digits.getAsInteger(10, pattern.width))
    return failAtWord("a type");
  bool isInteger =
      pattern.base == Base::Signed || pattern.base == Base::Unsigned;
  switch (pattern.width) {
  case 8:
    return isInteger || failAtWord("a type");
  case 16:
    return true;
  case 32:
  case 64:
    return pattern.base != Base::BFloat || failAtWord("a type");
  default:
    return failAtWord("a type");
  }
}

bool Parser::parseExtent(TypePattern &pattern) {
  StringRef name = word();
  TypePattern::Extent extent;
  if (name.size() == 1 && llvm::isLower(name[0]))
    extent.letter = name[0];
  else if (name.getAsInteger(10, extent.number) || extent.number < 1)
    return failAtWord("an extent");
  pattern.extents.push_back(extent);
  return true;
}

bool Parser::parseArguments(unsigned extents, TypePattern &pattern) {
  if (!expect("<"))
    return false;
  for (unsigned i = 0; i < extents; ++i)
    if (!parseExtent(pattern) || !expect(","))
      return false;
  return parseType(pattern.element.emplace_back()) && expect(">");
}

bool Parser::parseType(TypePattern &pattern) {
  StringRef name = word();
  if (name.size() == 1 && llvm::isUpper(name[0])) {
    pattern.letter = name[0];
    switch (name[0]) {
    case 'S':
    case 'T':
      pattern.kind = Kind::AnyNumber;
      return true;
    case 'F':
    case 'G':
      pattern.kind = Kind::AnyFloat;
      return true;
    case 'I':
    case 'J':
      pattern.kind = Kind::AnyInteger;
      return true;
    case 'A':
    case 'B':
      pattern.kind = Kind::AnyValue;
      return true;
    default:
      return failAtWord("one of the letters S, T, F, G, I, J, A, B");
    }
  }
  struct Composite {
    StringRef name;
    Kind kind;
    unsigned extents;
  };
  static constexpr Composite composites[] = {{"vec", Kind::Vec, 1},
                                             {"mat", Kind::Mat, 2},
                                             {"quat", Kind::Quat, 0},
                                             {"transform", Kind::Transform, 0},
                                             {"array", Kind::Array, 1}};
  for (const Composite &composite : composites)
    if (name == composite.name) {
      pattern.kind = composite.kind;
      return parseArguments(composite.extents, pattern);
    }
  return parseScalar(name, pattern);
}

bool Parser::parseParameter(Parameter &parameter) {
  parameter.name = word().str();
  if (parameter.name.empty())
    return failAtWord("the name of a parameter");
  if (!expect(":"))
    return false;
  StringRef before = rest;
  if (word() == "inout")
    parameter.isInout = true;
  else
    rest = before;
  if (!parseType(parameter.type))
    return false;
  if (!tryToken("="))
    return true;
  skipSpace();
  StringRef value =
      rest.take_until([](char c) { return c == ',' || c == ')'; });
  rest = rest.drop_front(value.size());
  parameter.defaultValue = value.rtrim().str();
  return !parameter.defaultValue.empty() || fail("a default value");
}

bool Parser::parseResults(std::vector<TypePattern> &results) {
  if (!tryToken("("))
    return parseType(results.emplace_back());
  if (tryToken(")"))
    return true;
  do {
    if (!parseType(results.emplace_back()))
      return false;
  } while (tryToken(","));
  return expect(")");
}

bool Parser::parse(Signature &signature) {
  if (!expect("("))
    return false;
  if (!tryToken(")")) {
    do {
      if (!parseParameter(signature.parameters.emplace_back()))
        return false;
    } while (tryToken(","));
    if (!expect(")"))
      return false;
  }
  if (!expect("->") || !parseResults(signature.results))
    return false;
  skipSpace();
  return rest.empty() || fail("the end");
}

std::optional<Signature> warp::parseSignature(StringRef text,
                                              std::string &error) {
  Signature signature;
  if (!Parser(text, error).parse(signature))
    return std::nullopt;
  return signature;
}

//===----------------------------------------------------------------------===//
// Printing
//===----------------------------------------------------------------------===//

static StringRef getBaseName(Base base) {
  switch (base) {
  case Base::Bool:
    return "bool";
  case Base::Signed:
    return "int";
  case Base::Unsigned:
    return "uint";
  case Base::Float:
    return "float";
  case Base::BFloat:
    return "bfloat";
  }
  return "";
}

static StringRef getKindName(Kind kind) {
  switch (kind) {
  case Kind::Vec:
    return "vec";
  case Kind::Mat:
    return "mat";
  case Kind::Quat:
    return "quat";
  case Kind::Transform:
    return "transform";
  case Kind::Array:
    return "array";
  default:
    return "";
  }
}

std::string warp::printPattern(const TypePattern &pattern) {
  if (pattern.letter)
    return std::string(1, pattern.letter);
  if (pattern.kind == Kind::Scalar)
    return getBaseName(pattern.base).str() +
           (pattern.base == Base::Bool ? "" : std::to_string(pattern.width));
  std::string text = getKindName(pattern.kind).str() + "<";
  for (const TypePattern::Extent &extent : pattern.extents)
    text += (extent.letter ? std::string(1, extent.letter)
                           : std::to_string(extent.number)) +
            ", ";
  return text + printPattern(pattern.element.front()) + ">";
}

std::string warp::printSignature(StringRef name, const Signature &signature) {
  std::string text = name.str() + "(";
  llvm::ListSeparator comma;
  for (const Parameter &parameter : signature.parameters) {
    text += StringRef(comma).str() + parameter.name + ": " +
            (parameter.isInout ? "inout " : "") + printPattern(parameter.type);
    if (!parameter.defaultValue.empty())
      text += " = " + parameter.defaultValue;
  }
  text += ") -> ";
  if (signature.results.size() == 1)
    return text + printPattern(signature.results.front());
  text += "(";
  llvm::ListSeparator resultComma;
  for (const TypePattern &result : signature.results)
    text += StringRef(resultComma).str() + printPattern(result);
  return text + ")";
}
