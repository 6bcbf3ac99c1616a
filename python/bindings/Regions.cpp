//===- Regions.cpp - Access regions of launches, for the tape -------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Keeping.h"
#include "LaunchCall.h"
#include "RegionFinder.h"
#include "Versions.h"

#include <pybind11/stl.h>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

static Region regionOf(const py::object &object) {
  if (!isArray(object.ptr()))
    throw py::type_error("expects an array");
  Region region;
  ArrayObject *array = asArray(object.ptr());
  region.add(blockOf(array->descriptor, array->itemSize));
  return region;
}

/// (address, shape, strides) of each block.
static py::list partsOf(const Region &region) {
  py::list parts;
  for (const MemoryBlock &block : region.blocks) {
    py::tuple shape(std::max(block.rank, 1)), strides(std::max(block.rank, 1));
    shape[0] = 1;
    strides[0] = block.item;
    for (int i = 0; i < block.rank; ++i) {
      shape[i] = block.dims[i].count;
      strides[i] = block.dims[i].stride * block.dims[i].step;
    }
    parts.append(py::make_tuple(block.start, shape, strides));
  }
  return parts;
}

//===----------------------------------------------------------------------===//
// Launches
//===----------------------------------------------------------------------===//

Region LaunchRegions::touched(size_t array) const {
  Region region = arrays.at(array).read;
  for (const MemoryBlock &block : arrays.at(array).written.blocks)
    region.add(block);
  return region;
}

std::vector<std::pair<size_t, size_t>> LaunchRegions::meetings() const {
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i < arrays.size(); ++i)
    for (size_t j = 0; j < arrays.size(); ++j)
      if (i != j && (arrays[i].written.overlaps(arrays[j].written) ||
                     arrays[i].written.overlaps(arrays[j].read)))
        pairs.emplace_back(i, j);
  return pairs;
}

std::vector<bool> LaunchRegions::apart() const {
  std::vector<bool> flags;
  for (const ArrayRegions &array : arrays)
    flags.push_back(!array.read.blocks.empty() &&
                    !array.written.blocks.empty() &&
                    !array.read.overlaps(array.written));
  return flags;
}

RegionFinder::RegionFinder(py::object object) : owner(std::move(object)) {
  if (Py_TYPE(owner.ptr()) != kernelType)
    throw py::type_error("expects a kernel");
  const Module &module = asKernel(owner.ptr())->kernel->module();
  py::gil_scoped_release unlocked;
  known = accesses(module);
  formula = regionFormula(module);
}

std::unique_ptr<LaunchRegions> RegionFinder::find(const py::object &dim,
                                                  const py::object &values,
                                                  int device) const {
  KernelObject *object = asKernel(owner.ptr());
  Items items(values.ptr());
  Block block(object->kernel->parameterSize());
  std::vector<py::object> keep;
  packArguments(*object->packer, items, Items(nullptr), device, block.data(),
                keep);
  auto regions = std::make_unique<LaunchRegions>();
  findRegions(formula, known, readDim(*object->kernel, dim.ptr()), block.data(),
              regions->arrays);
  return regions;
}

//===----------------------------------------------------------------------===//
// Python
//===----------------------------------------------------------------------===//

static void bindRegion(py::module_ &m) {
  py::class_<Region>(m, "Region", "Elements of arrays, as memory.")
      .def(py::init([](const py::object &array) { return regionOf(array); }),
           py::arg("array"), "All elements of an array.")
      .def("shared", &Region::shared, py::arg("other"),
           "The elements that share bytes with another region.")
      .def("is_within", &Region::isWithin, py::arg("other"),
           "True if all elements are known to be in another region.")
      .def("overlaps", &Region::overlaps, py::arg("other"),
           "True if two regions share a byte; may say so of strides that do "
           "not nest.")
      .def("parts", &partsOf, "(address, shape, strides) of each block.")
      .def_property_readonly("bytes", &Region::bytes)
      .def("__len__", [](const Region &region) { return region.blocks.size(); })
      .def("__eq__", &Region::operator==);
  py::class_<LaunchRegions>(m, "LaunchRegions",
                            "Memory that a launch may access.")
      .def("read", [](const LaunchRegions &launch,
                      size_t i) { return launch.arrays.at(i).read; })
      .def("written", [](const LaunchRegions &launch,
                         size_t i) { return launch.arrays.at(i).written; })
      .def("all_written",
           [](const LaunchRegions &launch) {
             std::vector<Region> regions;
             for (const ArrayRegions &array : launch.arrays)
               if (!array.written.blocks.empty())
                 regions.push_back(array.written);
             return regions;
           })
      .def("touched", &LaunchRegions::touched)
      .def("meetings", &LaunchRegions::meetings,
           "Pairs (written, other) of different arrays that meet.")
      .def("apart", &LaunchRegions::apart,
           "Arrays of which no element is both read and written.");
}

void python::bindRegions(py::module_ &m) {
  bindRegion(m);
  bindVersions(m);
  bindKeeping(m);
  bindRecords(m);
  py::class_<RegionFinder>(m, "RegionFinder",
                           "Finds the memory that a kernel accesses.")
      .def(py::init<py::object>(), py::arg("kernel"))
      .def("find", &RegionFinder::find, py::arg("dim"), py::arg("values"),
           py::arg("device"), "The memory that a launch may read and write.");
}
