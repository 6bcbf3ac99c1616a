//===- Records.cpp - The registry's records as the back ends see them -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Records.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/SmallVector.h"
#include "llvm/ADT/StringSet.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/Error.h"

using namespace llvm;
using namespace warp::tblgen;

/// Letters that a pattern uses, appended to `letters`.
static void collectLetters(const warp::TypePattern &pattern,
                           std::string &letters) {
  if (pattern.letter)
    letters += pattern.letter;
  for (const warp::TypePattern::Extent &extent : pattern.extents)
    if (extent.letter)
      letters += extent.letter;
  for (const warp::TypePattern &element : pattern.element)
    collectLetters(element, letters);
}

/// A result can only be built of letters that operands bind.
static void checkSignature(const Record &record,
                           const warp::Signature &signature, StringRef text) {
  std::string bound, used;
  StringSet<> names;
  bool hadDefault = false;
  for (const warp::Parameter &parameter : signature.parameters) {
    collectLetters(parameter.type, bound);
    if (!names.insert(parameter.name).second)
      PrintFatalError(&record, "two parameters '" + parameter.name +
                                   "' in overload '" + text + "'");
    if (hadDefault && parameter.defaultValue.empty())
      PrintFatalError(&record, "parameter '" + parameter.name +
                                   "' needs a default in overload '" + text +
                                   "', because the one before has one");
    hadDefault = !parameter.defaultValue.empty();
  }
  for (const warp::TypePattern &result : signature.results)
    collectLetters(result, used);
  for (char letter : used)
    if (bound.find(letter) == std::string::npos)
      PrintFatalError(&record, "no parameter binds '" + Twine(letter) +
                                   "' in overload '" + text + "'");
}

static Builtin readCommon(const Record *record) {
  Builtin builtin;
  builtin.record = record;
  builtin.pythonName = record->getValueAsString("pythonName");
  builtin.group = record->getValueAsString("group");
  builtin.summary = record->getValueAsString("summary").trim();
  for (StringRef overload : record->getValueAsListOfStrings("overloads"))
    builtin.overloads.push_back(overload);
  if (builtin.summary.empty())
    PrintFatalError(record,
                    "builtin '" + builtin.pythonName + "' has no summary");
  if (builtin.group.empty())
    PrintFatalError(record,
                    "builtin '" + builtin.pythonName + "' has no group");
  if (builtin.overloads.empty())
    PrintFatalError(record,
                    "builtin '" + builtin.pythonName + "' has no overloads");
  return builtin;
}

/// A derivative that no test could check is an error.
static void checkDomains(const Builtin &builtin) {
  size_t count = builtin.signatures[0].parameters.size();
  auto check = [&](ArrayRef<StringRef> domain) {
    if (domain.size() != count)
      PrintFatalError(builtin.record, "builtin '" + builtin.pythonName +
                                          "' has " + Twine(domain.size()) +
                                          " intervals for " + Twine(count) +
                                          " parameters");
  };
  if (!builtin.domain.empty())
    check(builtin.domain);
  if (!builtin.isDifferentiable())
    return;
  if (builtin.smoothDomain.empty())
    PrintFatalError(builtin.record,
                    "builtin '" + builtin.pythonName +
                        "' has a derivative, but no 'smoothDomain' on which "
                        "to check it");
  if (builtin.smoothDomain.size() != 1)
    check(builtin.smoothDomain);
}

