//===- XlaCallback.cpp - Python functions as calls of XLA -----------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// As in XlaFfi.cpp the attribute `call` names an entry of a table, here of
// Python functions. XLA calls on threads of its own; the function gets device,
// stream, and the address and extents of each buffer.
//
//===----------------------------------------------------------------------===//

#include "XlaCall.h"

#include "warp/Device.h"

#include <unordered_map>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

/// Guarded by Python's lock; never released, as XLA keeps its programs.
static std::unordered_map<int64_t, py::object> &callbacks() {
  static auto *table = new std::unordered_map<int64_t, py::object>;
  return *table;
}

static py::list listBuffers(const xla::Buffers &buffers) {
  py::list result;
  for (int64_t i = 0; i < buffers.count; ++i) {
    const xla::Buffer &buffer = *buffers.items[i];
    py::tuple extents(buffer.rank);
    for (int64_t axis = 0; axis < buffer.rank; ++axis)
      extents[axis] = buffer.extents[axis];
    result.append(
        py::make_tuple(reinterpret_cast<uintptr_t>(buffer.data), extents));
  }
  return result;
}

static void callPython(const xla::Frame &frame, CallPlace place) {
  py::gil_scoped_acquire lock;
  auto found = callbacks().find(callNumber(frame.attributes));
  if (found == callbacks().end())
    fail("the program was traced in another process");
  found->second(place.device, reinterpret_cast<uintptr_t>(place.stream),
                listBuffers(frame.arguments), listBuffers(frame.results));
}

void python::bindXlaCallback(py::module_ &m) {
  m.def(
      "xla_add_callback",
      [](int64_t number, py::object function) {
        return callbacks().try_emplace(number, std::move(function)).second;
      },
      py::arg("number"), py::arg("function"),
      "Makes a function known to XLA's calls under a number; false if there "
      "is one.");
  m.def(
      "xla_callback_handlers",
      [] {
        return py::make_tuple(handlerCapsule(handle<callPython, false>),
                              handlerCapsule(handle<callPython, true>),
                              handlerCapsule(handle<callPython, true, true>));
      },
      "The functions that XLA calls: for the CPU, for CUDA, for CUDA where XLA "
      "may record the call in a graph.");
}
