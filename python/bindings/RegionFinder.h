//===- RegionFinder.h - Access regions of launches --------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_REGIONFINDER_H
#define WARP_PYTHON_BINDINGS_REGIONFINDER_H

#include "KernelObject.h"

#include "warp/RegionMap.h"

#include <memory>
#include <utility>
#include <vector>

namespace warp::python {

/// The access regions of a launch, by array.
struct LaunchRegions {
  std::vector<ArrayRegions> arrays;

  Region touched(size_t array) const;
  /// Pairs (written, other) of different arrays that overlap.
  std::vector<std::pair<size_t, size_t>> meetings() const;
  /// Arrays of which no element is both read and written.
  std::vector<bool> apart() const;
};

/// The access regions of launches of one kernel.
class RegionFinder {
public:
  explicit RegionFinder(pybind11::object object);
  std::unique_ptr<LaunchRegions> find(const pybind11::object &dim,
                                      const pybind11::object &values,
                                      int device) const;
  /// The same of arguments that are packed.
  void findPacked(const LaunchDim &dim, const void *params,
                  LaunchRegions &regions) const {
    findRegions(formula, known, dim, params, regions.arrays);
  }
  KernelObject *kernel() const { return asKernel(owner.ptr()); }
  const std::vector<Access> &arrayAccesses() const { return known; }

private:
  pybind11::object owner;
  std::vector<Access> known;
  RegionFormula formula;
};

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_REGIONFINDER_H
