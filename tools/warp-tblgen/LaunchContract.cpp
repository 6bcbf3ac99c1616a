//===- LaunchContract.cpp - Launch facts: structs, attributes, docs -------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Writes all that is known of a launch fact from its record (LaunchFact.td).
// C++ takes sections of one file:
//
//   GET_LAUNCH_STRUCTS      members, keys and visitors, for warp/Schedule.h
//   GET_LAUNCH_VARIANT_ACCESSORS, GET_LAUNCH_SCHEDULE_ACCESSORS
//                           members of the classes of the attributes
//   GET_LAUNCH_ATTRIBUTES   their definitions, and verifiers
//   GET_LAUNCH_CONVERSIONS  between structs and attributes
//   GET_LAUNCH_PHRASES      what `kernel.schedule()` says of a launch
//
// A visitor gets the name and the range of a fact and its member; the text and
// binary forms and the properties that Python shows are visitors.
//
//===----------------------------------------------------------------------===//

#include "llvm/ADT/StringExtras.h"
#include "llvm/Support/FormatVariadic.h"
#include "llvm/Support/raw_ostream.h"
#include "llvm/TableGen/Error.h"
#include "llvm/TableGen/Record.h"
#include "llvm/TableGen/TableGenBackend.h"

using namespace llvm;

namespace {
struct Fact {
  explicit Fact(const Record *record)
      : record(record), type(record->getValueAsDef("type")),
        name(record->getValueAsString("name")),
        summary(record->getValueAsString("summary")),
        member(convertToCamelFromSnakeCase(name)),
        accessor(convertToCamelFromSnakeCase(name, /*capitalizeFirst=*/true)),
        cppType(type->getValueAsString("cppType")),
        parameterType(type->getValueAsString("attributeType")),
        initial(type->getValueAsString("initial")),
        least(type->getValueAsInt("least")), most(type->getValueAsInt("most")),
        isPower(type->getValueAsBit("isPower")),
        isOptional(type->getValueAsBit("isOptional")),
        inAttribute(record->getValueAsBit("inAttribute")) {
    if (!all_of(name,
                [](char c) { return isLower(c) || isDigit(c) || c == '_'; }))
      PrintFatalError(record,
                      "expects a name in snake case, but got '" + name + "'");
  }

  bool isKey() const { return use("key"); }
  bool isMasked() const { return use("masked"); }
  bool use(StringRef field) const {
    return record->getValueAsDef("use")->getValueAsBit(field);
  }
  bool isNumber() const { return most != 0; }
  bool accumulates() const { return type->getValueAsBit("accumulates"); }
  std::string greatest() const {
    return accumulates() ? "allFacts" : std::to_string(most);
  }
  /// The default as a value of the attribute.
  std::string attributeDefault() const {
    return isOptional ? (parameterType + "()").str() : initial.str();
  }

  const Record *record, *type;
  StringRef name, summary;
  std::string member, accessor;
  StringRef cppType, parameterType, initial;
  int64_t least, most;
  bool isPower, isOptional, inAttribute;
};

using Facts = std::vector<Fact>;

struct Contract {
  explicit Contract(const RecordKeeper &records)
      : variant(read(records, "VariantFact")),
        schedule(read(records, "ScheduleFact")) {
    for (const Fact &fact : variant)
      (fact.isKey() ? keys : options).push_back(fact);
  }

  /// Facts in the order of their records.
  static Facts read(const RecordKeeper &records, StringRef base) {
    std::vector<const Record *> found(records.getAllDerivedDefinitions(base));
    llvm::sort(found, [](const Record *a, const Record *b) {
      return a->getID() < b->getID();
    });
    return Facts(found.begin(), found.end());
  }

  Facts variant, schedule, keys, options;
};
} // namespace

/// The facts that an attribute has, in the order of its parameters: `!instances`
/// sorts records by their names.
static Facts parametersOf(const Facts &facts) {
  Facts parameters;
  copy_if(facts, std::back_inserter(parameters),
          [](const Fact &fact) { return fact.inAttribute; });
  llvm::sort(parameters, [](const Fact &a, const Fact &b) {
    return a.record->getName() < b.record->getName();
  });
  return parameters;
}

