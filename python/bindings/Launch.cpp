//===- Launch.cpp - Launches from Python ----------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// A launch from Python: arguments are packed into a block on the stack, the
// variant is looked up, and the kernel runs. That path allocates nothing and
// holds the GIL, since it is over in a microsecond. The GIL is released where
// a launch has to be compiled first and while a long one runs on the CPU; then
// the arguments are held, because other threads may empty the list.
//
//===----------------------------------------------------------------------===//

#include "LaunchCall.h"

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

namespace {
/// References to all arguments while the GIL is away.
class Hold {
public:
  Hold(const Items &first, const Items &second) {
    for (const Items *items : {&first, &second})
      for (size_t i = 0; i < items->size(); ++i)
        held.push_back(py::reinterpret_borrow<py::object>((*items)[i]));
  }

private:
  std::vector<py::object> held;
};

} // namespace

//===----------------------------------------------------------------------===//
// Launch
//===----------------------------------------------------------------------===//

static Error dimError(const Kernel &kernel, Error::Kind kind,
                      const std::string &got) {
  return Error(kind, "launch('" + kernel.name() +
                         "'): expects 'dim' to be an int, or at most 4 "
                         "dimensions of ints below 2^31, but got " +
                         got);
}

static int64_t readExtent(const Kernel &kernel, PyObject *value) {
  py::object number;
  if (!PyLong_Check(value)) {
    number = py::reinterpret_steal<py::object>(PyNumber_Index(value));
    PyErr_Clear();
    if (!number)
      throw dimError(kernel, Error::Kind::LaunchType, describeValue(value));
    value = number.ptr();
  }
  int overflow;
  int64_t extent = PyLong_AsLongLongAndOverflow(value, &overflow);
  if (overflow)
    throw dimError(kernel, Error::Kind::LaunchValue, describeValue(value));
  // A recorded launch is reported at once.
  if (extent < 0)
    throw Error(Error::Kind::LaunchValue,
                "launch('" + kernel.name() +
                    "'): expects non-negative extents, but got '" +
                    std::to_string(extent) + "'");
  return extent;
}

LaunchDim python::readDim(const Kernel &kernel, PyObject *value) {
  LaunchDim dim;
  if (PyLong_CheckExact(value) || !PySequence_Check(value)) {
    dim.extent[0] = readExtent(kernel, value);
    return dim;
  }
  Items items(value);
  if (items.size() < 1 || items.size() > maxRank)
    throw dimError(kernel, Error::Kind::LaunchValue,
                   std::to_string(items.size()) + " extents");
  dim.rank = static_cast<int>(items.size());
  for (int i = 0; i < dim.rank; ++i)
    dim.extent[i] = readExtent(kernel, items[i]);
  return dim;
}

/// Becomes part of each caller: launches have no time for a call.
[[gnu::always_inline]] static inline void
packAll(Packer &packer, const Items &inputs, const Items &outputs, int device,
        char *block, std::vector<py::object> &keep) {
  size_t count = inputs.size();
  if (count + outputs.size() != packer.size())
    packer.raiseCount(count + outputs.size());
  for (size_t i = 0; i < count; ++i)
    packer.pack(i, inputs[i], device, block, keep);
  for (size_t i = count; i < packer.size(); ++i)
    packer.pack(i, outputs[i - count], device, block, keep);
}

void python::packArguments(Packer &packer, const Items &inputs,
                           const Items &outputs, int device, char *block,
                           std::vector<py::object> &keep) {
  packAll(packer, inputs, outputs, device, block, keep);
}

/// The current stream waits for the writers of foreign arrays; a stream named
/// in the launch has to wait for them, too.
static void followCurrent(int device, const Stream &stream) {
  if (isHost(device))
    return;
  Event event(device);
  event.record(*currentStream(device));
  waitEvent(stream, event);
}

void python::flushPythonOutput() {
  PyObject *output = PySys_GetObject("stdout");
  if (!output || output == Py_None)
    return;
  Py_XDECREF(PyObject_CallMethod(output, "flush", nullptr));
  PyErr_Clear();
}

const Stream *python::asStream(PyObject *object) {
  if (!object || object == Py_None)
    return nullptr;
  return py::handle(object).cast<const Stream *>();
}

/// An int argument of the call, for the few that have a default.
static int intArgument(PyObject *value) {
  long number = PyLong_AsLong(value);
  if (number == -1 && PyErr_Occurred())
    throw py::error_already_set();
  return static_cast<int>(number);
}

/// The state with which a graph runs the launch again.
static void holdArguments(int device, PyObject *self, const Items &inputs,
                          const Items &outputs,
                          const std::vector<py::object> &keep) {
  hold(device, self);
  for (const Items *items : {&inputs, &outputs})
    for (size_t i = 0; i < items->size(); ++i)
      hold(device, (*items)[i]);
  for (const py::object &object : keep)
    hold(device, object.ptr());
}

PyObject *python::evaluate(PyObject *self, PyObject *const *args,
                           Py_ssize_t count) {
  if (count != 2)
    return PyErr_Format(PyExc_TypeError,
                        "evaluate expects 2 arguments, but got %zd", count);
  return guarded([&]() -> PyObject * {
    Kernel &kernel = *asKernel(self)->kernel;
    Items inputs(args[0]), outputs(args[1]);
    Block block(kernel.parameterSize());
    std::vector<py::object> keep;
    packArguments(*asKernel(self)->packer, inputs, outputs, defaultDevice,
                  block.data(), keep);
    LaunchDim one;
    one.extent[0] = 1;
    Kernel::Plan plan = kernel.tryPrepare(defaultDevice, one, block.data());
    if (!plan.variant) {
      Hold hold(inputs, outputs);
      warp::python::Unlocked unlocked;
      plan = kernel.prepare(defaultDevice, one, block.data());
    }
    kernel.runAtOnce(plan, block.data());
    Py_RETURN_NONE;
  });
}

PyObject *python::launch(PyObject *self, PyObject *const *args,
                         Py_ssize_t count) {
  if (count < 2 || count > 6)
    return PyErr_Format(PyExc_TypeError,
                        "launch expects 2 to 6 arguments, but got %zd", count);
  return guarded([&]() -> PyObject * {
    Kernel &kernel = *asKernel(self)->kernel;
    Packer &packer = *asKernel(self)->packer;
    LaunchDim dim = readDim(kernel, args[0]);
    Items inputs(args[1]), outputs(count > 2 ? args[2] : nullptr);
    int device = count > 3 ? intArgument(args[3]) : defaultDevice;
    const Stream *stream = asStream(count > 4 ? args[4] : nullptr);
    int blockDim = count > 5 ? intArgument(args[5]) : 0;
    Block block(kernel.parameterSize());
    std::vector<py::object> keep;
    packAll(packer, inputs, outputs, device, block.data(), keep);
    if (stream && !keep.empty() && !capturesInProgress)
      followCurrent(device, *stream);
    if (capturesInProgress)
      holdArguments(device, self, inputs, outputs, keep);
    launchPacked(kernel, device, dim, block.data(), stream, blockDim,
                 [&] { return Hold(inputs, outputs); });
    Py_RETURN_NONE;
  });
}
