//===- AdjointLaunch.cpp - Adjoints of ordinary launches from Python ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// `wp.launch(..., adjoint=True)` of a launch whose adjoint takes the same
// arguments is packed and run here once Python has found that adjoint. Python
// takes over, and nothing is done, where arrays share memory, gradients are to
// be made first or kept, or the launch names gradients of its own.
//
//===----------------------------------------------------------------------===//

#include "Records.h"
#include "Sharing.h"

#include <algorithm>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

namespace {
/// The arguments of a launch or their gradients, in order; None for those that
/// are not given.
struct Arguments {
  const Items &inputs, &outputs;
  size_t inputCount;

  PyObject *operator[](size_t i) const {
    bool isInput = i < inputCount;
    const Items &items = isInput ? inputs : outputs;
    size_t position = isInput ? i : i - inputCount;
    return position < items.size() ? items[position] : Py_None;
  }
};

/// A launch, beside its arguments.
struct Launched {
  size_t count;
  LaunchDim dim;
  int device, blockDim;
};
} // namespace

/// True if an attribute of an array is that value.
static bool hasValue(PyObject *array, PyObject *name, PyObject *value) {
  auto found = py::reinterpret_steal<py::object>(PyObject_GetAttr(array, name));
  if (!found)
    throw py::error_already_set();
  return found.ptr() == value;
}

/// True if `named` is, or may be taken for, the gradient that an array has.
static bool isOwnGradient(const ArrayObject *array, PyObject *named) {
  if (!isArray(named))
    return false;
  const ArrayObject *gradient = asArray(named);
  const ArrayDescriptor &own = array->descriptor, &given = gradient->descriptor;
  return given.data == own.grad && gradient->typeId == array->typeId &&
         !gradient->readOnly && given.ndim == own.ndim &&
         std::equal(own.shape, own.shape + own.ndim, given.shape) &&
         std::equal(own.strides, own.strides + own.ndim, given.strides);
}

/// True if an array has a gradient that the launch may add to and that it names
/// or leaves open; nothing if that takes Python.
static std::optional<bool> readGradient(PyObject *value, PyObject *named) {
  static PyObject *const wanted = PyUnicode_InternFromString("_requires_grad");
  static PyObject *const made = PyUnicode_InternFromString("_grad");
  ArrayObject *array = asArray(value);
  if (!array->descriptor.grad) {
    if (named != Py_None || !hasValue(value, wanted, Py_False))
      return std::nullopt;
    return false;
  }
  if (array->retainsGradient)
    return std::nullopt;
  if (named != Py_None)
    return isOwnGradient(array, named) ? std::optional(true) : std::nullopt;
  auto gradient =
      py::reinterpret_steal<py::object>(PyObject_GetAttr(value, made));
  if (!gradient)
    throw py::error_already_set();
  if (!isArray(gradient.ptr()) || asArray(gradient.ptr())->readOnly)
    return std::nullopt;
  return true;
}

/// The adjoint for the arrays that have gradients, a kernel or the parts of a
/// gathered one, borrowed; null if Python has to find or to run it.
static PyObject *findAdjoint(Kernel &primal, PyObject *known, PyObject *type,
                             const Arguments &values, const Arguments &named) {
  SharingCheck sharing;
  ArraySet active = 0;
  size_t number = 0;
  for (size_t i = 0; i < primal.parameters().size(); ++i) {
    if (primal.parameters()[i].kind != Param::Kind::Array)
      continue;
    PyObject *value = values[i];
    if (Py_TYPE(value) != reinterpret_cast<PyTypeObject *>(type) ||
        number == mostArrays)
      return nullptr;
    std::optional<bool> hasGradient = readGradient(value, named[i]);
    if (!hasGradient)
      return nullptr;
    ArrayObject *array = asArray(value);
    sharing.add(array->descriptor, array->descriptor.data, array->itemSize);
    if (*hasGradient)
      sharing.add(array->descriptor, array->descriptor.grad, array->itemSize);
    active |= ArraySet(*hasGradient) << number++;
  }
  auto key =
      py::reinterpret_steal<py::object>(PyLong_FromUnsignedLongLong(active));
  PyObject *found = PyDict_GetItemWithError(known, key.ptr());
  if (!found && PyErr_Occurred())
    throw py::error_already_set();
  return found && !sharing.shares() ? found : nullptr;
}

