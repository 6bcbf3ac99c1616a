//===- Version.h - Version of this build ------------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_VERSION_H
#define WARP_VERSION_H

#include "warp/Export.h"

#include <string>

namespace warp {

/// The release of the package, such as "1.19.0".
WARP_API const char *version();

/// Hexadecimal digits that differ between any two builds whose machine code
/// differs: the linker's build id of the library (or program) holding this
/// function. Cache keys contain it.
WARP_API const std::string &buildId();

} // namespace warp

#endif // WARP_VERSION_H
