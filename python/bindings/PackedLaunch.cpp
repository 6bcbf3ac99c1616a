//===- PackedLaunch.cpp - Recorded launches: packed once ------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The result of `wp.launch(..., record_cmd=True)` is a subclass of this type.
// The arguments are packed and the variant is chosen when they change; a
// launch then only runs it. Launches that may take long, and those with checks,
// which write into the block, work on a copy.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "LaunchCall.h"

#include <cstring>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

namespace {

class PackedLaunch {
public:
  PackedLaunch(py::object kernel, PyObject *dim, PyObject *inputs,
               PyObject *outputs, int device, py::object stream, int blockDim);

  void setDim(PyObject *value) {
    dim = readDim(native(), value);
    changed();
  }
  void setParam(size_t index, PyObject *value);
  void setBytes(size_t index, PyObject *value);
  void setParams(PyObject *values);
  void launch(PyObject *other);

private:
  Kernel &native() { return *asKernel(owner.ptr())->kernel; }
  Packer &packer() { return *asKernel(owner.ptr())->packer; }
  char *bytes() { return reinterpret_cast<char *>(block.data()); }
  void changed() {
    planned = false;
    ++version;
  }
  void checkIndex(size_t index);
  void readStructs();
  void makePlan();

  py::object owner, stream;
  int device, blockDim;
  LaunchDim dim;
  std::vector<uint64_t> block;
  /// Each argument, with what was made to read it.
  std::vector<std::vector<py::object>> arguments;
  /// True if only the bytes of an argument are known, not its type.
  std::vector<bool> isRaw;
  bool hasStructs = false;
  Kernel::Plan plan;
  bool planned = false, reports = false;
  unsigned version = 0;
};

struct PackedLaunchObject {
  PyObject base;
  PackedLaunch *launch;
};

} // namespace

static PackedLaunch &asLaunch(PyObject *object) {
  return *reinterpret_cast<PackedLaunchObject *>(object)->launch;
}

PackedLaunch::PackedLaunch(py::object kernel, PyObject *dim, PyObject *inputs,
                           PyObject *outputs, int device, py::object stream,
                           int blockDim)
    : owner(std::move(kernel)), stream(std::move(stream)), device(device),
      blockDim(blockDim), block((native().parameterSize() + 7) / 8),
      arguments(packer().size()), isRaw(packer().size()) {
  asStream(this->stream.ptr());
  for (size_t i = 0; i < arguments.size(); ++i)
    hasStructs |= packer().param(i).kind == Param::Kind::Struct;
  setDim(dim);
  Items first(inputs), second(outputs);
  if (first.size() + second.size() != packer().size())
    packer().raiseCount(first.size() + second.size());
  for (size_t i = 0; i < first.size(); ++i)
    setParam(i, first[i]);
  for (size_t i = 0; i < second.size(); ++i)
    setParam(first.size() + i, second[i]);
}

void PackedLaunch::checkIndex(size_t index) {
  if (index < arguments.size())
    return;
  PyErr_Format(PyExc_IndexError, "launch('%s'): no argument number %zd",
               native().name().c_str(), index);
  throw py::error_already_set();
}

void PackedLaunch::setParam(size_t index, PyObject *value) {
  checkIndex(index);
  std::vector<py::object> keep{py::reinterpret_borrow<py::object>(value)};
  packer().pack(index, value, device, bytes(), keep);
  changed();
  arguments[index].swap(keep);
  isRaw[index] = false;
}

