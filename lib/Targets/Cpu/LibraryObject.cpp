//===- LibraryObject.cpp - Level of the device library --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryObject.h"

#include "llvm/MC/MCSubtargetInfo.h"

llvm::StringRef warp::libraryLevel(const llvm::MCSubtargetInfo &processor) {
#ifdef __aarch64__
  return "v8";
#else
  if (!processor.checkFeatures("+avx2,+bmi,+bmi2,+f16c,+fma,+lzcnt,+movbe"))
    return "v1";
  return processor.checkFeatures(
             "+avx512f,+avx512bw,+avx512cd,+avx512dq,+avx512vl")
             ? "v4"
             : "v3";
#endif
}
