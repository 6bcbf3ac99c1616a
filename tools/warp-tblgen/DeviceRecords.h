//===- DeviceRecords.h - Device functions and handle kinds ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Reads and checks the records of include/WarpDialect/Functions.td. All back
// ends for them start from here.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_TBLGEN_DEVICERECORDS_H
#define WARP_TBLGEN_DEVICERECORDS_H

#include "llvm/TableGen/Record.h"

#include <string>
#include <vector>

namespace warp::tblgen {

/// A field of a slot, at a word.
struct SlotField {
  llvm::StringRef name, form;
  unsigned word, elementSize;
  bool isReadOnly;
};

struct HandleKind {
  llvm::StringRef name;
  unsigned number;
  std::vector<SlotField> fields;
  std::vector<llvm::StringRef> bases;
};

/// A member of a struct: a scalar or struct, or an array of scalars.
struct StructMember {
  std::string name, type;
  unsigned count = 1;
};

struct ResultStruct {
  llvm::StringRef name;
  std::vector<StructMember> members;
};

/// An operand in C.
struct DeviceOperand {
  std::string name;
  /// The letter of its type: h, i, l, f or d.
  char letter;
};

struct DeviceFunction {
  const llvm::Record *record;
  /// With `warp_`, and a star if it stands for several.
  std::string symbol;
  std::vector<DeviceOperand> operands;
  /// The scalars of the result, and its struct if it has one.
  std::string results;
  llvm::StringRef resultStruct;
  int registers = 0, shared = -1;
  bool isExpanded = false, findsSlot = false;
  /// The enumerator of LibraryFunction::Assembly.
  llvm::StringRef assembly = "None";
  bool isProduct = false;

  std::string letters() const;
  /// False for several functions, and for what the compiler expands.
  bool hasPrototype() const { return !isExpanded && symbol.back() != '*'; }
};

/// The kinds by number.
std::vector<HandleKind> readHandleKinds(const llvm::RecordKeeper &records);
/// In an order in which each is defined after its members.
std::vector<ResultStruct> readResultStructs(const llvm::RecordKeeper &records);
std::vector<DeviceFunction>
readDeviceFunctions(const llvm::RecordKeeper &records);

} // namespace warp::tblgen

#endif // WARP_TBLGEN_DEVICERECORDS_H