/// From an object with the bytes of the argument, or from a number.
void PackedLaunch::setBytes(size_t index, PyObject *value) {
  checkIndex(index);
  if (!PyObject_CheckBuffer(value))
    return setParam(index, value);
  Py_buffer view;
  if (PyObject_GetBuffer(value, &view, PyBUF_SIMPLE) != 0)
    throw py::error_already_set();
  const Param &param = packer().param(index);
  Py_ssize_t size = view.len;
  if (size == param.size)
    std::memcpy(bytes() + param.offset, view.buf, size);
  PyBuffer_Release(&view);
  if (size != param.size)
    throw Error(Error::Kind::LaunchType,
                "launch('" + native().name() + "'): argument '" + param.name +
                    "' expects " + std::to_string(param.size) +
                    " bytes, but got " + std::to_string(size));
  changed();
  arguments[index] = {py::reinterpret_borrow<py::object>(value)};
  isRaw[index] = true;
}

void PackedLaunch::setParams(PyObject *values) {
  Items items(values);
  if (items.size() > arguments.size())
    packer().raiseCount(items.size());
  for (size_t i = 0; i < items.size(); ++i)
    setParam(i, items[i]);
}

/// Structs may have been changed since they were set.
void PackedLaunch::readStructs() {
  for (size_t i = 0; i < arguments.size(); ++i) {
    const Param &param = packer().param(i);
    if (param.kind != Param::Kind::Struct || arguments[i].empty() ||
        !PyObject_CheckBuffer(arguments[i][0].ptr()))
      continue;
    Py_buffer view;
    if (PyObject_GetBuffer(arguments[i][0].ptr(), &view, PyBUF_SIMPLE) != 0)
      throw py::error_already_set();
    bool differs = view.len == param.size &&
                   std::memcmp(bytes() + param.offset, view.buf, view.len) != 0;
    PyBuffer_Release(&view);
    py::object value = arguments[i][0];
    if (differs && isRaw[i])
      setBytes(i, value.ptr());
    else if (differs)
      setParam(i, value.ptr());
  }
}

void PackedLaunch::makePlan() {
  plan = native().tryPrepare(device, dim, bytes(), blockDim);
  while (!plan.variant && plan.items != 0) {
    // Others may change arguments while it is compiled.
    std::vector<uint64_t> copy = block;
    LaunchDim copiedDim = dim;
    unsigned before = version;
    {
      warp::python::Unlocked unlocked;
      ForkSection section;
      native().prepare(device, copiedDim, copy.data(), blockDim);
    }
    if (before == version)
      plan = native().tryPrepare(device, dim, bytes(), blockDim);
  }
  reports = Kernel::reports(plan);
  planned = true;
}

void PackedLaunch::launch(PyObject *other) {
  if (hasStructs)
    readStructs();
  if (isHost(device) &&
      (!planned || (plan.readsMemory && !native().isCurrent(plan, bytes()))))
    makePlan();
  if (planned && plan.items == 0)
    return;
  if (capturesInProgress) {
    hold(device, owner.ptr());
    for (const std::vector<py::object> &argument : arguments)
      for (const py::object &object : argument)
        hold(device, object.ptr());
  }
  const Stream *where =
      asStream(other && other != Py_None ? other : stream.ptr());
  if (!isHost(device) && (!planned || Kernel::mustQueue(device))) {
    if (!planned)
      plan = native().tryPrepare(device, dim, bytes(), blockDim);
    if (native().queue(plan, device, dim, bytes(), where, blockDim))
      return noteQueued(plan);
    if (!planned)
      makePlan();
    if (plan.items == 0)
      return;
  }
  auto makeHold = [this] { return arguments; };
  // Asked once: what it says may change meanwhile.
  bool isShort = Kernel::isShort(plan);
  if (isShort && !reports)
    return runPlan(native(), plan, bytes(), where, isShort, makeHold);
  Block copy(native().parameterSize());
  std::memcpy(copy.data(), block.data(), native().parameterSize());
  Kernel::Plan copiedPlan = plan;
  runPlan(native(), copiedPlan, copy.data(), where, isShort, makeHold);
}

//===----------------------------------------------------------------------===//
// The type
//===----------------------------------------------------------------------===//

