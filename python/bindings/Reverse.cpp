//===- Reverse.cpp - Reverse pass over a tape's launches ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A record whose adjoint is one launch with the arguments that it has is run
// here, if arrays that it reads are still there or were kept whole; any other
// one by Python.
//
//===----------------------------------------------------------------------===//

#include "Keeping.h"
#include "Records.h"
#include "Sharing.h"

#include <cstring>
#include <pybind11/stl.h>
#include <tuple>
#include <unordered_map>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

/// The adjoint of a record, null if it takes more than a launch.
static PyObject *plainAdjoint(Activity &activity, const RecordObject *record,
                              const LaunchRecorder &recorder, uint64_t pass) {
  if (activity.pass == pass)
    return activity.adjoint.ptr();
  size_t count = recorder.arrays.size();
  py::object apart = py::tuple();
  if (activity.apart)
    apart = flagsOf(activity.apart, count);
  py::tuple elements(count);
  for (size_t i = 0; i < count; ++i) {
    PyObject *value = record->items[recorder.arrays[i]];
    elements[i] = isArray(value) ? py::handle(asArray(value)->dtype)
                                 : py::handle(Py_None);
  }
  py::object found = py::handle(adjointQueries().plainAdjoint)(
      py::handle(record->kernel), py::handle(record->native),
      flagsOf(activity.active, count), apart, elements);
  activity.adjoint = py::object();
  if (!found.is_none()) {
    findNeeds(activity, record->kernel, recorder);
    std::tie(activity.adjoint, activity.former) =
        found.cast<std::pair<py::object, std::vector<unsigned>>>();
  }
  activity.pass = pass;
  return activity.adjoint.ptr();
}

namespace {
/// An argument whose contents of then are elsewhere now.
struct Replaced {
  size_t array;
  PyObject *contents;
};

/// An argument behind those of the launch: an array as it was before.
struct Former {
  PyObject *array;
  /// Null if that is what it still holds.
  PyObject *contents;
};
} // namespace

/// Finds what the adjoint reads and was overwritten; false if it is not all
/// there.
static bool findContents(const RecordObject *record,
                         const LaunchRecorder &recorder, ArraySet needed,
                         std::vector<Replaced> &replaced) {
  PyObject **versions = versionsOf(record);
  for (int i = 0; i < record->arrayCount; ++i) {
    if (!(needed >> i & 1) || !versions[i] || isIntact(asVersion(versions[i])))
      continue;
    PyObject *contents =
        keptContents(asVersion(versions[i]), record->items[recorder.arrays[i]]);
    if (!contents)
      return false;
    replaced.push_back({size_t(i), contents});
  }
  return true;
}

/// Finds arrays as they were before the launch; false if they are not all
/// there.
static bool findFormer(const RecordObject *record,
                       const LaunchRecorder &recorder, const Activity &activity,
                       std::vector<Former> &found) {
  for (unsigned number : activity.former) {
    PyObject *version =
        record->before && PyDict_Check(record->before)
            ? PyDict_GetItem(record->before, py::int_(number).ptr())
            : nullptr;
    if (!version)
      return false;
    PyObject *array = record->items[recorder.arrays[number]];
    PyObject *contents = nullptr;
    if (!isIntact(asVersion(version))) {
      contents = keptContents(asVersion(version), array);
      if (!contents)
        return false;
    }
    found.push_back({array, contents});
  }
  return true;
}

/// Lets the descriptor at a place in a block of parameters lead to other
/// contents.
static void replaceData(char *descriptor, PyObject *contents) {
  auto *array = reinterpret_cast<ArrayDescriptor *>(descriptor);
  array->data = asArray(contents)->descriptor.data;
  array->flags &= ~arrayFactMask;
}

/// Structs have the gradients that there were when they were copied.
static void showGradients(char *block, const RecordObject *record,
                          const LaunchRecorder &recorder) {
  for (size_t i = 0; i < recorder.fields.size(); ++i) {
    auto *array = reinterpret_cast<ArrayDescriptor *>(
        block + recorder.arrayAccesses()[i].offset);
    array->grad = asArray(record->items[recorder.arrays[i]])->descriptor.grad;
    array->flags &= ~arrayAligned;
  }
}

/// The gradients of arrays, which are there from then on.
static std::vector<py::object> gradientsOf(const LaunchRecorder &recorder,
                                           PyObject *const *values,
                                           ArraySet active) {
  static PyObject *const made = PyUnicode_InternFromString("_grad");
  static PyObject *const wanted = PyUnicode_InternFromString("grad");
  std::vector<py::object> found;
  for (size_t i = 0; i < recorder.arrays.size(); ++i) {
    if (!(active >> i & 1))
      continue;
    PyObject *value = values[recorder.arrays[i]];
    auto gradient =
        py::reinterpret_steal<py::object>(PyObject_GetAttr(value, made));
    if (gradient && gradient.is_none())
      gradient =
          py::reinterpret_steal<py::object>(PyObject_GetAttr(value, wanted));
    if (!gradient)
      throw py::error_already_set();
    found.push_back(std::move(gradient));
  }
  return found;
}

