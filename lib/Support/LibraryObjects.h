//===- LibraryObjects.h - Machine code of the device library ----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Searches and the algebra of tiles are long, and the same for every kernel:
// they are compiled when the library is built, once for each of a few levels of
// x86-64, so that a first launch waits for the kernel's own code alone.
// Kernels, saved ones too, ask for `warp_mesh_ray.v4` when they are loaded.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_SUPPORT_LIBRARYOBJECTS_H
#define WARP_LIB_SUPPORT_LIBRARYOBJECTS_H

#include <array>
#include <string_view>

namespace warp {

/// A relocatable object, and the level that follows a dot in names from there.
/// Functions have the same bits on all levels.
struct LibraryObject {
  std::string_view level, bytes;
};

/// From the lowest level to the highest.
std::array<LibraryObject, 3> libraryObjects();

} // namespace warp

#endif // WARP_LIB_SUPPORT_LIBRARYOBJECTS_H
