//===- LibraryObject.h - Level of the device library ------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Names of the machine code that Support/LibraryObjects.h describes.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H
#define WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H

#include "llvm/ADT/StringRef.h"

namespace llvm {
class MCSubtargetInfo;
} // namespace llvm

namespace warp {

/// The highest level that a processor has.
llvm::StringRef libraryLevel(const llvm::MCSubtargetInfo &processor);

} // namespace warp

#endif // WARP_LIB_TARGETS_CPU_LIBRARYOBJECT_H