//===----------------------------------------------------------------------===//
// Structs
//===----------------------------------------------------------------------===//

/// A text as a comment of lines that fit.
static void emitComment(StringRef text, raw_ostream &os) {
  SmallVector<StringRef> words;
  text.split(words, ' ');
  size_t column = 0;
  for (StringRef word : words) {
    if (column == 0 || column + word.size() + 1 > 76) {
      os << (column ? "\n" : "") << "  ///";
      column = 5;
    }
    os << ' ' << word;
    column += word.size() + 1;
  }
  os << '\n';
}

static void emitMembers(const Facts &facts, raw_ostream &os) {
  for (const Fact &fact : facts) {
    emitComment(fact.summary, os);
    os << "  " << fact.cppType << ' ' << fact.member;
    if (!fact.initial.empty())
      os << " = " << fact.initial;
    os << ";\n";
  }
}

static void emitVisitor(const Facts &facts, StringRef first, raw_ostream &os) {
  os << "\n  template <typename Self, typename Visitor>\n"
        "  static void visit(Self &self, Visitor &&visitor) {\n"
     << first;
  for (const Fact &fact : facts)
    os << formatv("    visitor(FactInfo{{\"{0}\", {1}, {2}, {3}}, self.{4});\n",
                  fact.name, fact.least, fact.greatest(), fact.isPower,
                  fact.member);
  os << "  }\n";
}

static void emitSizeFacts(const Facts &facts, raw_ostream &os) {
  os << "/// Bits of `Schedule::sizeFacts`.\nenum SizeFact : int {\n";
  int64_t bit = 1;
  for (const Fact &fact : facts)
    if (fact.isMasked()) {
      os << "  " << fact.member << "Fact = " << bit << ",\n";
      bit *= 2;
    }
  os << "  allFacts = " << bit - 1 << "\n};\n\n";
}

static void emitMatches(const Facts &facts, raw_ostream &os) {
  os << "\n  bool operator==(const LaunchFacts &other) const {\n    return ";
  ListSeparator both(" &&\n           ");
  for (const Fact &fact : facts)
    os << both << fact.member << " == other." << fact.member;
  os << ";\n  }\n"
        "  /// The same but for facts of the launch's size that are not in the "
        "mask.\n"
        "  bool matches(LaunchFacts other, int sizeFacts) const {\n";
  for (const Fact &fact : facts)
    if (fact.isMasked())
      os << formatv("    if (!(sizeFacts & {0}Fact))\n      other.{0} = {0};\n",
                    fact.member);
  os << "    return *this == other;\n  }\n";
}

static void emitStructs(const Contract &contract, raw_ostream &os) {
  emitSizeFacts(contract.variant, os);
  os << "/// Facts by which variants of a kernel differ.\nstruct LaunchFacts "
        "{\n";
  emitMembers(contract.keys, os);
  emitMatches(contract.keys, os);
  emitVisitor(contract.keys, "", os);
  os << "};\n\n/// One variant of a kernel.\n"
        "struct CompileOptions : LaunchFacts {\n";
  emitMembers(contract.options, os);
  emitVisitor(contract.options, "    LaunchFacts::visit(self, visitor);\n", os);
  os << "};\n\n/// How launches of compiled code are made.\nstruct Schedule "
        "{\n";
  emitMembers(contract.schedule, os);
  emitVisitor(contract.schedule, "", os);
  os << "};\n";
}

//===----------------------------------------------------------------------===//
// Attributes
//===----------------------------------------------------------------------===//

/// The condition under which a number is out of its range, and the range.
static std::pair<std::string, std::string> rangeOf(const Fact &fact) {
  std::string wrong =
      formatv("{0} < {1} || {0} > {2}", fact.member, fact.least, fact.most);
  if (!fact.isPower)
    return {wrong, formatv("from {0} to {1}", fact.least, fact.most)};
  return {formatv("{0} || ({1} & ({1} - 1)) != 0", wrong, fact.member),
          formatv(fact.least == 0 ? "0 or a power of two up to {1}"
                                  : "a power of two from {0} to {1}",
                  fact.least, fact.most)};
}

