//===- Relocations.h - Relocations of ELF objects ---------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// LLVM writes these into position-independent code of the small code model. The
// ABI supplements of x86-64 and of aarch64 define them.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_LOADER_RELOCATIONS_H
#define WARP_LIB_LOADER_RELOCATIONS_H

#include <cstddef>
#include <cstdint>
#include <functional>

namespace warp {

/// A place in memory that depends on the address of a symbol.
struct Relocation {
  unsigned kind;
  char *at;
  uint64_t address;
  int64_t addend;
  /// Address of code near the place that jumps to the symbol, and of 8 bytes
  /// near the place that hold the symbol's address.
  std::function<uint64_t()> stub, slot;
};

enum class Relocated { Done, TooFar, UnknownKind };

/// A processor's rules.
struct Relocations {
  /// `e_machine` of its objects, and its name.
  unsigned machine;
  const char *name;
  /// Code that jumps to the address which the 8 bytes behind it hold, of
  /// `jumpSize` bytes.
  const void *jump;
  size_t jumpSize;
  /// Bytes that a relocation changes.
  size_t (*size)(unsigned kind);
  Relocated (*apply)(const Relocation &relocation);
};

extern const Relocations x86Relocations, aarch64Relocations;

/// The rules of the processor that runs.
inline const Relocations &hostRelocations() {
#ifdef __aarch64__
  return aarch64Relocations;
#else
  return x86Relocations;
#endif
}

} // namespace warp

#endif // WARP_LIB_LOADER_RELOCATIONS_H
