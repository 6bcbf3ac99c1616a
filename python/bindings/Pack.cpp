//===- Pack.cpp - Marshalling of kernel arguments -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// The fast way is in Pack.h: an array whose class, element type, rank and
// device are right is a descriptor to copy; a number is one store. Everything
// else comes here: composites and structs by their bytes, composites from any
// sequence of numbers, null arrays, arrays of other libraries, objects that
// stand for a struct, and errors.
//
//===----------------------------------------------------------------------===//

#include "Pack.h"

#include "warp/Device.h"
#include "warp/Peers.h"

#include <cstring>

using namespace warp;
using namespace warp::python;
namespace py = pybind11;

Packer::Packer(const Kernel &kernel) : owner(kernel), kernel(kernel.name()) {
  for (const Param &param : kernel.parameters()) {
    PackParam prepared{&param, param.kind, param.offset, param.size,
                       -1,     {},         nullptr};
    if (param.kind == Param::Kind::Array)
      prepared.typeId = typeId(param.element);
    else
      prepared.shape = shapeOfType(param.type);
    params.push_back(std::move(prepared));
  }
}

Packer::~Packer() {
  for (PackParam &param : params)
    Py_XDECREF(param.accepted);
}

//===----------------------------------------------------------------------===//
// Messages
//===----------------------------------------------------------------------===//

static std::string deviceName(int device) {
  return isHost(device) ? "cpu" : "cuda:" + std::to_string(device);
}

static std::string arrayText(int ndim, const std::string &element) {
  return "array(ndim=" + std::to_string(ndim) +
         ", dtype=" + pythonTypeName(element) + ")";
}

static std::string shortRepr(PyObject *value) {
  std::string text;
  if (PyObject *repr = PyObject_Repr(value)) {
    if (const char *characters = PyUnicode_AsUTF8(repr))
      text = characters;
    Py_DECREF(repr);
  }
  PyErr_Clear();
  return text.size() <= 60 ? text : text.substr(0, 57) + "...";
}

std::string python::describeValue(PyObject *value) {
  if (value == Py_None)
    return "'None'";
  if (isArray(value)) {
    ArrayObject *array = asArray(value);
    std::string element =
        array->typeId >= 0 ? typeText(array->typeId) : "unknown";
    return "'" + arrayText(array->descriptor.ndim, element) + "' on '" +
           deviceName(array->device) + "'";
  }
  std::string name = Py_TYPE(value)->tp_name;
  if (PyLong_Check(value) || PyFloat_Check(value))
    return "'" + shortRepr(value) + "' ('" + name + "')";
  return "'" + name + "'";
}

std::string python::expectedText(const Param &param) {
  if (param.kind == Param::Kind::Array)
    return arrayText(param.rank, param.element);
  return pythonTypeName(param.type);
}

/// True if a value fails to become the number or the composite of a parameter:
/// Python has an exception class of its own for that.
static bool isConversion(const Param &param, PyObject *value) {
  // Indexed arrays are structs here.
  if (param.kind == Param::Kind::Array ||
      expectedText(param).find("array(") != std::string::npos)
    return false;
  if (value == Py_None && param.kind == Param::Kind::Struct)
    return false;
  return !(param.kind == Param::Kind::Composite && PyNumber_Check(value) &&
           !PySequence_Check(value));
}

Error Packer::error(const PackParam &param, PyObject *value,
                    const std::string &more) const {
  return Error(
      Error::Kind::LaunchType,
      "launch('" + kernel + "'): argument '" + param.param->name +
          "' expects '" + expectedText(*param.param) + "', but got " +
          describeValue(value) + more + "\ncode: launch-" +
          (isConversion(*param.param, value) ? "conversion" : "argument"));
}

