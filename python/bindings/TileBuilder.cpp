//===- TileBuilder.cpp - The builder of tiles in Python -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One to one with "warp/TileBuilder.h"; options are keywords, and so are flags
// of the operation's record.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include "warp/TileBuilder.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;

static TileOptions toOptions(const py::kwargs &given) {
  TileOptions options;
  for (auto [key, value] : given) {
    auto name = key.cast<std::string>();
    if (name == "kind")
      options.kind = value.cast<std::string>();
    else if (name == "shape")
      options.shape = value.cast<std::vector<int64_t>>();
    else if (name == "element")
      options.element = value.cast<Type>();
    else if (name == "axes")
      options.axes = value.cast<std::vector<int64_t>>();
    else if (name == "axis" && !value.is_none())
      options.axis = value.cast<int64_t>();
    else if (name == "checked")
      options.checked = value.cast<bool>();
    else if (name == "picked")
      options.picked = value.cast<bool>();
    else if (name == "where")
      options.where = value.cast<bool>();
    else if (name == "path")
      options.path = value.cast<std::vector<std::string>>();
    else if (name == "axis")
      continue;
    else if (!py::isinstance<py::bool_>(value))
      throw py::type_error("no option '" + name + "'");
    else if (value.cast<bool>())
      options.flags.push_back(name);
  }
  return options;
}

void bindTileBuilder(py::module_ &m) {
  py::class_<TileBuilder>(m, "TileBuilder", "Builds what blocks of threads do.")
      .def(py::init<Builder &>(), py::keep_alive<1, 2>())
      .def("make",
           [](TileBuilder &b, const std::string &name,
              const Builder::Values &operands, const py::kwargs &options) {
             return b.make(name, operands, toOptions(options));
           })
      .def("begin_function", &TileBuilder::beginFunction, py::arg("operands"),
           py::arg("fold") = false)
      .def("end_function",
           [](TileBuilder &b, const Builder::Values &elements,
              const py::kwargs &options) {
             return b.endFunction(elements, toOptions(options));
           })
      .def("add_barrier", &TileBuilder::addBarrier)
      .def("set_block_threads", &TileBuilder::setBlockThreads,
           py::arg("threads"), py::arg("ragged") = false)
      .def("mark_stays", &TileBuilder::markStays, py::arg("is_else"));
  m.def(
      "rank_of_warp_blocks", &rankOfWarpBlocks, py::arg("module"),
      "Indices that a kernel asks for whose blocks can be of one warp, or 0.");
}
