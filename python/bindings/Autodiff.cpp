//===- Autodiff.cpp - Derivatives of kernels ------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Sharing.h"

#include "Gil.h"
#include "Native.h"

#include "warp/Autodiff.h"

#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cstdlib>

namespace py = pybind11;
using namespace warp;
using warp::python::SharingCheck;

static const char *kindText(HiddenArgument::Kind kind) {
  switch (kind) {
  case HiddenArgument::Kind::Preserved:
    return "preserved";
  case HiddenArgument::Kind::Saved:
    return "saved";
  case HiddenArgument::Kind::Counters:
    return "counters";
  case HiddenArgument::Kind::Tangent:
    return "tangent";
  case HiddenArgument::Kind::Claims:
    return "claims";
  case HiddenArgument::Kind::Trips:
    return "trips";
  case HiddenArgument::Kind::Offsets:
    return "offsets";
  case HiddenArgument::Kind::Tape:
    return "tape";
  }
  return "";
}

//===----------------------------------------------------------------------===//
// Gradients that share memory
//===----------------------------------------------------------------------===//

/// True if two elements of an array are at one address, or may be: sorted by
/// stride, each dimension has to step over all smaller ones.
static bool repeatsElements(const ArrayDescriptor &array, int64_t itemSize) {
  std::array<std::pair<int64_t, int64_t>, maxRank> steps;
  size_t count = 0;
  for (int i = 0; i < array.ndim; ++i)
    if (array.shape[i] > 1)
      steps[count++] = {std::abs(int64_t(array.strides[i])), array.shape[i]};
  std::sort(steps.begin(), steps.begin() + count);
  int64_t covered = itemSize;
  for (size_t i = 0; i < count; ++i) {
    auto [stride, extent] = steps[i];
    if (stride < covered)
      return true;
    covered += stride * (extent - 1);
  }
  return false;
}

void SharingCheck::add(const ArrayDescriptor &array, const void *data,
                       int64_t itemSize) {
  const int32_t *shape = array.shape;
  if (std::find(shape, shape + array.ndim, 0) != shape + array.ndim)
    return;
  repeats |= repeatsElements(array, itemSize);
  int64_t first = reinterpret_cast<int64_t>(data), last = first;
  for (int i = 0; i < array.ndim; ++i) {
    int64_t reach = int64_t(array.strides[i]) * (array.shape[i] - 1);
    (reach < 0 ? first : last) += reach;
  }
  extents.push_back({first, last + itemSize});
}

bool SharingCheck::shares() {
  if (repeats)
    return true;
  std::sort(extents.begin(), extents.end());
  for (size_t i = 1; i < extents.size(); ++i)
    if (extents[i].first < extents[i - 1].second)
      return true;
  return false;
}

bool python::sharesElements(const std::vector<py::object> &arrays) {
  SharingCheck check;
  for (const py::object &object : arrays) {
    if (!python::isArray(object.ptr()))
      throw py::type_error("expects arrays");
    python::ArrayObject *array = python::asArray(object.ptr());
    check.add(array->descriptor, array->descriptor.data, array->itemSize);
  }
  return check.shares();
}

void python::bindAutodiff(py::module_ &m) {
  py::class_<HiddenArgument>(m, "HiddenArgument",
                             "An argument that only a derivative has.")
      .def_property_readonly(
          "kind",
          [](const HiddenArgument &hidden) { return kindText(hidden.kind); })
      .def_readonly("leaf", &HiddenArgument::leaf)
      .def_readonly("direction", &HiddenArgument::direction)
      .def_readonly("type", &HiddenArgument::type)
      .def_readonly("places", &HiddenArgument::places);
  py::class_<Derivative>(m, "Derivative", "A kernel's derivative.")
      .def_readonly("module", &Derivative::module)
      .def_readonly("augmented", &Derivative::augmented)
      .def_readonly("counting", &Derivative::counting)
      .def_readonly("hidden_of_counting", &Derivative::hiddenOfCounting)
      .def_readonly("sizing", &Derivative::sizing)
      .def_readonly("hidden_of_sizing", &Derivative::hiddenOfSizing)
      .def_readonly("recording", &Derivative::recording)
      .def_readonly("hidden_of_recording", &Derivative::hiddenOfRecording)
      .def_readonly("hidden", &Derivative::hidden)
      .def_readonly("needed", &Derivative::needed)
      .def_readonly("one_thread", &Derivative::oneThread)
      .def_readonly("notices", &Derivative::notices)
      .def_readonly("metrics", &Derivative::metrics);
  m.def(
      "differentiate",
      [](const Module &module, bool forward, int width, bool winners,
         std::vector<bool> active, const std::string &singular, bool unique,
         const std::string &tape, std::vector<bool> apart,
         std::vector<int> same, bool unrecorded) {
        AutodiffOptions options;
        options.forward = forward;
        options.width = width;
        options.winners = winners;
        options.active = std::move(active);
        options.singular = singular;
        options.unique = unique;
        options.tape = tape;
        options.apart = std::move(apart);
        options.same = std::move(same);
        options.unrecorded = unrecorded;
        warp::python::Unlocked unlocked;
        return differentiate(module, options);
      },
      py::arg("module"), py::kw_only(), py::arg("forward") = false,
      py::arg("width") = 1, py::arg("winners") = false,
      py::arg("active") = std::vector<bool>(), py::arg("singular") = "pinned",
      py::arg("unique") = true, py::arg("tape") = "checkpoints",
      py::arg("apart") = std::vector<bool>(),
      py::arg("same") = std::vector<int>(), py::arg("unrecorded") = false,
      "The derivative of a module's kernel.");
  m.def("shares_elements", sharesElements, py::arg("arrays"),
        "True if an address may belong to two elements of the arrays.");
}
