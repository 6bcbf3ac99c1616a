//===- LibraryCode.h - Precompiled GPU code of the library ------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Assembled when the library is built, for architectures that are common; the
// driver assembles the rest.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIBRARYCODE_H
#define WARP_LIBRARYCODE_H

#include "warp/Export.h"

#include <string>
#include <vector>

namespace warp {

/// True if there is machine code of the device library's long functions.
/// target: "sm_90a", as the kernel's code has it.
WARP_API bool hasAssembledLibrary(const std::string &target);
/// That code, relocatable objects to link quickly compiled kernels with
/// (FirstCode.h); empty where there is none.
WARP_API const std::vector<std::vector<char>> &
assembledLibrary(const std::string &target);

/// The kernels of a file of lib/DeviceLib/cuda as machine code, empty if there
/// is none for an architecture, 90 for "sm_90"; and as PTX.
WARP_API std::vector<char> assembledKernels(const std::string &file, int arch);
WARP_API std::string kernelText(const std::string &file);

} // namespace warp

#endif // WARP_LIBRARYCODE_H