static void emitVerifier(StringRef attribute, StringRef first,
                         const Facts &parameters, raw_ostream &os) {
  os << "::llvm::LogicalResult warp::" << attribute
     << "Attr::verify(\n"
        "    ::llvm::function_ref<::mlir::InFlightDiagnostic()> emitError"
     << first;
  for (const Fact &fact : parameters) {
    os << ",\n    " << fact.parameterType;
    if (fact.isNumber())
      os << ' ' << fact.member;
  }
  os << ") {\n";
  for (const Fact &fact : parameters)
    if (fact.isNumber()) {
      auto [wrong, range] = rangeOf(fact);
      os << formatv(
          "  if ({0})\n    return emitError()\n           << \"expects "
          "'{1}' to be {2}, but got '\" << {3} << \"'\";\n",
          wrong, fact.name, range, fact.member);
    }
  os << "  return ::llvm::success();\n}\n\n";
}

/// `get` with one parameter replaced, or with defaults alone.
static void emitArguments(const Facts &parameters, const Fact *replaced,
                          raw_ostream &os) {
  for (const Fact &fact : parameters) {
    os << ",\n             ";
    if (!replaced)
      os << fact.attributeDefault();
    else if (replaced->name == fact.name)
      os << "value";
    else
      os << "get" << fact.accessor << "()";
  }
}

/// `with` of each parameter: the attribute with another value of it.
static void declareWith(StringRef attribute, const Facts &facts,
                        raw_ostream &os) {
  for (const Fact &fact : parametersOf(facts))
    os << formatv("{0}Attr with{1}({2} value) const;\n", attribute,
                  fact.accessor, fact.parameterType);
}

static void defineWith(StringRef attribute, StringRef first, const Facts &facts,
                       raw_ostream &os) {
  Facts parameters = parametersOf(facts);
  for (const Fact &fact : parameters) {
    os << formatv("warp::{0}Attr warp::{0}Attr::with{1}({2} value) const {{\n",
                  attribute, fact.accessor, fact.parameterType);
    if (fact.accumulates())
      os << "  value |= get" << fact.accessor << "();\n";
    os << "  return get(getContext()" << first;
    emitArguments(parameters, &fact, os);
    os << ");\n}\n\n";
  }
}

static void emitAttributes(const Contract &contract, raw_ostream &os) {
  Facts parameters = parametersOf(contract.variant);
  emitVerifier("Variant", ", ::warp::TargetAttr", parameters, os);
  os << "warp::VariantAttr warp::VariantAttr::getDefault("
        "::warp::TargetAttr target) {\n"
        "  return get(target.getContext(), target";
  emitArguments(parameters, nullptr, os);
  os << ");\n}\n\n";
  parameters = parametersOf(contract.schedule);
  emitVerifier("Schedule", "", parameters, os);
  os << "warp::ScheduleAttr warp::ScheduleAttr::getDefault("
        "::mlir::MLIRContext *context) {\n  return get(context";
  emitArguments(parameters, nullptr, os);
  os << ");\n}\n\n";
  defineWith("Variant", ", getTarget()", contract.variant, os);
  defineWith("Schedule", "", contract.schedule, os);
}

static void emitConversions(const Contract &contract, raw_ostream &os) {
  os << "static warp::VariantAttr convert(warp::TargetAttr target,\n"
        "                                 const warp::CompileOptions "
        "&options,\n"
        "                                 ::llvm::function_ref<"
        "::mlir::InFlightDiagnostic()> emitError) {\n"
        "  return warp::VariantAttr::getChecked(\n"
        "      emitError, target.getContext(), target";
  for (const Fact &fact : parametersOf(contract.variant))
    os << formatv(",\n      {0}(options.{1})", fact.parameterType, fact.member);
  os << ");\n}\n\n"
        "static warp::Schedule convert(warp::ScheduleAttr attribute) {\n"
        "  warp::Schedule schedule;\n";
  for (const Fact &fact : parametersOf(contract.schedule))
    os << formatv("  assign(schedule.{0}, attribute.get{1}());\n", fact.member,
                  fact.accessor);
  os << "  return schedule;\n}\n";
}

