//===- LibraryObjects.cpp - Machine code of the device library ------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "LibraryObjects.h"

#include "Embedded.h"

// lib/DeviceLib/CMakeLists.txt makes them.
WARP_EMBEDDED(devicelib_v1)
WARP_EMBEDDED(devicelib_v3)
WARP_EMBEDDED(devicelib_v4)

std::array<warp::LibraryObject, 3> warp::libraryObjects() {
  return {
      {{"v1", devicelib_v1()}, {"v3", devicelib_v3()}, {"v4", devicelib_v4()}}};
}
