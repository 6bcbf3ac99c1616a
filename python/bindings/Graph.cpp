//===- Graph.cpp - Graphs and captures for Python -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The runtime keeps alive what is freed during a capture. Arrays and kernels
// that outlive the capture, but not the graph, are Python's business: while
// captures are in progress, launches, copies and fills put what they use on
// the list of each capture on that device, which the graph inherits.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "Native.h"

#include "warp/Graph.h"

#include <algorithm>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

int python::capturesInProgress = 0;

namespace {

class PyGraph {
public:
  PyGraph(std::shared_ptr<Graph> graph, std::vector<py::object> held)
      : held(std::move(held)), graph(std::move(graph)) {}

  void launch(const Stream *stream) {
    if (graph->isShort())
      return graph->launch(stream);
    warp::python::Unlocked unlocked;
    graph->launch(stream);
  }

  /// Goes last.
  std::vector<py::object> held;
  std::shared_ptr<Graph> graph;
};

class PyCapture;
std::vector<PyCapture *> captures;

class PyCapture {
public:
  PyCapture(int device, std::shared_ptr<Stream> stream, int mode, bool external)
      : capture(Capture::begin(device, std::move(stream),
                               static_cast<CaptureMode>(mode), external)) {
    captures.push_back(this);
    ++capturesInProgress;
  }
  ~PyCapture() { close(); }

  Capture &get() {
    if (!capture)
      throw Error(Error::Kind::Runtime, "the capture has ended already");
    return *capture;
  }

  std::unique_ptr<PyGraph> end() {
    std::shared_ptr<Graph> graph;
    try {
      graph = get().end();
    } catch (...) {
      close();
      throw;
    }
    std::vector<py::object> kept = std::move(held);
    close();
    return std::make_unique<PyGraph>(std::move(graph), std::move(kept));
  }

  void close() {
    if (!capture)
      return;
    capturesInProgress -= 1;
    captures.erase(std::find(captures.begin(), captures.end(), this));
    capture.reset();
    held.clear();
  }

  std::unique_ptr<Capture> capture;
  std::vector<py::object> held;
};

} // namespace

void python::holdForCaptures(int device, PyObject *pointer) {
  auto object = py::reinterpret_borrow<py::object>(pointer);
  // The fields of a struct may be given other arrays later.
  py::object fields;
  if (py::hasattr(object, "_wp_fields_") && !py::isinstance<py::type>(object))
    fields = py::tuple(object.attr("arrays")());
  for (PyCapture *capture : captures) {
    if (capture->get().device() != device)
      continue;
    capture->held.push_back(object);
    if (fields)
      capture->held.push_back(fields);
  }
}

static const int32_t *conditionOf(const py::object &object, int device) {
  if (!isArray(object.ptr()) || asArray(object.ptr())->device != device)
    throw Error(Error::Kind::LaunchType,
                "expects an array on the device that is captured");
  return static_cast<const int32_t *>(asArray(object.ptr())->descriptor.data);
}

void python::bindGraph(py::module_ &m) {
  py::class_<PyGraph>(m, "Graph", "Recorded work.")
      .def_property_readonly(
          "device_index", [](PyGraph &self) { return self.graph->device(); })
      .def_property_readonly("node_count",
                             [](PyGraph &self) { return self.graph->size(); })
      .def("launch", &PyGraph::launch, py::arg("stream") = nullptr)
      .def(
          "write_dot",
          [](PyGraph &self, const std::string &path, bool verbose) {
            self.graph->writeDot(path, verbose);
          },
          py::arg("path"), py::arg("verbose") = false);
  py::class_<PyCapture>(m, "Capture", "A recording in progress.")
      .def(py::init<int, std::shared_ptr<Stream>, int, bool>(),
           py::arg("device"), py::arg("stream") = nullptr, py::arg("mode") = 1,
           py::arg("external") = false)
      .def("end", &PyCapture::end, "The graph of what was recorded.")
      .def("abandon", &PyCapture::close)
      .def("hold",
           [](PyCapture &self, py::object object) {
             self.held.push_back(std::move(object));
           })
      .def("add_condition",
           [](PyCapture &self, py::object value, bool negated) {
             auto *address = conditionOf(value, self.get().device());
             self.held.push_back(value);
             return self.get().addCondition(address, negated);
           })
      .def("update_condition",
           [](PyCapture &self, uint64_t condition, py::object value,
              bool negated) {
             auto *address = conditionOf(value, self.get().device());
             self.get().updateCondition(condition, address, negated);
           })
      .def("begin_body",
           [](PyCapture &self, uint64_t condition, bool loop) {
             self.get().beginBody(condition, loop);
           })
      .def("end_body", [](PyCapture &self) { self.get().endBody(); });
  m.def(
      "is_capturing", [](int device) { return isCapturing(device); },
      py::arg("device"), "Whether work for a device is being recorded.");
  m.def("supports_conditional_graphs", &supportsConditionalGraphs);
}