//===----------------------------------------------------------------------===//
// Text
//===----------------------------------------------------------------------===//

static void emitPhrases(const Contract &contract, raw_ostream &os) {
  os << "static std::string phrasesOf(const warp::LaunchFacts &facts) {\n"
        "  std::string text;\n";
  for (const Fact &fact : contract.keys) {
    StringRef phrase = fact.record->getValueAsString("phrase");
    if (phrase.empty())
      continue;
    std::string self = "facts." + fact.member;
    std::string condition = fact.record->getValueAsString("phraseIf").str();
    condition.replace(condition.find("$_self"), 6, self);
    auto [before, after] = phrase.split("{0}");
    os << "  if (" << condition << ")\n    text += \", " << before << '"';
    if (before != phrase)
      os << " + std::to_string(" << self << ")";
    if (!after.empty())
      os << " + \"" << after << '"';
    os << ";\n";
  }
  os << "  return text;\n}\n";
}

static void emitContract(const RecordKeeper &records, raw_ostream &os) {
  Contract contract(records);
  emitSourceFileHeader("Launch contract", os, records);
  auto section = [&](StringRef name, auto emit) {
    os << "#ifdef GET_LAUNCH_" << name << "\n#undef GET_LAUNCH_" << name
       << "\n\n";
    emit(contract, os);
    os << "\n#endif // GET_LAUNCH_" << name << "\n\n";
  };
  section("STRUCTS", emitStructs);
  section("VARIANT_ACCESSORS", [](const Contract &contract, raw_ostream &os) {
    declareWith("Variant", contract.variant, os);
  });
  section("SCHEDULE_ACCESSORS", [](const Contract &contract, raw_ostream &os) {
    declareWith("Schedule", contract.schedule, os);
  });
  section("ATTRIBUTES", emitAttributes);
  section("CONVERSIONS", emitConversions);
  section("PHRASES", emitPhrases);
}

static TableGen::Emitter::Opt contract("gen-launch-contract", emitContract,
                                       "Generate structs and attributes of "
                                       "launch facts");

//===----------------------------------------------------------------------===//
// Documentation
//===----------------------------------------------------------------------===//

static constexpr StringLiteral header = R"(# Launch facts

<!-- Written by warp-tblgen from include/WarpDialect/Launch.td; edit that file. -->

The facts that cross the border between the compiler and the runtime; the launch contract of
[architecture.md](architecture.md#launch-contract) says how they are used. The names are those of
`#warp.variant`, of `#warp.schedule` and of what `kernel.schedule()` returns; in C++ they are members of
`CompileOptions` and `Schedule` (`warp/Schedule.h`), in camel case.

)";

static void emitTable(const Facts &facts, bool withUse, raw_ostream &os) {
  os << "| fact | default |" << (withUse ? " variants differ in it |" : "")
     << " meaning |\n| --- | --- |" << (withUse ? " --- |" : "") << " --- |\n";
  for (const Fact &fact : facts) {
    os << "| `" << fact.name << "` | ";
    if (!fact.initial.empty())
      os << '`' << fact.initial << '`';
    os << " | ";
    if (withUse)
      os << (fact.isMasked() ? "if the code depends on it"
             : fact.isKey()  ? "yes"
                             : "no")
         << " | ";
    os << fact.summary << " |\n";
  }
}

static void emitLaunchDocs(const RecordKeeper &records, raw_ostream &os) {
  Contract contract(records);
  os << header << "## Variant: launches that code is compiled for\n\n";
  emitTable(contract.variant, /*withUse=*/true, os);
  os << "\n## Schedule: how they are made\n\n";
  emitTable(contract.schedule, /*withUse=*/false, os);
}

static TableGen::Emitter::Opt docs("gen-launch-docs", emitLaunchDocs,
                                   "Generate the tables of launch facts");
