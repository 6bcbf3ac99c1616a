//===- MachineCode.h - Machine code of GPU kernels on disk ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The kernel cache keeps PTX in `<key>.code` and, in `<key>.machine`, the
// machine code that a driver made of it, so that a later process does not start
// the driver's assembler. The driver gives machine code away through its linker
// alone, which compiles PTX as a part of programs to come: kernels that divide
// call functions for rare operands. An entry is `isBest` if that costs nothing:
// the kernel is no worse than the one that the driver makes of the whole
// program. Others run until tier-1 code is there.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_MACHINECODE_H
#define WARP_LIB_RUNTIME_MACHINECODE_H

#include "warp/Compile.h"

#include <optional>
#include <string>
#include <vector>

namespace warp {

struct MachineCode {
  /// The entry of the PTX.
  std::string entry;
  std::vector<char> binary;
  bool isBest = false;
};

/// 64 hexadecimal digits for PTX, an architecture (90) and the driver of this
/// process.
std::string machineCodeKey(const Code &ptx, int arch);

/// Nothing if there is none, or if it is damaged.
std::optional<MachineCode> findMachineCode(const std::string &key);
void storeMachineCode(const std::string &key, const MachineCode &code);
void removeMachineCode(const std::string &key);

/// The file format, exposed for lists of the cache.
std::optional<MachineCode> deserializeMachineCode(const std::string &key,
                                                  const std::string &bytes);

} // namespace warp

#endif // WARP_LIB_RUNTIME_MACHINECODE_H