/// Runs the adjoint of a record; false, and nothing is done, if Python has to.
static bool reverseLaunch(PyObject *object, uint64_t pass) {
  if (!isRecord(object) || !asRecord(object)->recorder || capturesInProgress)
    return false;
  RecordObject *record = asRecord(object);
  auto &recorder = py::handle(record->recorder).cast<LaunchRecorder &>();
  ArraySet active = activeArrays(recorder, record->items);
  if (!active)
    return true;
  Activity &activity =
      recorder.activity(active, record->activity ? record->activity->apart : 0);
  PyObject *adjoint = plainAdjoint(activity, record, recorder, pass);
  std::vector<Replaced> replaced;
  std::vector<Former> former;
  if (!adjoint || !findContents(record, recorder, activity.needed, replaced) ||
      !findFormer(record, recorder, activity, former))
    return false;
  if (sharesElements(gradientsOf(recorder, record->items, active)))
    return false;
  Kernel &kernel = *asKernel(adjoint)->kernel;
  Block block(kernel.parameterSize());
  std::vector<py::object> keep;
  for (int i = 0; i < record->valueCount; ++i)
    asKernel(adjoint)->packer->pack(i, record->items[i], record->device,
                                    block.data(), keep);
  showGradients(block.data(), record, recorder);
  for (const Replaced &one : replaced)
    replaceData(block.data() + recorder.arrayAccesses()[one.array].offset,
                one.contents);
  for (size_t i = 0; i < former.size(); ++i) {
    size_t position = record->valueCount + i;
    asKernel(adjoint)->packer->pack(position, former[i].array, record->device,
                                    block.data(), keep);
    if (former[i].contents)
      replaceData(block.data() + kernel.parameters()[position].offset,
                  former[i].contents);
  }
  auto held = py::reinterpret_borrow<py::object>(object);
  auto code = py::reinterpret_borrow<py::object>(adjoint);
  launchPacked(kernel, record->device, readDim(kernel, record->dim),
               block.data(), nullptr, record->blockDim, [&] { return code; });
  record->pending = false;
  return true;
}

/// Runs records from the end on; the number of those that are left.
static size_t reverseLaunches(const py::list &records, size_t count,
                              uint64_t pass) {
  while (count &&
         reverseLaunch(PyList_GET_ITEM(records.ptr(), count - 1), pass))
    --count;
  return count;
}

//===----------------------------------------------------------------------===//
// Arrays of records
//===----------------------------------------------------------------------===//

namespace {
/// An array of records, and the first and last of those.
struct Use {
  py::object array;
  size_t first, last;
};
} // namespace

/// (array, position of the first record with it, of the last) of each array.
static py::list arraysOf(const py::list &records, bool written) {
  std::unordered_map<PyObject *, size_t> numbers;
  std::vector<Use> found;
  auto add = [&](PyObject *array, size_t position) {
    auto [entry, isNew] = numbers.try_emplace(array, found.size());
    if (isNew)
      found.push_back(
          {py::reinterpret_borrow<py::object>(array), position, position});
    else
      found[entry->second].last = position;
  };
  for (size_t position = 0; position < records.size(); ++position) {
    PyObject *object = PyList_GET_ITEM(records.ptr(), position);
    if (!isRecord(object) || !asRecord(object)->recorder) {
      py::object arrays =
          py::handle(object).attr(written ? "written" : "arrays")();
      for (py::handle array : arrays)
        add(array.ptr(), position);
      continue;
    }
    RecordObject *record = asRecord(object);
    auto &recorder = py::handle(record->recorder).cast<LaunchRecorder &>();
    for (size_t i = 0; i < recorder.arrays.size(); ++i)
      if (!written || (recorder.written >> i & 1))
        add(record->items[recorder.arrays[i]], position);
  }
  py::list list;
  for (const Use &use : found)
    list.append(py::make_tuple(use.array, use.first, use.last));
  return list;
}

void python::bindReverse(py::module_ &m) {
  m.def("reverse_launches", &reverseLaunches, py::arg("records"),
        py::arg("count"), py::arg("pass_number"),
        "Runs the adjoints of the last of `count` records as long as each is "
        "one launch; the number of records that are left.");
  m.def("arrays_of_records", &arraysOf, py::arg("records"), py::arg("written"),
        "(array, position of the first record with it, of the last) of each "
        "array that records have, or may write.");
}
