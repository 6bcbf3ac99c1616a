//===- LibraryObjects.h - Machine code of the device library ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Searches and the algebra of tiles are long, and the same for every kernel:
// they are compiled when the library is built, once for each of a few levels of
// x86-64 (for aarch64 there is one), so that a first launch waits for the
// kernel's own code alone. Kernels, saved ones too, ask for `warp_mesh_ray.v4`
// when they are loaded.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_SUPPORT_LIBRARYOBJECTS_H
#define WARP_LIB_SUPPORT_LIBRARYOBJECTS_H

#include <string_view>
#include <vector>

namespace warp {

/// A relocatable object, and the level that follows a dot in names from there.
/// Functions have the same bits on all levels.
struct LibraryObject {
  std::string_view level, bytes;
};

/// From the lowest level to the highest.
std::vector<LibraryObject> libraryObjects();

} // namespace warp

#endif // WARP_LIB_SUPPORT_LIBRARYOBJECTS_H