/// Packs the arguments, after them the extents of the launch if `kernel` takes
/// these, and runs it.
static void runPacked(PyObject *object, const Arguments &values,
                      const Arguments &named, const Launched &launch,
                      const LaunchDim &dim, PyObject *extents) {
  auto owner = py::reinterpret_borrow<py::object>(object);
  Kernel &kernel = *asKernel(object)->kernel;
  Packer &packer = *asKernel(object)->packer;
  Block block(kernel.parameterSize());
  std::vector<py::object> keep;
  for (size_t i = 0; i < launch.count; ++i)
    packer.pack(i, values[i], launch.device, block.data(), keep);
  for (size_t i = launch.count; i < packer.size(); ++i)
    packer.pack(i, PySequence_Fast_GET_ITEM(extents, i - launch.count),
                launch.device, block.data(), keep);
  launchPacked(
      kernel, launch.device, dim, block.data(), nullptr, launch.blockDim, [&] {
        std::vector<py::object> held{owner};
        for (size_t i = 0; i < launch.count; ++i) {
          held.push_back(py::reinterpret_borrow<py::object>(values[i]));
          held.push_back(py::reinterpret_borrow<py::object>(named[i]));
        }
        return held;
      });
}

/// Runs the two parts of a gathered adjoint (derivatives/gathers.py): its sums
/// over a grid that is larger by a halo, then the rest if there is any. False,
/// and nothing is done, if it is not for launches of these extents.
static bool runGathered(PyObject *parts, const Arguments &values,
                        const Arguments &named, const Launched &launch) {
  PyObject *sums = PyTuple_GET_ITEM(parts, 0);
  PyObject *rest = PyTuple_GET_ITEM(parts, 1);
  PyObject *halo = PyTuple_GET_ITEM(parts, 2);
  const LaunchDim &dim = launch.dim;
  constexpr int64_t largest = int64_t(1) << 29;
  if (PyTuple_GET_SIZE(halo) != dim.rank ||
      *std::max_element(dim.extent, dim.extent + dim.rank) >= largest)
    return false;
  LaunchDim larger = dim;
  auto extents = py::reinterpret_steal<py::object>(PyTuple_New(dim.rank));
  if (!extents)
    throw py::error_already_set();
  for (int i = 0; i < dim.rank; ++i) {
    larger.extent[i] += PyLong_AsLong(PyTuple_GET_ITEM(halo, i));
    PyObject *extent = PyLong_FromLongLong(dim.extent[i]);
    if (!extent)
      throw py::error_already_set();
    PyTuple_SET_ITEM(extents.ptr(), i, extent);
  }
  auto held = py::reinterpret_borrow<py::object>(parts);
  runPacked(sums, values, named, launch, larger, extents.ptr());
  if (rest != Py_None)
    runPacked(rest, values, named, launch, dim, nullptr);
  return true;
}

PyObject *python::launchAdjoint(PyObject *self, PyObject *const *args,
                                Py_ssize_t count) {
  if (count != 9)
    return PyErr_Format(PyExc_TypeError,
                        "launch_adjoint expects 9 arguments, but got %zd",
                        count);
  return guarded([&]() -> PyObject * {
    Kernel &primal = *asKernel(self)->kernel;
    Items inputs(args[3]), outputs(args[4]), first(args[5]), second(args[6]);
    size_t size = primal.parameters().size();
    if (capturesInProgress || inputs.size() + outputs.size() != size ||
        first.size() > inputs.size() || second.size() > outputs.size())
      Py_RETURN_FALSE;
    Arguments values{inputs, outputs, inputs.size()};
    Arguments named{first, second, inputs.size()};
    PyObject *found = findAdjoint(primal, args[0], args[1], values, named);
    if (!found)
      Py_RETURN_FALSE;
    Launched launch{size, readDim(primal, args[2]),
                    static_cast<int>(PyLong_AsLong(args[7])),
                    static_cast<int>(PyLong_AsLong(args[8]))};
    if (PyErr_Occurred())
      throw py::error_already_set();
    if (PyTuple_Check(found)) {
      if (!runGathered(found, values, named, launch))
        Py_RETURN_FALSE;
    } else {
      runPacked(found, values, named, launch, launch.dim, nullptr);
    }
    Py_RETURN_TRUE;
  });
}
