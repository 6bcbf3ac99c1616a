//===- CallSignature.cpp - Parse signatures that the front end binds ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "CallSignature.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/StringExtras.h"
#include "llvm/ADT/StringSwitch.h"
#include "llvm/ADT/Twine.h"

#include <utility>

using namespace llvm;
using namespace warp::tblgen;

static bool isWordChar(char c) { return isAlnum(c) || c == '_'; }

/// Single capital letters stand for types and extents, small ones for ranks.
static bool isLetter(StringRef name) {
  return name.size() == 1 && isAlpha(name[0]);
}

bool CallSignature::hasName(StringRef name) const {
  return is_contained(letters, name) ||
         any_of(parameters, [&](const CallParameter &parameter) {
           return parameter.name == name;
         });
}

//===----------------------------------------------------------------------===//
// Parsing
//===----------------------------------------------------------------------===//

namespace {
/// Recursive descent; every method returns false once something is wrong.
class Parser {
public:
  Parser(StringRef text, std::string &error)
      : text(text), rest(text), error(error) {}

  bool parse(CallSignature &signature);

private:
  bool fail(StringRef expected);
  bool tryToken(StringRef token) {
    rest = rest.ltrim();
    return rest.consume_front(token);
  }
  bool expect(StringRef token) {
    return tryToken(token) || fail(("'" + token + "'").str());
  }
  StringRef word();
  bool parseList(StringRef close, std::vector<CallType> &items);
  bool parseChoice(CallType &type);
  bool parseType(CallType &type);
  bool checkType(const CallType &type, const CallSignature &signature);
  bool parseDefault(std::string &value);
  bool parseParameter(CallSignature &signature, bool isKeywordOnly);

  StringRef text, rest;
  std::string &error;
};
} // namespace

bool Parser::fail(StringRef expected) {
  if (error.empty())
    error = ("expects " + expected + " at column " +
             Twine(text.size() - rest.size() + 1) + " of '" + text + "'")
                .str();
  return false;
}

StringRef Parser::word() {
  rest = rest.ltrim();
  StringRef found = rest.take_while(isWordChar);
  rest = rest.drop_front(found.size());
  return found;
}

bool Parser::parseList(StringRef close, std::vector<CallType> &items) {
  do {
    if (!parseType(items.emplace_back()))
      return false;
  } while (tryToken(","));
  return expect(close);
}

/// `'lower'|'upper'`.
bool Parser::parseChoice(CallType &type) {
  type.name = "|";
  do {
    if (!expect("'"))
      return false;
    auto [value, behind] = rest.split('\'');
    type.arguments.push_back({("\"" + value + "\"").str(), {}});
    rest = behind;
  } while (tryToken("|"));
  return true;
}

bool Parser::parseType(CallType &type) {
  rest = rest.ltrim();
  if (rest.starts_with("'"))
    return parseChoice(type);
  if (tryToken("[")) {
    type.name = "[]";
    return parseList("]", type.arguments);
  }
  type.name = word().str();
  if (type.name.empty())
    return fail("a type");
  return !tryToken("<") || parseList(">", type.arguments);
}

bool Parser::checkType(const CallType &type, const CallSignature &signature) {
  struct Kind {
    StringRef name;
    unsigned least, most;
  };
  static constexpr Kind kinds[] = {
      {"Any", 0, 0},     {"array", 0, 2}, {"axis", 1, 1},  {"condition", 0, 0},
      {"const", 0, 1},   {"dtype", 0, 0}, {"index", 1, 1}, {"int", 0, 0},
      {"offsets", 1, 1}, {"shape", 0, 0}, {"stack", 0, 0}, {"tile", 1, 2},
      {"value", 0, 0},   {"|", 1, 9}};
  StringRef digits = type.name;
  unsigned width;
  if (type.name == "bool" || (digits.consume_front_insensitive("f") ||
                              digits.consume_front_insensitive("i") ||
                              digits.consume_front_insensitive("u")))
    if (type.name == "bool" || !digits.getAsInteger(10, width))
      return true;
  const Kind *kind =
      find_if(kinds, [&](const Kind &one) { return one.name == type.name; });
  size_t count = type.arguments.size();
  if (kind == std::end(kinds) || count < kind->least || count > kind->most)
    return fail(("a type of parameters, not '" + type.name + "'"));
  if (is_contained({"axis", "index", "offsets"}, type.name) &&
      !signature.hasName(type.arguments[0].name))
    return fail(("an earlier parameter, not '" + type.arguments[0].name + "'"));
  return true;
}

/// Text up to the next comma or parenthesis that is not in brackets or quotes.
bool Parser::parseDefault(std::string &value) {
  rest = rest.ltrim();
  int depth = 0;
  bool quoted = false;
  size_t end = 0;
  for (; end < rest.size(); ++end) {
    char c = rest[end];
    if (c == '\'')
      quoted = !quoted;
    if (quoted)
      continue;
    if (depth == 0 && (c == ',' || c == ')'))
      break;
    depth += c == '(' ? 1 : c == ')' ? -1 : 0;
  }
  value = rest.take_front(end).rtrim().str();
  rest = rest.drop_front(end);
  return !value.empty() || fail("a default value");
}

/// Letters of a type: of elements, extents and ranks.
static void collectLetters(const CallType &type,
                           std::vector<std::string> &letters) {
  if (type.arguments.empty() && isLetter(type.name) &&
      !is_contained(letters, type.name))
    letters.push_back(type.name);
  for (const CallType &argument : type.arguments)
    collectLetters(argument, letters);
}

