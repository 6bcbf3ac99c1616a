//===- Sharing.h - Arrays that share memory ---------------------*- C++ -*-===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#ifndef WARP_PYTHON_BINDINGS_SHARING_H
#define WARP_PYTHON_BINDINGS_SHARING_H

#include "warp/Launch.h"

#include <pybind11/pybind11.h>

#include <utility>
#include <vector>

namespace warp::python {

/// Finds out if an address may belong to two elements of some arrays. Not
/// exact: arrays whose elements interleave count as sharing.
class SharingCheck {
public:
  SharingCheck() { extents.reserve(16); }
  /// The elements of an array, or those of another one of its layout at `data`.
  void add(const ArrayDescriptor &array, const void *data, int64_t itemSize);
  bool shares();

private:
  /// First byte and end of the elements of each.
  std::vector<std::pair<int64_t, int64_t>> extents;
  bool repeats = false;
};

/// True if an address may belong to two elements of some arrays.
bool sharesElements(const std::vector<pybind11::object> &arrays);

} // namespace warp::python

#endif // WARP_PYTHON_BINDINGS_SHARING_H