void Packer::raiseCount(size_t got) const {
  std::string names;
  for (const PackParam &param : params)
    names += (names.empty() ? "" : ", ") + param.param->name;
  std::string message = "launch('" + kernel + "'): expects " +
                        std::to_string(params.size()) + " argument" +
                        (params.size() == 1 ? "" : "s") + " (" + names +
                        "), but got " + std::to_string(got);
  if (got < params.size())
    message += ", '" + params[got].param->name + "' is missing";
  throw Error(Error::Kind::LaunchType, message);
}

//===----------------------------------------------------------------------===//
// Arrays
//===----------------------------------------------------------------------===//

/// Refuses memory that must not be written where the kernel may write it. A
/// kernel that uses gradients is an adjoint, which writes those alone.
void Packer::checkUse(const PackParam &param, int64_t offset) const {
  for (const Access &access : owner.arrayAccesses()) {
    bool writes = access.stored || access.combined;
    if (access.offset != offset || !writes || access.gradientSize != 0)
      continue;
    bool isWhole = param.kind == Param::Kind::Array;
    throw Error(
        Error::Kind::LaunchValue,
        "launch('" + kernel + "'): argument '" + param.param->name + "' " +
            (isWhole ? "is" : "holds") +
            " a read-only array, but the kernel may write it" +
            (access.line ? " in line " + std::to_string(access.line) : "") +
            "\nhint: pass a copy, `wp.clone(a)` of an array or `a.copy()` of "
            "NumPy's");
  }
}

static bool copyBytes(PyObject *value, char *out, int64_t size) {
  Py_buffer view;
  if (PyObject_GetBuffer(value, &view, PyBUF_SIMPLE) != 0) {
    PyErr_Clear();
    return false;
  }
  bool fits = view.len == size;
  if (fits)
    std::memcpy(out, view.buf, size);
  PyBuffer_Release(&view);
  return fits;
}

/// True if an array is to be taken as the parameter says, whatever its own
/// element type and rank are: programs ask for it with `return_ctype`.
static bool isBare(PyObject *value) {
  static PyObject *const name = PyUnicode_InternFromString("bare");
  PyObject *bare = PyObject_GetAttr(value, name);
  PyErr_Clear();
  Py_XDECREF(bare);
  return bare == Py_True;
}

/// Leaves out dimensions that the parameter has not, and adds ones of extent 1.
static void fitRank(ArrayDescriptor &array, int rank) {
  for (int axis = array.ndim; axis < rank; ++axis) {
    array.shape[axis] = 1;
    array.strides[axis] = 0;
  }
  for (int axis = rank; axis < array.ndim; ++axis)
    array.shape[axis] = array.strides[axis] = 0;
  array.ndim = rank;
}

/// Reads the descriptor that `__ctype__` of an array makes. It says nothing of
/// the type of the elements.
static bool readDescriptor(const Packer &packer, const PackParam &param,
                           PyObject *value, int device, ArrayDescriptor &out) {
  if (std::strcmp(Py_TYPE(value)->tp_name, "ArrayDescriptor") != 0 ||
      !copyBytes(value, reinterpret_cast<char *>(&out), sizeof(out)))
    return false;
  int reach = out.flags & ownerMask, owner = reach - 2;
  if (out.ndim != param.param->rank || out.ndim == 0)
    throw packer.error(param, value,
                       " of " + std::to_string(out.ndim) + " dimensions");
  if (reach != 0 && owner != device &&
      (isHost(owner) || !canAccess(device, owner, out.data)))
    throw packer.error(param, value,
                       " on '" + deviceName(owner) + "', the launch is on '" +
                           deviceName(device) + "'");
  out.flags &= readOnlyFlag;
  return true;
}

