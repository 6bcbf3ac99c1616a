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

/// Builds what names with a bar in front stand for, which no user writes:
/// `_array_at`, and `_symbol` for a function of the device library. Nothing for
/// any other name.
std::optional<llvm::SmallVector<mlir::Value>>
buildLibraryCall(Builder::Impl &impl, llvm::StringRef name,
                 mlir::ValueRange args);

} // namespace warp

#endif // WARP_LIB_COMPILER_BUILDERLIBRARY_H
