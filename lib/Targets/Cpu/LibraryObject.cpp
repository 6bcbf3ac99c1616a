//===- LibraryObject.cpp - Machine code of the device library -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryObject.h"

#include "Compiler/Embedded.h"

#include "llvm/MC/MCSubtargetInfo.h"

// lib/DeviceLib/CMakeLists.txt makes them.
WARP_EMBEDDED(devicelib_v1)
WARP_EMBEDDED(devicelib_v3)
WARP_EMBEDDED(devicelib_v4)

llvm::ArrayRef<warp::LibraryObject> warp::libraryObjects() {
  static const LibraryObject objects[] = {
      {"v1", devicelib_v1()}, {"v3", devicelib_v3()}, {"v4", devicelib_v4()}};
  return objects;
}

llvm::StringRef warp::libraryLevel(const llvm::MCSubtargetInfo &processor) {
  if (!processor.checkFeatures("+avx2,+bmi,+bmi2,+f16c,+fma,+lzcnt,+movbe"))
    return "v1";
  return processor.checkFeatures(
             "+avx512f,+avx512bw,+avx512cd,+avx512dq,+avx512vl")
             ? "v4"
             : "v3";
}