void Packer::packArray(const PackParam &param, PyObject *value, int device,
                       char *block, std::vector<py::object> &keep) {
  ArrayDescriptor descriptor;
  if (value == Py_None) {
    descriptor.ndim = param.param->rank;
  } else if (isArray(value) && asArray(value)->describesItself &&
             asArray(value)->typeId == param.typeId) {
    py::object record =
        py::reinterpret_borrow<py::object>(value).attr("__ctype__")();
    if (!readDescriptor(*this, param, record.ptr(), device, descriptor))
      throw error(param, value, " whose '__ctype__' gives no descriptor");
  } else if (isArray(value)) {
    ArrayObject *array = asArray(value);
    bool fits = array->typeId == param.typeId &&
                array->descriptor.ndim == param.param->rank;
    if (!fits && !isBare(value))
      throw error(param, value);
    bool reachable =
        array->device == device ||
        (array->pinned && !isHost(device) && deviceInfo(device).isUva) ||
        (!isHost(array->device) &&
         canAccess(device, array->device, array->descriptor.data));
    if (!reachable)
      throw error(param, value,
                  ", the launch is on '" + deviceName(device) +
                      "'\nhint: copy it there with `.to(\"" +
                      deviceName(device) + "\")`");
    descriptor = array->descriptor;
    descriptor.flags =
        (fits ? descriptor.flags : 0) | (array->readOnly ? readOnlyFlag : 0);
    fitRank(descriptor, param.param->rank);
  } else if (!readDescriptor(*this, param, value, device, descriptor) &&
             !readForeignArray(*this, param, value, device, descriptor, keep)) {
    throw error(param, value);
  }
  if (descriptor.flags & readOnlyFlag)
    checkUse(param, param.offset);
  descriptor.flags &= arrayFactMask;
  std::memcpy(block + param.offset, &descriptor, sizeof(descriptor));
}

//===----------------------------------------------------------------------===//
// Composites and structs
//===----------------------------------------------------------------------===//

/// Rejects a struct with an array of another device, or with a read-only one
/// that the kernel writes. `flags` of an array in a struct is its device plus
/// 2, or 0 if it can be reached from all of them.
void Packer::checkStructArrays(const PackParam &param, PyObject *value,
                               const char *bytes, int device) {
  for (int64_t offset : param.param->arrays) {
    ArrayDescriptor array;
    std::memcpy(&array, bytes + offset, sizeof(array));
    int reach = array.flags & ownerMask, owner = reach - 2;
    if (reach != 0 && owner != device &&
        (isHost(owner) || !canAccess(device, owner, array.data)))
      throw error(param, value,
                  " that holds an array on '" + deviceName(owner) +
                      "', the launch is on '" + deviceName(device) +
                      "'\nhint: move it with `.to(\"" + deviceName(device) +
                      "\")`");
    if (array.flags & readOnlyFlag)
      checkUse(param, param.offset + offset);
  }
}

/// Copies a value whose class stands for the parameter's type.
bool Packer::packBytes(PackParam &param, PyObject *value, char *out) {
  PyTypeObject *type = Py_TYPE(value);
  if (type == param.accepted)
    return copyBytes(value, out, param.size);
  if (resolveType(type) != param.param->type ||
      !copyBytes(value, out, param.size))
    return false;
  Py_XDECREF(param.accepted);
  Py_INCREF(type);
  param.accepted = type;
  return true;
}

/// True if a parameter is the struct of an indexed array.
static bool isIndexedArray(const Param &param) {
  return param.type.rfind("!warp.struct<\"indexedarray", 0) == 0 &&
         param.type.find('(') < param.type.find('"', 15);
}

/// Copies the struct of an object that stands for one, as indexed arrays do.
bool Packer::packStandIn(PackParam &param, PyObject *value, char *out) {
  PyObject *record = PyObject_CallMethod(value, "__ctype__", nullptr);
  if (!record) {
    PyErr_Clear();
    return false;
  }
  bool packed = packBytes(param, record, out);
  Py_DECREF(record);
  return packed;
}

namespace {
/// Reads the numbers of a composite out of a sequence, flat or (a matrix)
/// nested by rows.
class Flattener {
public:
  Flattener(const TypeShape &shape, char *out)
      : shape(shape), out(out), step(byteSize(shape.scalar)) {}

