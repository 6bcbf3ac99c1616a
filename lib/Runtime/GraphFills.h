//===- GraphFills.h - Fills of a graph that are one node --------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_GRAPHFILLS_H
#define WARP_LIB_RUNTIME_GRAPHFILLS_H

#include <cstdint>
#include <optional>

namespace warp {

struct GraphOperation;

/// Memory that a fill writes.
struct FillRegion {
  uint64_t begin = 0, end = 0;
  /// The bytes at an address that 16 divides; they repeat from there.
  char pattern[16] = {};
};

/// None if the bytes of the fill do not repeat every 16.
std::optional<FillRegion> fillRegionOf(const GraphOperation &fill);

/// Fills that are one node, at most.
inline constexpr size_t mostFills = 64;

} // namespace warp

#endif // WARP_LIB_RUNTIME_GRAPHFILLS_H
