//===- LibraryObject.cpp - Machine code of the device library -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryObject.h"

#include "llvm/MC/MCSubtargetInfo.h"

// lib/DeviceLib/CMakeLists.txt makes them.
#define WARP_LEVEL(level)                                                      \
  extern "C" const char warp_devicelib_##level##_begin[],                      \
      warp_devicelib_##level##_end[];
WARP_LEVEL(v1)
WARP_LEVEL(v3)
WARP_LEVEL(v4)
#undef WARP_LEVEL

llvm::ArrayRef<warp::LibraryObject> warp::libraryObjects() {
  auto bytes = [](const char *begin, const char *end) {
    return llvm::StringRef(begin, size_t(end - begin));
  };
  static const LibraryObject objects[] = {
      {"v1", bytes(warp_devicelib_v1_begin, warp_devicelib_v1_end)},
      {"v3", bytes(warp_devicelib_v3_begin, warp_devicelib_v3_end)},
      {"v4", bytes(warp_devicelib_v4_begin, warp_devicelib_v4_end)}};
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