  /// Sets `problem` if the components are not right.
  void read(PyObject *value) {
    bool nested = add(value, 0);
    if (problem.empty() && found != shape.count)
      problem = " with " + std::to_string(found) + " components, not " +
                std::to_string(shape.count);
    else if (problem.empty() && nested && shape.extents.size() == 2 &&
             rows != shape.extents[0])
      problem = " with " + std::to_string(rows) + " rows, not " +
                std::to_string(shape.extents[0]);
  }

  std::string problem;

private:
  /// Returns whether there were sequences inside.
  bool add(PyObject *value, int depth) {
    bool isText = PyUnicode_Check(value) || PyBytes_Check(value);
    PyObject *items = !isText && depth < 2 && PySequence_Check(value) &&
                              PyObject_Size(value) >= 0
                          ? PySequence_Fast(value, "")
                          : nullptr;
    PyErr_Clear();
    if (!items) {
      addNumber(value);
      return false;
    }
    bool nested = false;
    Py_ssize_t count = PySequence_Fast_GET_SIZE(items);
    for (Py_ssize_t i = 0; problem.empty() && i < count; ++i)
      nested |= add(PySequence_Fast_GET_ITEM(items, i), depth + 1);
    if (depth == 0)
      rows = count;
    Py_DECREF(items);
    return nested || depth > 0;
  }

  void addNumber(PyObject *value) {
    // Too many are counted, for the message, but not stored.
    char spare[8];
    switch (storeScalar(shape.scalar, value,
                        found < shape.count ? out + found * step : spare)) {
    case Outcome::Ok:
      ++found;
      return;
    case Outcome::OutOfRange:
      problem =
          " with the component " + describeValue(value) + ", out of range";
      return;
    case Outcome::WrongType:
      problem = " with the component " + describeValue(value);
    }
  }

  const TypeShape &shape;
  char *out;
  int64_t step, found = 0, rows = 0;
};
} // namespace

void Packer::packComposite(PackParam &param, PyObject *value, char *out) {
  if (packBytes(param, value, out))
    return;
  std::string name = pythonTypeName(param.param->type);
  char number[8];
  if (storeScalar(Scalar::F64, value, number) == Outcome::Ok)
    throw error(param, value, "\nhint: construct it: `wp." + name + "(...)`");
  if (value == Py_None || PyUnicode_Check(value) || !PySequence_Check(value))
    throw error(param, value);
  Flattener components(param.shape, out);
  components.read(value);
  if (!components.problem.empty())
    throw error(param, value, components.problem);
}

void Packer::packSlowly(PackParam &param, PyObject *value, int device,
                        char *block, std::vector<py::object> &keep) {
  char *out = block + param.offset;
  auto held = py::reinterpret_borrow<py::object>(value);
  switch (param.kind) {
  case Param::Kind::Array:
    return packArray(param, value, device, block, keep);
  case Param::Kind::Composite:
    return packComposite(param, value, out);
  case Param::Kind::Struct:
    // No indexed array: all of its arrays are null.
    if (value == Py_None && isIndexedArray(*param.param)) {
      std::memset(out, 0, param.size);
      return;
    }
    if (!(PyObject_CheckBuffer(value) ? packBytes(param, value, out)
                                      : packStandIn(param, value, out)))
      throw error(param, value);
    return checkStructArrays(param, value, out, device);
  case Param::Kind::Scalar: {
    Outcome outcome = storeScalar(param.shape.scalar, value, out);
    std::string convert = param.shape.scalar == Scalar::Bool ? "bool" : "int";
    bool isFloatToInt =
        PyFloat_Check(value) && param.shape.scalar < Scalar::F16;
    throw error(param, value,
                outcome == Outcome::OutOfRange ? ", out of range"
                : isFloatToInt ? "\nhint: convert it: `" + convert + "(value)`"
                               : "");
  }
  }
}
