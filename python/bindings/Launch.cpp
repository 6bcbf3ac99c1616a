//===- Launch.cpp - Running kernels from Python ---------------------------===//
//
// A launch from Python: arguments are packed into a block on the stack, the
// variant is looked up, and the kernel runs. That path allocates nothing and
// holds the GIL, since it is over in a microsecond. The GIL is released where
// a launch has to be compiled first and while a long one runs on the CPU; then
// the arguments are held, because other threads may empty the list.
//
//===----------------------------------------------------------------------===//

#include "KernelObject.h"

#include <cstring>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

namespace {

/// Memory for a parameter block, on the stack where it fits.
class Block {
public:
  explicit Block(size_t size) {
    if (size > sizeof(local))
      large.resize(size / 8 + 1);
  }
  char *data() {
    return large.empty() ? local : reinterpret_cast<char *>(large.data());
  }

private:
  alignas(16) char local[1024];
  std::vector<uint64_t> large;
};

/// Items of a list or tuple, or of a copy of any other sequence.
class Items {
public:
  explicit Items(PyObject *sequence) {
    if (!sequence || sequence == Py_None)
      return;
    if (!PyList_Check(sequence) && !PyTuple_Check(sequence)) {
      copy = py::reinterpret_steal<py::object>(PySequence_List(sequence));
      if (!copy) {
        PyErr_Clear();
        throw Error(Error::Kind::LaunchType,
                    "launch: expects a list or tuple of arguments, but got " +
                        describeValue(sequence));
      }
      sequence = copy.ptr();
    }
    items = sequence;
    count = PySequence_Fast_GET_SIZE(sequence);
  }
  size_t size() const { return count; }
  /// Looked up each time: packing may call Python, which may change the list.
  PyObject *operator[](size_t i) const {
    if (static_cast<size_t>(PySequence_Fast_GET_SIZE(items)) != count)
      throw Error(Error::Kind::Launch,
                  "launch: the list of arguments changed during the launch");
    return PySequence_Fast_GET_ITEM(items, i);
  }

private:
  py::object copy;
  size_t count = 0;
  PyObject *items = nullptr;
};

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
                         "'): expects 'dim' to be an int or 1 to 4 ints "
                         "below 2^31, but got " +
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
  return extent;
}

static LaunchDim readDim(const Kernel &kernel, PyObject *value) {
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

static void packArguments(Packer &packer, const Items &inputs,
                          const Items &outputs, int device, char *block,
                          std::vector<py::object> &keep) {
  size_t count = inputs.size();
  if (count + outputs.size() != packer.size())
    packer.raiseCount(count + outputs.size());
  for (size_t i = 0; i < count; ++i)
    packer.pack(i, inputs[i], device, block, keep);
  for (size_t i = count; i < packer.size(); ++i)
    packer.pack(i, outputs[i - count], device, block, keep);
}

/// What Python has printed comes before what the kernel prints.
static void flushPythonOutput() {
  PyObject *output = PySys_GetObject("stdout");
  if (!output || output == Py_None)
    return;
  Py_XDECREF(PyObject_CallMethod(output, "flush", nullptr));
  PyErr_Clear();
}

static const Stream *asStream(PyObject *object) {
  if (!object || object == Py_None)
    return nullptr;
  return py::handle(object).cast<const Stream *>();
}

template <typename MakeHold>
static void launchPacked(Kernel &kernel, int device, const LaunchDim &dim,
                         char *block, const Stream *stream, int blockDim,
                         MakeHold &&makeHold) {
  Kernel::Plan plan = kernel.tryPrepare(device, dim, block, blockDim);
  if (plan.items == 0)
    return;
  if (!plan.variant) {
    auto hold = makeHold();
    py::gil_scoped_release unlocked;
    plan = kernel.prepare(device, dim, block, blockDim);
  }
  if (Kernel::prints(plan))
    flushPythonOutput();
  if (Kernel::isShort(plan))
    return kernel.run(plan, block, stream);
  auto hold = makeHold();
  py::gil_scoped_release unlocked;
  kernel.run(plan, block, stream);
}

/// An int argument of the call, for the few that have a default.
static int intArgument(PyObject *value) {
  long number = PyLong_AsLong(value);
  if (number == -1 && PyErr_Occurred())
    throw py::error_already_set();
  return static_cast<int>(number);
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
    int device = count > 3 ? intArgument(args[3]) : cpuDevice;
    const Stream *stream = asStream(count > 4 ? args[4] : nullptr);
    int blockDim = count > 5 ? intArgument(args[5]) : 0;
    Block block(kernel.parameterSize());
    std::vector<py::object> keep;
    packArguments(packer, inputs, outputs, device, block.data(), keep);
    launchPacked(kernel, device, dim, block.data(), stream, blockDim,
                 [&] { return Hold(inputs, outputs); });
    Py_RETURN_NONE;
  });
}

