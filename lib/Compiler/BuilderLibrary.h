//===- BuilderLibrary.h - Calls of the device library -----------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_COMPILER_BUILDERLIBRARY_H
#define WARP_LIB_COMPILER_BUILDERLIBRARY_H

#include "BuilderImpl.h"

#include <optional>

namespace warp {

/// Builds the call of a function of the device library, whose name has a bar in
/// front, which no user writes. Nothing for any other name.
std::optional<llvm::SmallVector<mlir::Value>>
buildLibraryCall(Builder::Impl &impl, llvm::StringRef name,
                 mlir::ValueRange args);

} // namespace warp

#endif // WARP_LIB_COMPILER_BUILDERLIBRARY_H
