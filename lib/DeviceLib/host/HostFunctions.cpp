//===- HostFunctions.cpp - Functions for tiles, for a level of x86-64 -----===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Compiled once for each level, with WARP_HOST_TABLE as the name of its table
// and WARP_WIDE_REGISTERS as what kernels' compiler says otherwise.
//
//===----------------------------------------------------------------------===//

#include "DeviceLib/host/HostFunctions.h"

#define WARP_TILES static
#include "DeviceLib/cpu/TileFactors.cpp"
#include "DeviceLib/cpu/TileProducts.cpp"
#include "DeviceLib/cpu/TileSorts.cpp"
#include "DeviceLib/cpu/TileTransforms.cpp"

#define WARP_HOST_ENTRY(name) {#name, reinterpret_cast<void (*)()>(&name)},
extern "C" const warp::HostFunction WARP_HOST_TABLE[warpHostFunctionCount] = {
    WARP_HOST_FUNCTIONS(WARP_HOST_ENTRY)};