//===----------------------------------------------------------------------===//
// Recorded launches
//===----------------------------------------------------------------------===//

namespace {
/// Arguments packed once, launched often, changed in between.
class PackedLaunch {
public:
  PackedLaunch(py::object kernel, const py::object &dim,
               const py::object &inputs, const py::object &outputs, int device)
      : owner(std::move(kernel)), device(device),
        block((native().parameterSize() + 7) / 8) {
    setDim(dim);
    Items first(inputs.ptr()), second(outputs.ptr());
    if (first.size() + second.size() != packer().size())
      packer().raiseCount(first.size() + second.size());
    arguments.resize(packer().size());
    for (size_t i = 0; i < first.size(); ++i)
      setParam(i, py::reinterpret_borrow<py::object>(first[i]));
    for (size_t i = 0; i < second.size(); ++i)
      setParam(first.size() + i, py::reinterpret_borrow<py::object>(second[i]));
  }

  void setDim(const py::object &value) { dim = readDim(native(), value.ptr()); }

  void setParam(Py_ssize_t index, py::object value) {
    if (index < 0 || index >= static_cast<Py_ssize_t>(packer().size()))
      throw py::index_error("launch('" + native().name() +
                            "'): no argument number " + std::to_string(index));
    std::vector<py::object> keep{value};
    packer().pack(index, value.ptr(), device, bytes(), keep);
    arguments[index] = std::move(keep);
  }

  void launch(const Stream *stream) {
    // A copy, since threads may launch at once and the header is written.
    Block copy(native().parameterSize());
    std::memcpy(copy.data(), block.data(), native().parameterSize());
    launchPacked(native(), device, dim, copy.data(), stream, 0,
                 [&] { return arguments; });
  }

private:
  Kernel &native() { return *asKernel(owner.ptr())->kernel; }
  Packer &packer() { return *asKernel(owner.ptr())->packer; }
  char *bytes() { return reinterpret_cast<char *>(block.data()); }

  py::object owner;
  int device;
  LaunchDim dim;
  std::vector<uint64_t> block;
  /// Each argument, with what was made to read it.
  std::vector<std::vector<py::object>> arguments;
};
} // namespace

PyObject *python::pack(PyObject *self, PyObject *args) {
  PyObject *dim, *inputs, *outputs = Py_None;
  int device = cpuDevice;
  if (!PyArg_ParseTuple(args, "OO|Oi", &dim, &inputs, &outputs, &device))
    return nullptr;
  return guarded([&] {
    auto borrow = [](PyObject *object) {
      return py::reinterpret_borrow<py::object>(object);
    };
    auto made = std::make_unique<PackedLaunch>(
        borrow(self), borrow(dim), borrow(inputs), borrow(outputs), device);
    return py::cast(std::move(made)).release().ptr();
  });
}

void python::bindPackedLaunch(py::module_ &m) {
  py::class_<PackedLaunch>(m, "PackedLaunch")
      .def("set_dim", &PackedLaunch::setDim, py::arg("dim"))
      .def("set_param", &PackedLaunch::setParam, py::arg("index"),
           py::arg("value"))
      .def("launch", &PackedLaunch::launch, py::arg("stream") = nullptr);
}
