//===- FileChecks.h - Consistency of fields of files ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Files of saved modules, saved graphs and the kernel cache have checksums,
// which damage does not pass and whoever writes a file can make. So after each
// field is known to be possible (Bytes.h), these functions ask whether places
// lie where they have to. They say what is wrong first, or nothing.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_FILECHECKS_H
#define WARP_LIB_RUNTIME_FILECHECKS_H

#include "warp/Compile.h"
#include "warp/Launch.h"

#include <cstdint>
#include <string>
#include <vector>

namespace warp {

/// Largest parameter block that a file may ask for.
inline constexpr int64_t mostParameterBytes = int64_t(1) << 24;

/// Bytes of the parameter block with these arguments.
size_t parameterBytes(const std::vector<Param> &params);

/// Arguments lie in their block, arrays in their argument, and accesses are
/// those of all arrays.
std::string problemOf(const std::vector<Param> &params,
                      const std::vector<Access> &accesses);

/// Words that may be ids lie in the parameter block, which has so many bytes,
/// or in elements of those arrays; what is stored lies in elements.
std::string problemOf(const std::vector<IdFlow> &flows,
                      const std::vector<Access> &accesses, size_t paramSize);

/// The code is about arrays among these arguments, whose block has so many
/// bytes.
std::string problemOf(const Code &code, const std::vector<Param> &params,
                      size_t paramSize);

} // namespace warp

#endif // WARP_LIB_RUNTIME_FILECHECKS_H
