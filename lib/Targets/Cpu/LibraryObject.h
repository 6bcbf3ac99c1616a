//===- LibraryObject.h - Machine code of the device library -----*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Searches and the algebra of tiles are long, and the same for every kernel:
// they are compiled when the library is built, once for each of a few levels of
// x86-64, so that a first launch waits for the kernel's own code alone.
// Kernels, saved ones too, ask for `warp_mesh_ray.v4` when they are loaded.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H
#define WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H

#include "llvm/ADT/ArrayRef.h"
#include "llvm/ADT/StringRef.h"

namespace llvm {
class MCSubtargetInfo;
} // namespace llvm

namespace warp {

/// A relocatable object, and the level that follows a dot in names from there.
/// Functions have the same bits on all levels.
struct LibraryObject {
  llvm::StringRef level, bytes;
};

/// From the lowest level to the highest.
llvm::ArrayRef<LibraryObject> libraryObjects();

/// The highest level that a processor has.
llvm::StringRef libraryLevel(const llvm::MCSubtargetInfo &processor);

} // namespace warp

#endif // WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H
