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

#include "warp/Fusion.h"
#include "warp/Graph.h"
#include "warp/SavedGraph.h"

#include <algorithm>
#include <pybind11/stl.h>

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
  PyCapture(int device, std::shared_ptr<Stream> stream, int mode, bool external,
            bool traced, int order)
      : capture(Capture::begin(device, std::move(stream),
                               static_cast<CaptureMode>(mode), external, traced,
                               static_cast<NodeOrder>(order))) {
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

  void endBodies(size_t left) {
    for (; capture && depth > left; --depth)
      capture->endBody();
  }

  std::unique_ptr<Capture> capture;
  std::vector<py::object> held;
  size_t depth = 0;
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

//===----------------------------------------------------------------------===//
// Graphs in files
//===----------------------------------------------------------------------===//

static size_t bytesOf(const ArrayObject &array) {
  size_t bytes = array.itemSize;
  for (int i = 0; i < array.descriptor.ndim; ++i)
    bytes *= array.descriptor.shape[i];
  return bytes;
}

static const ArrayObject &packedArray(const std::string &name,
                                      const py::object &object) {
  if (!isArray(object.ptr()))
    throw Error(Error::Kind::Type, "expects an array for '" + name +
                                       "', but got '" +
                                       Py_TYPE(object.ptr())->tp_name + "'");
  const ArrayObject &array = *asArray(object.ptr());
  if (!array.isContiguous())
    throw Error(Error::Kind::Value, "expects a contiguous array for '" + name +
                                        "', but got one with strides");
  return array;
}

static void saveGraphTo(PyGraph &self, const std::string &path,
                        const std::map<std::string, py::object> &arrays) {
  std::vector<NamedMemory> names;
  for (const auto &[name, object] : arrays) {
    const ArrayObject &array = packedArray(name, object);
    if (array.device != self.graph->device())
      throw Error(Error::Kind::Value,
                  "array '" + name + "' is on another device than the graph");
    names.push_back({name, array.descriptor.data, bytesOf(array)});
  }
  warp::python::Unlocked unlocked;
  saveGraph(*self.graph, path, names);
}

static py::object
scheduleOf(const std::shared_ptr<const GraphSchedule> &schedule) {
  if (!schedule)
    return py::none();
  py::list nodes;
  for (const GraphSchedule::Node &node : schedule->nodes) {
    py::dict before;
    for (const GraphSchedule::Edge &edge : node.before)
      before[py::int_(edge.from)] = edge.reason;
    nodes.append(py::dict(
        py::arg("name") = node.name, py::arg("branch") = node.branch,
        py::arg("threads") = node.threads, py::arg("bytes") = node.bytes,
        py::arg("barrier") = node.barrier, py::arg("before") = before,
        py::arg("body") = scheduleOf(node.body),
        py::arg("parts") = py::tuple(py::cast(node.parts)),
        py::arg("apart") = node.apart));
  }
  return py::dict(
      py::arg("nodes") = nodes, py::arg("branches") = schedule->branches,
      py::arg("recorded_edges") = schedule->recordedEdges,
      py::arg("edges") = schedule->edges, py::arg("kept") = schedule->kept);
}

static std::map<std::string, size_t> sizesOf(const LoadedGraph &self) {
  std::map<std::string, size_t> sizes;
  for (const std::string &name : self.names())
    sizes[name] = self.bytes(name);
  return sizes;
}

static void bindLoadedGraph(py::module_ &m) {
  py::class_<LoadedGraph, std::shared_ptr<LoadedGraph>>(m, "LoadedGraph",
                                                        "A graph from a file.")
      .def_static(
          "load",
          [](const std::string &path, int device, uint64_t mostBytes) {
            warp::python::Unlocked unlocked;
            return LoadedGraph::load(path, device, mostBytes);
          },
          py::arg("path"), py::arg("device"),
          py::arg("most_bytes") = UINT64_MAX)
      .def_static(
          "from_bytes",
          [](const py::bytes &graph,
             const std::map<std::string, py::bytes> &modules, int device,
             const std::string &origin, uint64_t mostBytes) {
            GraphFiles files;
            files.graph = std::string(graph);
            for (const auto &[name, bytes] : modules)
              files.modules[name] = std::string(bytes);
            warp::python::Unlocked unlocked;
            return LoadedGraph::fromFiles(files, device, origin, mostBytes);
          },
          py::arg("graph"), py::arg("modules"), py::arg("device"),
          py::arg("origin"), py::arg("most_bytes") = UINT64_MAX)
      .def_property_readonly("device_index", &LoadedGraph::device)
      .def_property_readonly(
          "node_count", [](LoadedGraph &self) { return self.graph().size(); })
      .def(
          "launch",
          [](LoadedGraph &self, const Stream *stream) {
            warp::python::Unlocked unlocked;
            self.launch(stream);
          },
          py::arg("stream") = nullptr)
      .def(
          "write_dot",
          [](LoadedGraph &self, const std::string &path, bool verbose) {
            self.graph().writeDot(path, verbose);
          },
          py::arg("path"), py::arg("verbose") = false)
      .def_property_readonly("sizes", sizesOf, "Bytes of each named array.")
      .def("data",
           [](LoadedGraph &self, const std::string &name) {
             return reinterpret_cast<uint64_t>(self.data(name));
           })
      .def("set",
           [](LoadedGraph &self, const std::string &name,
              const py::object &object) {
             const ArrayObject &array = packedArray(name, object);
             self.set(name, array.descriptor.data, bytesOf(array),
                      array.device);
           })
      .def("get", [](LoadedGraph &self, const std::string &name,
                     const py::object &object) {
        const ArrayObject &array = packedArray(name, object);
        self.get(name, array.descriptor.data, bytesOf(array), array.device);
      });
  m.def("save_graph", saveGraphTo, py::arg("graph"), py::arg("path"),
        py::arg("arrays"), "Writes a graph that was captured with `traced`.");
}

void python::bindGraph(py::module_ &m) {
  py::class_<PyGraph>(m, "Graph", "Recorded work.")
      .def_property_readonly("device_index",
                             [](PyGraph &self) { return self.graph->device(); })
      .def_property_readonly("node_count",
                             [](PyGraph &self) { return self.graph->size(); })
      .def_property_readonly(
          "provisional_launches",
          [](PyGraph &self) { return self.graph->provisionalLaunches(); },
          "Launches whose code was compiled quickly and will be exchanged.")
      .def_property_readonly(
          "traced",
          [](PyGraph &self) { return self.graph->trace() != nullptr; },
          "True if it can be saved.")
      .def(
          "schedule",
          [](PyGraph &self) { return scheduleOf(self.graph->schedule()); },
          "The order of its nodes as dictionaries; None without.")
      .def("launch", &PyGraph::launch, py::arg("stream") = nullptr)
      .def(
          "write_dot",
          [](PyGraph &self, const std::string &path, bool verbose) {
            self.graph->writeDot(path, verbose);
          },
          py::arg("path"), py::arg("verbose") = false);
  py::class_<PyCapture>(m, "Capture", "A recording in progress.")
      .def(py::init<int, std::shared_ptr<Stream>, int, bool, bool, int>(),
           py::arg("device"), py::arg("stream") = nullptr, py::arg("mode") = 1,
           py::arg("external") = false, py::arg("traced") = false,
           py::arg("order") = 0)
      .def("end", &PyCapture::end, "The graph of what was recorded.")
      .def("abandon", &PyCapture::close)
      .def_readonly("held", &PyCapture::held,
                    "Objects that were used so far: of launches the kernel "
                    "and then its arguments.")
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
             ++self.depth;
           })
      .def(
          "end_bodies",
          [](PyCapture &self, size_t depth) { self.endBodies(depth); },
          py::arg("depth"), "Ends bodies until so many are open.")
      .def(
          "add_host",
          [](PyCapture &self, py::object function, const std::string &name) {
            // The graph holds the function.
            self.held.push_back(function);
            PyObject *target = function.ptr();
            self.get().addHost(
                [target] {
                  py::gil_scoped_acquire locked;
                  py::reinterpret_borrow<py::object>(target)();
                },
                name);
          },
          py::arg("function"), py::arg("name"),
          "Calls a function without arguments at this point of each replay.")
      .def(
          "note_other",
          [](PyCapture &self, std::string what) {
            self.get().noteOther(std::move(what));
          },
          py::arg("what"), "Another library adds work: no saving.")
      .def_readonly("depth", &PyCapture::depth, "How many bodies are open.");
  m.def(
      "is_capturing", [](int device) { return isCapturing(device); },
      py::arg("device"), "True if work for a device is being recorded.");
  m.def("supports_conditional_graphs", &supportsConditionalGraphs);
  m.def("set_fuses_launches", &setFusesLaunches, py::arg("fuses"));
  m.def("set_fuses_rows", &setFusesRows, py::arg("fuses"));
  m.def("set_fuses_rows_on_host", &setFusesRowsOnHost, py::arg("fuses"),
        "For tests: blocks of a CPU run rows, too.");
  bindLoadedGraph(m);
}
