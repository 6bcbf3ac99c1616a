//===- RegionValues.h - Integers of a formula at a launch -------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_LIB_RUNTIME_REGIONVALUES_H
#define WARP_LIB_RUNTIME_REGIONVALUES_H

#include "warp/Kernel.h"
#include "warp/Regions.h"

#include <cstdint>
#include <vector>

namespace warp {

/// The values of a formula's nodes at a launch.
class RegionValues {
public:
  RegionValues(const RegionFormula &formula, const LaunchDim &dim,
               const void *params);
  RegionValues(const RegionValues &) = delete;
  RegionValues &operator=(const RegionValues &) = delete;
  int64_t operator[](int32_t node) const { return data[node]; }

private:
  int64_t evaluate(const RegionFormula::Node &node, const LaunchDim &dim,
                   const char *params) const;

  int64_t local[64];
  std::vector<int64_t> more;
  int64_t *data = local;
};

} // namespace warp

#endif // WARP_LIB_RUNTIME_REGIONVALUES_H