static PyObject *newLaunch(PyTypeObject *type, PyObject *args,
                           PyObject *names) {
  static const char *keywords[] = {"kernel", "dim",    "inputs",    "outputs",
                                   "device", "stream", "block_dim", nullptr};
  PyObject *kernel, *dim, *inputs, *outputs = Py_None, *stream = Py_None;
  int device = defaultDevice, blockDim = 0;
  if (!PyArg_ParseTupleAndKeywords(
          args, names, "O!OO|OiOi", const_cast<char **>(keywords), kernelType,
          &kernel, &dim, &inputs, &outputs, &device, &stream, &blockDim))
    return nullptr;
  return guarded([&]() -> PyObject * {
    auto borrow = [](PyObject *object) {
      return py::reinterpret_borrow<py::object>(object);
    };
    auto made = std::make_unique<PackedLaunch>(
        borrow(kernel), dim, inputs, outputs, device, borrow(stream), blockDim);
    PyObject *self = type->tp_alloc(type, 0);
    if (self)
      reinterpret_cast<PackedLaunchObject *>(self)->launch = made.release();
    return self;
  });
}

static void deallocLaunch(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  delete reinterpret_cast<PackedLaunchObject *>(self)->launch;
  type->tp_free(self);
  Py_DECREF(type);
}

/// Calls `fn` and returns None.
template <typename Fn> static PyObject *none(Fn &&fn) {
  return guarded([&]() -> PyObject * {
    fn();
    Py_RETURN_NONE;
  });
}

static PyObject *runLaunch(PyObject *self, PyObject *const *args,
                           Py_ssize_t count, PyObject *names) {
  Py_ssize_t named = names ? PyTuple_GET_SIZE(names) : 0;
  if (count + named > 1 ||
      (named && PyUnicode_CompareWithASCIIString(PyTuple_GET_ITEM(names, 0),
                                                 "stream") != 0))
    return PyErr_Format(PyExc_TypeError, "launch expects a stream or nothing");
  return none(
      [&] { asLaunch(self).launch(count + named ? args[0] : nullptr); });
}

static PyObject *setDim(PyObject *self, PyObject *dim) {
  return none([&] { asLaunch(self).setDim(dim); });
}

template <void (PackedLaunch::*Set)(size_t, PyObject *)>
static PyObject *setOne(PyObject *self, PyObject *args) {
  Py_ssize_t index;
  PyObject *value;
  if (!PyArg_ParseTuple(args, "nO", &index, &value))
    return nullptr;
  // Negative numbers become impossible ones.
  return none([&] { (asLaunch(self).*Set)(index, value); });
}

static PyObject *setParams(PyObject *self, PyObject *values) {
  return none([&] { asLaunch(self).setParams(values); });
}

void python::bindPackedLaunch(py::module_ &m) {
  static PyMethodDef methods[] = {
      {"launch", asMethod(runLaunch), METH_FASTCALL | METH_KEYWORDS,
       "launch(stream=None)\n\nRuns the kernel."},
      {"set_dim", setDim, METH_O,
       "set_dim(dim)\n\nChanges the extents of the grid."},
      {"set_param", setOne<&PackedLaunch::setParam>, METH_VARARGS,
       "set_param(index, value)\n\nChanges the value of a parameter."},
      {"set_param_bytes", setOne<&PackedLaunch::setBytes>, METH_VARARGS,
       "set_param_bytes(index, value)\n\nThe same from an object that holds "
       "its bytes."},
      {"set_params", setParams, METH_O,
       "set_params(values)\n\nChanges the values of the first parameters."},
      {nullptr, nullptr, 0, nullptr}};
  PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newLaunch)},
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocLaunch)},
      {Py_tp_methods, methods},
      {Py_tp_doc, const_cast<char *>("A launch with packed arguments.")},
      {0, nullptr}};
  PyType_Spec spec = {"warp._native.PackedLaunch", sizeof(PackedLaunchObject),
                      0, Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE, slots};
  PyObject *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  m.add_object("PackedLaunch", py::reinterpret_steal<py::object>(type));
}