static Builtin readOperation(const Record *record) {
  Builtin builtin = readCommon(record);
  builtin.symbol = record->getValueAsString("symbol");
  builtin.opName = ("warp." + record->getValueAsString("opName")).str();
  builtin.className = record->getName().split('_').second.str();
  const Record *derivative = record->getValueAsDef("derivative");
  builtin.derivativeKind = derivative->getValueAsString("kind");
  builtin.derivative = derivative->getValueAsString("text");
  for (StringRef interval : record->getValueAsListOfStrings("domain"))
    builtin.domain.push_back(interval);
  for (StringRef interval : record->getValueAsListOfStrings("smoothDomain"))
    builtin.smoothDomain.push_back(interval);
  for (StringRef overload : builtin.overloads) {
    std::string error;
    std::optional<warp::Signature> signature =
        warp::parseSignature(overload, error);
    if (!signature)
      PrintFatalError(record,
                      "overload of '" + builtin.pythonName + "' " + error);
    checkSignature(*record, *signature, overload);
    builtin.signatures.push_back(*std::move(signature));
  }
  checkDomains(builtin);
  return builtin;
}

static Builtin readSpecial(const Record *record) {
  Builtin builtin = readCommon(record);
  size_t calls = record->getValueAsListOfStrings("calls").size();
  if (calls == 0)
    return builtin;
  if (calls != 1 && calls != builtin.overloads.size())
    PrintFatalError(record, "'" + builtin.pythonName + "' has " + Twine(calls) +
                                " calls for " +
                                Twine(builtin.overloads.size()) + " overloads");
  for (StringRef overload : builtin.overloads) {
    std::string error;
    std::optional<CallSignature> signature =
        parseCallSignature(overload, error);
    if (!signature)
      PrintFatalError(record,
                      "overload of '" + builtin.pythonName + "' " + error);
    builtin.callSignatures.push_back(*std::move(signature));
  }
  return builtin;
}

std::vector<Builtin> warp::tblgen::readBuiltins(const RecordKeeper &records) {
  std::vector<Builtin> builtins;
  for (const Record *record : records.getAllDerivedDefinitions("Warp_Builtin"))
    builtins.push_back(readOperation(record));
  for (const Record *record : records.getAllDerivedDefinitions("Warp_Special"))
    builtins.push_back(readSpecial(record));
  for (const Record *record :
       records.getAllDerivedDefinitions("Warp_LibraryFunction")) {
    builtins.push_back(readCommon(record));
    builtins.back().module = record->getValueAsString("module");
    if (builtins.back().overloads.front().starts_with("(id: "))
      builtins.back().handle = record->getValueAsString("handle");
  }
  llvm::sort(builtins, [](const Builtin &a, const Builtin &b) {
    return a.pythonName < b.pythonName;
  });
  for (size_t i = 1; i < builtins.size(); ++i)
    if (builtins[i].pythonName == builtins[i - 1].pythonName)
      PrintFatalError(builtins[i].record, "two records of builtin '" +
                                              builtins[i].pythonName + "'");
  return builtins;
}

std::vector<StringRef> warp::tblgen::getGroups(const RecordKeeper &records) {
  std::vector<const Record *> ordered;
  for (StringRef base :
       {"Warp_Builtin", "Warp_Special", "Warp_LibraryFunction"})
    llvm::append_range(ordered, records.getAllDerivedDefinitions(base));
  llvm::sort(ordered, [](const Record *a, const Record *b) {
    return a->getID() < b->getID();
  });
  std::vector<StringRef> groups;
  for (const Record *record : ordered) {
    StringRef group = record->getValueAsString("group");
    if (!is_contained(groups, group))
      groups.push_back(group);
  }
  return groups;
}

std::vector<std::string>
warp::tblgen::getDisplayedOverloads(const Builtin &builtin) {
  std::vector<std::string> lines;
  for (const warp::Signature &signature : builtin.signatures)
    lines.push_back(printSignature(builtin.pythonName, signature));
  if (builtin.isSpecial())
    for (StringRef overload : builtin.overloads)
      lines.push_back((builtin.pythonName + overload).str());
  return lines;
}

std::string warp::tblgen::quote(StringRef text) {
  std::string quoted = "\"";
  for (char c : text) {
    if (c == '"' || c == '\\')
      quoted += '\\';
    quoted += c;
  }
  return quoted + '"';
}
