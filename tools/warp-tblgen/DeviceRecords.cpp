//===- DeviceRecords.cpp - Device functions and handle kinds --------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "DeviceRecords.h"

#include "llvm/ADT/STLExtras.h"
#include "llvm/ADT/SmallVector.h"
#include "llvm/ADT/StringSwitch.h"
#include "llvm/TableGen/Error.h"

using namespace llvm;
using namespace warp::tblgen;

/// Words of a slot, of 64 bits; the first is the tag.
static constexpr unsigned slotWords = 32;

std::vector<HandleKind>
warp::tblgen::readHandleKinds(const RecordKeeper &records) {
  std::vector<HandleKind> kinds;
  for (const Record *record : records.getAllDerivedDefinitions("HandleKind")) {
    HandleKind kind{
        record->getName(), unsigned(record->getValueAsInt("number")), {}, {}};
    unsigned word = 1;
    for (const Record *field : record->getValueAsListOfDefs("fields")) {
      kind.fields.push_back({field->getValueAsString("name"),
                             field->getValueAsString("form"), word,
                             unsigned(field->getValueAsInt("elementSize")),
                             field->getValueAsBit("isReadOnly")});
      word += unsigned(field->getValueAsInt("words"));
    }
    if (word > slotWords)
      PrintFatalError(record, "the slot of '" + kind.name + "' has " +
                                  Twine(word) + " words, more than " +
                                  Twine(slotWords));
    for (const Record *base : record->getValueAsListOfDefs("bases"))
      kind.bases.push_back(base->getName());
    kinds.push_back(std::move(kind));
  }
  llvm::sort(kinds, [](const HandleKind &a, const HandleKind &b) {
    return a.number < b.number;
  });
  for (auto [i, kind] : enumerate(kinds))
    if (kind.number != i + 1)
      PrintFatalError("handle kinds are numbered from 1 without gaps, but '" +
                      kind.name + "' is " + Twine(kind.number));
  return kinds;
}

/// `name: type` of each part of a list.
static SmallVector<std::pair<StringRef, StringRef>> splitList(StringRef list) {
  SmallVector<std::pair<StringRef, StringRef>> parts;
  SmallVector<StringRef> texts;
  list.split(texts, ',', -1, /*KeepEmpty=*/false);
  for (StringRef text : texts) {
    auto [name, type] = text.split(':');
    parts.push_back({name.trim(), type.trim()});
  }
  return parts;
}

/// The letter of a scalar type, or 0.
static char letterOf(StringRef type) {
  return StringSwitch<char>(type)
      .Case("i32", 'i')
      .Cases({"u64", "address"}, 'l')
      .Case("f32", 'f')
      .Case("f64", 'd')
      .Default(0);
}

std::vector<ResultStruct>
warp::tblgen::readResultStructs(const RecordKeeper &records) {
  std::vector<const Record *> ordered(
      records.getAllDerivedDefinitions("ResultStruct"));
  llvm::sort(ordered, [](const Record *a, const Record *b) {
    return a->getID() < b->getID();
  });
  std::vector<ResultStruct> structs;
  for (const Record *record : ordered) {
    ResultStruct made{record->getName(), {}};
    for (auto [name, type] : splitList(record->getValueAsString("fields"))) {
      StructMember member{name.str(), type.split('[').first.str()};
      if (StringRef count = type.split('[').second; !count.empty())
        if (count.consumeInteger(10, member.count) || count != "]")
          PrintFatalError(record, "no type is called '" + type + "'");
      bool isStruct = llvm::any_of(structs, [&](const ResultStruct &other) {
        return other.name == member.type;
      });
      if (!isStruct && !letterOf(member.type))
        PrintFatalError(record, "no type is called '" + type + "'");
      made.members.push_back(std::move(member));
    }
    structs.push_back(std::move(made));
  }
  return structs;
}

/// The letters of the scalars of a struct, in their order.
static std::string lettersOf(StringRef name, ArrayRef<ResultStruct> structs) {
  std::string letters;
  for (const ResultStruct &made : structs) {
    if (made.name != name)
      continue;
    for (const StructMember &member : made.members) {
      char letter = letterOf(member.type);
      letters += letter ? std::string(member.count, letter)
                        : lettersOf(member.type, structs);
    }
  }
  return letters;
}

static void readTraits(const Record *record, DeviceFunction &function) {
  for (const Record *trait : record->getValueAsListOfDefs("traits")) {
    StringRef name = trait->getName();
    function.isExpanded |= name == "Expanded";
    function.findsSlot |= name == "FindsSlot";
    if (trait->isSubClassOf("Registers"))
      function.registers = int(trait->getValueAsInt("count"));
    else if (trait->isSubClassOf("Lanes"))
      function.shared = int(trait->getValueAsInt("shared"));
    else if (name.starts_with("Assembled")) {
      function.assembly = name.ends_with("Short") ? "Short" : "Long";
      function.isProduct = name.starts_with("AssembledProduct");
    }
  }
  if (function.findsSlot && !function.operands.empty())
    function.operands.front().letter = 'h';
}

static void readOperands(DeviceFunction &function, StringRef list,
                         ArrayRef<HandleKind> kinds) {
  for (auto [name, type] : splitList(list)) {
    StringRef kind = type;
    unsigned count = 0;
    if (char letter = letterOf(type)) {
      function.operands.push_back({name.str(), letter});
    } else if (kind.consume_front("handle<") && kind.consume_back(">") &&
               llvm::any_of(kinds, [&](const HandleKind &known) {
                 return known.name == kind;
               })) {
      function.operands.push_back({name.str(), 'h'});
    } else if (StringRef vec = type;
               vec.consume_front("vec") && !vec.consumeInteger(10, count) &&
               vec.size() == 1 && StringRef("fdi").contains(vec)) {
      for (unsigned i = 0; i < count; ++i)
        function.operands.push_back({(name + Twine(i)).str(), vec.front()});
    } else {
      PrintFatalError(function.record, "no type is called '" + type +
                                           "' in the signature of '" +
                                           function.symbol + "'");
    }
  }
}

std::string DeviceFunction::letters() const {
  std::string letters;
  for (const DeviceOperand &operand : operands)
    letters += operand.letter;
  return letters;
}

std::vector<DeviceFunction>
warp::tblgen::readDeviceFunctions(const RecordKeeper &records) {
  std::vector<HandleKind> kinds = readHandleKinds(records);
  std::vector<ResultStruct> structs = readResultStructs(records);
  std::vector<const Record *> ordered(
      records.getAllDerivedDefinitions("DeviceFunction"));
  llvm::sort(ordered, [](const Record *a, const Record *b) {
    return a->getID() < b->getID();
  });
  std::vector<DeviceFunction> functions;
  for (const Record *record : ordered) {
    DeviceFunction function;
    function.record = record;
    function.symbol = ("warp_" + record->getValueAsString("name")).str();
    auto [operands, result] =
        record->getValueAsString("signature").split(" -> ");
    if (!operands.consume_front("(") || !operands.consume_back(")"))
      PrintFatalError(record, "expects '(name: type, ...) -> type' as the "
                              "signature of '" +
                                  function.symbol + "'");
    readOperands(function, operands, kinds);
    readTraits(record, function);
    if (char letter = letterOf(result)) {
      function.results = letter;
    } else if (result != "()") {
      function.results = lettersOf(result, structs);
      function.resultStruct = result;
      if (function.results.empty())
        PrintFatalError(record, "no result is called '" + result +
                                    "' in the signature of '" +
                                    function.symbol + "'");
    }
    functions.push_back(std::move(function));
  }
  return functions;
}