bool Parser::parseParameter(CallSignature &signature, bool isKeywordOnly) {
  CallParameter parameter;
  parameter.isKeywordOnly = isKeywordOnly;
  parameter.isVariadic = tryToken("*");
  parameter.name = word().str();
  if (parameter.name.empty())
    return fail("the name of a parameter");
  if (signature.hasName(parameter.name))
    return fail(("another name than '" + parameter.name + "'"));
  if (!expect(":"))
    return false;
  rest = rest.ltrim();
  if (rest.starts_with("inout ")) {
    parameter.isInout = true;
    word();
  }
  StringRef before = rest.ltrim();
  if (!parseType(parameter.type))
    return false;
  StringRef behind = std::exchange(rest, before);
  if (!checkType(parameter.type, signature))
    return false;
  rest = behind;
  if (tryToken("=") && !parseDefault(parameter.defaultValue))
    return false;
  bool hadDefault = any_of(signature.parameters, [](const CallParameter &one) {
    return !one.defaultValue.empty();
  });
  if (hadDefault && parameter.defaultValue.empty() && !isKeywordOnly)
    return fail("a default value, as the parameter before has one,");
  // `offsets<a>` names a parameter, which may be a letter.
  if (!is_contained({"axis", "index", "offsets"}, parameter.type.name))
    collectLetters(parameter.type, signature.letters);
  signature.parameters.push_back(std::move(parameter));
  return true;
}

bool Parser::parse(CallSignature &signature) {
  if (!expect("("))
    return false;
  bool isKeywordOnly = false;
  if (!tryToken(")")) {
    do {
      StringRef before = rest.ltrim();
      if (before.starts_with("*,")) {
        tryToken("*");
        isKeywordOnly = true;
        continue;
      }
      if (!parseParameter(signature, isKeywordOnly))
        return false;
    } while (tryToken(","));
    if (!expect(")"))
      return false;
  }
  // A parameter that is called as a letter would hide what the letter stands
  // for.
  llvm::erase_if(signature.letters, [&](const std::string &letter) {
    return any_of(signature.parameters, [&](const CallParameter &parameter) {
      return parameter.name == letter;
    });
  });
  if (!expect("->"))
    return false;
  signature.hasResult = rest.trim() != "None";
  return !rest.trim().empty() || fail("a result");
}

std::optional<CallSignature>
warp::tblgen::parseCallSignature(StringRef text, std::string &error) {
  CallSignature signature;
  error.clear();
  if (!Parser(text, error).parse(signature))
    return std::nullopt;
  return signature;
}

//===----------------------------------------------------------------------===//
// Expressions
//===----------------------------------------------------------------------===//

std::string warp::tblgen::qualifyNames(StringRef expression,
                                       const CallSignature &signature,
                                       std::string &unknown) {
  static constexpr StringLiteral words[] = {"and",  "else", "for",  "if",
                                            "in",   "is",   "not",  "or",
                                            "None", "True", "False"};
  static constexpr StringLiteral functions[] = {
      "all",  "any", "bool", "float", "int",   "len",
      "list", "max", "min",  "range", "tuple", "zip"};
  std::string text;
  for (size_t i = 0; i < expression.size();) {
    char c = expression[i];
    if (c == '\'') {
      size_t end = std::min(expression.find('\'', i + 1), expression.size());
      text += expression.slice(i, end + 1);
      i = end + 1;
      continue;
    }
    if (!isAlpha(c) && c != '_') {
      text += c;
      // Digits, and letters of numbers such as 1e5.
      for (++i;
           isDigit(c) && i < expression.size() && isWordChar(expression[i]);)
        text += expression[i++];
      continue;
    }
    StringRef name = expression.drop_front(i).take_while(isWordChar);
    i += name.size();
    StringRef behind = expression.drop_front(i).ltrim();
    StringRef before = StringRef(text).rtrim();
    bool isField = before.ends_with(".") && !before.ends_with("..");
    bool isKeyword = behind.starts_with("=") && !behind.starts_with("==") &&
                     (before.ends_with(",") || before.ends_with("("));
    if (isField || isKeyword || is_contained(words, name) ||
        (behind.starts_with("(") && is_contained(functions, name))) {
      text += name;
    } else if (signature.hasName(name)) {
      text += name;
    } else if (name == "node" || behind.starts_with("(") ||
               behind.starts_with(".")) {
      text += ("call." + name).str();
    } else {
      unknown = name.str();
      return text;
    }
  }
  return text;
}

//===----------------------------------------------------------------------===//
// Annotations
//===----------------------------------------------------------------------===//

std::string warp::tblgen::getAnnotation(const CallType &type) {
  if (type.name == "|")
    return "str";
  if (type.name == "array")
    return "array";
  if (type.name == "const" && !type.arguments.empty())
    return type.arguments[0].name;
  return StringSwitch<std::string>(type.name)
      .Cases({"i32", "int"}, "int")
      .Case("u32", "uint32")
      .Case("f32", "float")
      .Case("index", "int")
      .Default("Any");
}

std::string warp::tblgen::getResultAnnotation(StringRef overload) {
  StringRef result = overload.rsplit("->").second.trim();
  if (result.consume_front("("))
    return "tuple";
  return result == "None" ? "None" : getAnnotation({result.str(), {}});
}
