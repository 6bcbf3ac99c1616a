//===- LibraryObjects.cpp - Machine code of the device library ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryObjects.h"

#include "Embedded.h"

// lib/DeviceLib/CMakeLists.txt makes them.
#ifdef __aarch64__
WARP_EMBEDDED(devicelib_v8)

std::vector<warp::LibraryObject> warp::libraryObjects() {
  return {{"v8", devicelib_v8()}};
}
#else
WARP_EMBEDDED(devicelib_v1)
WARP_EMBEDDED(devicelib_v3)
WARP_EMBEDDED(devicelib_v4)

std::vector<warp::LibraryObject> warp::libraryObjects() {
  return {
      {"v1", devicelib_v1()}, {"v3", devicelib_v3()}, {"v4", devicelib_v4()}};
}
#endif
