//===- LaunchFact.td - Records of the launch contract --------*- tablegen -*-=//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The classes that Launch.td is written in. A record has the name of a fact in
// snake case; the C++ member, the accessor and the key of the text form follow
// from it.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LAUNCHFACT_TD
#define WARP_LAUNCHFACT_TD

/// How a fact is held: C++ type of the member, of the attribute's parameter,
/// the default value, and the values that are allowed.
class FactType<string member, string parameter, string value> {
  string cppType = member;
  string attributeType = parameter;
  string initial = value;
  /// Numbers: the least and the greatest; powers of two, and 0 if that is the
  /// least.
  int least = 0;
  int most = 0;
  bit isPower = 0;
  /// The attribute's parameter may be left out, and is then null.
  bit isOptional = 0;
  /// A mask of `SizeFact`, to which `with` adds.
  bit accumulates = 0;
}

class LaunchFlag<string value = "false"> : FactType<"bool", "bool", value>;

class LaunchNumber<int value, int lowest, int highest>
    : FactType<"int", "int64_t", "" # value> {
  let least = lowest;
  let most = highest;
}

class LaunchPower<int value, int lowest, int highest>
    : LaunchNumber<value, lowest, highest> {
  let isPower = 1;
}

/// One bit for each of the first 64 arguments.
class LaunchMask : FactType<"uint64_t", "uint64_t", "0">;

class SizeFactMask : FactType<"int", "int64_t", "0"> {
  let accumulates = 1;
}

/// A rough count: no negative number.
class LaunchAmount : FactType<"double", "int64_t", "0">;

class LaunchText<string value> : FactType<"std::string", "", "\"" # value # "\"">;

/// A value that has an attribute of its own, `parameter`, or none.
class LaunchValue<string member, string parameter = "">
    : FactType<member, parameter, ""> {
  let isOptional = 1;
}

/// How variants of a kernel depend on a fact.
class FactUse<bit isKey, bit isMasked> {
  bit key = isKey;
  bit masked = isMasked;
}
/// Launches that differ in it have code of their own.
def Key : FactUse<1, 0>;
/// The same, if the code depends on it: `Schedule::sizeFacts` has its bit.
def KeyIfUsed : FactUse<1, 1>;
/// The same for all launches of a kernel.
def PerKernel : FactUse<0, 0>;

class LaunchFact<string factName, FactType factType, string text> {
  string name = factName;
  FactType type = factType;
  /// A phrase, for comments and the table of docs/launch.md.
  string summary = text;
  /// True if the attribute has it.
  bit inAttribute = !ne(factType.attributeType, "");
}

/// A fact of launches that code is compiled for.
class VariantFact<string name, FactType type, string summary, FactUse factUse>
    : LaunchFact<name, type, summary> {
  FactUse use = factUse;
  /// The phrase of `kernel.schedule()` for such launches, with `{0}` for the value,
  /// and the condition for it.
  string phrase = "";
  string phraseIf = "$_self";
}

/// A decision of the compiler about launches, or a property of the code that
/// launches have to know.
class ScheduleFact<string name, FactType type, string summary>
    : LaunchFact<name, type, summary>;

/// One that is read off the finished code, not kept in the attribute.
class CodeFact<string name, FactType type, string summary>
    : ScheduleFact<name, type, summary> {
  let inAttribute = 0;
}

#endif // WARP_LAUNCHFACT_TD
