//===- Array.cpp - warp._native.Array -------------------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Base class of `wp.array`: the descriptor that kernels get, what its elements
// are, on which device they lie and who owns them. Python decides how an array
// comes about and calls `_setup` once; launches read the fields directly.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include "warp/Memory.h"

#include <climits>
#include <structmember.h>
#include <unordered_map>
#include <vector>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

PyTypeObject *python::arrayType = nullptr;

//===----------------------------------------------------------------------===//
// Types by number
//===----------------------------------------------------------------------===//

namespace {
struct TypeTable {
  std::unordered_map<std::string, int> ids;
  std::vector<std::string> texts;
  PyObject *resolver = nullptr;
};
} // namespace

/// Guarded by the GIL.
static TypeTable &types() {
  static auto *table = new TypeTable;
  return *table;
}

int python::typeId(const std::string &text) {
  TypeTable &table = types();
  auto [entry, isNew] = table.ids.try_emplace(text, table.texts.size());
  if (isNew)
    table.texts.push_back(text);
  return entry->second;
}

const std::string &python::typeText(int id) { return types().texts.at(id); }

std::string python::resolveType(PyTypeObject *type) {
  if (!types().resolver)
    return {};
  PyObject *found =
      PyObject_CallOneArg(types().resolver, reinterpret_cast<PyObject *>(type));
  std::string text;
  if (found && PyUnicode_Check(found))
    if (const char *characters = PyUnicode_AsUTF8(found))
      text = characters;
  Py_XDECREF(found);
  // A class that is no type of ours is no error.
  PyErr_Clear();
  return text;
}

static void setTypeResolver(py::object resolver) {
  Py_XDECREF(types().resolver);
  types().resolver = resolver.is_none() ? nullptr : resolver.release().ptr();
}

//===----------------------------------------------------------------------===//
// The object
//===----------------------------------------------------------------------===//

/// To be called whenever the descriptor has changed.
static void findFacts(ArrayObject *array) {
  array->descriptor.flags = arrayFacts(array->descriptor, array->itemSize);
}

static PyObject *newArray(PyTypeObject *type, PyObject *, PyObject *) {
  PyObject *object = type->tp_alloc(type, 0);
  if (!object)
    return nullptr;
  ArrayObject *array = asArray(object);
  array->descriptor = ArrayDescriptor();
  array->typeId = array->packId = -1;
  array->device = defaultDevice;
  findFacts(array);
  return object;
}

/// Python-side subclasses take what arguments they like.
static int initArray(PyObject *, PyObject *, PyObject *) { return 0; }

static int traverseArray(PyObject *self, visitproc visit, void *arg) {
  Py_VISIT(Py_TYPE(self));
  Py_VISIT(asArray(self)->dtype);
  Py_VISIT(asArray(self)->owner);
  return 0;
}

static int clearArray(PyObject *self) {
  ArrayObject *array = asArray(self);
  // Whoever still sees the array must not see memory that is gone.
  array->descriptor = ArrayDescriptor();
  findFacts(array);
  Py_CLEAR(array->dtype);
  Py_CLEAR(array->owner);
  Py_CLEAR(array->shape);
  Py_CLEAR(array->strides);
  return 0;
}

static void deallocArray(PyObject *self) {
  PyTypeObject *type = Py_TYPE(self);
  PyObject_GC_UnTrack(self);
  clearArray(self);
  type->tp_free(self);
  Py_DECREF(type);
}

/// Fills one of the descriptor's four-entry tables from a tuple or list.
static bool readExtents(PyObject *sequence, const char *what, int32_t *out,
                        int &count) {
  PyObject *fast = PySequence_Fast(sequence, "expects a tuple of ints");
  if (!fast)
    return false;
  count = static_cast<int>(PySequence_Fast_GET_SIZE(fast));
  bool good = count <= maxRank;
  if (!good)
    PyErr_Format(PyExc_ValueError, "expects at most 4 dimensions, but got %d",
                 count);
  for (int i = 0; good && i < count; ++i) {
    PyObject *item = PySequence_Fast_GET_ITEM(fast, i);
    int overflow = 0;
    long long value = PyLong_AsLongLongAndOverflow(item, &overflow);
    if (value == -1 && PyErr_Occurred())
      good = false;
    else if (overflow || value > INT32_MAX || value < INT32_MIN) {
      PyErr_Format(PyExc_ValueError,
                   "expects a %s below 2^31, but got '%S' for dimension %d",
                   what, item, i);
      good = false;
    }
    out[i] = static_cast<int32_t>(value);
  }
  Py_DECREF(fast);
  return good;
}

static bool packStrides(ArrayObject *array) {
  ArrayDescriptor &descriptor = array->descriptor;
  int64_t stride = array->itemSize;
  for (int i = descriptor.ndim - 1; i >= 0; --i) {
    if (stride > INT32_MAX) {
      PyErr_SetString(PyExc_ValueError,
                      "expects strides below 2^31 bytes; make the inner "
                      "dimensions smaller");
      return false;
    }
    descriptor.strides[i] = static_cast<int32_t>(stride);
    stride *= descriptor.shape[i] > 0 ? descriptor.shape[i] : 1;
  }
  return true;
}

static PyObject *setupArray(PyObject *self, PyObject *args, PyObject *names) {
  static const char *keywords[] = {"ptr",     "shape",     "strides", "dtype",
                                   "type_id", "item_size", "device",  "owner",
                                   "pinned",  nullptr};
  unsigned long long ptr;
  PyObject *shape, *strides, *dtype, *owner = Py_None;
  int typeId, device, pinned = 0;
  long long itemSize;
  if (!PyArg_ParseTupleAndKeywords(args, names, "KOOOiLi|Op",
                                   const_cast<char **>(keywords), &ptr, &shape,
                                   &strides, &dtype, &typeId, &itemSize,
                                   &device, &owner, &pinned))
    return nullptr;
  ArrayObject *array = asArray(self);
  ArrayDescriptor descriptor;
  descriptor.data = reinterpret_cast<void *>(ptr);
  int count = 0, strideCount = 0;
  if (!readExtents(shape, "extent", descriptor.shape, count))
    return nullptr;
  descriptor.ndim = count;
  for (int i = 0; i < count; ++i)
    if (descriptor.shape[i] < 0)
      return PyErr_Format(PyExc_ValueError,
                          "expects extents of 0 or more, but got '%d' for "
                          "dimension %d",
                          descriptor.shape[i], i);
  array->itemSize = itemSize;
  array->descriptor = descriptor;
  if (strides == Py_None) {
    if (!packStrides(array))
      return nullptr;
  } else {
    if (!readExtents(strides, "stride", array->descriptor.strides, strideCount))
      return nullptr;
    if (strideCount != count)
      return PyErr_Format(PyExc_ValueError,
                          "expects %d strides, one per dimension, but got %d",
                          count, strideCount);
  }
  array->typeId = array->packId = typeId;
  array->readOnly = array->describesItself = false;
  array->retainsGradient = false;
  array->device = device;
  array->pinned = pinned;
  findFacts(array);
  Py_XSETREF(array->dtype, Py_NewRef(dtype));
  Py_XSETREF(array->owner, Py_NewRef(owner));
  Py_CLEAR(array->shape);
  Py_CLEAR(array->strides);
  Py_RETURN_NONE;
}

static PyObject *letDescribe(PyObject *self, PyObject *) {
  asArray(self)->describesItself = true;
  asArray(self)->packId = -1;
  Py_RETURN_NONE;
}

static PyObject *protectArray(PyObject *self, PyObject *) {
  asArray(self)->readOnly = true;
  asArray(self)->packId = -1;
  Py_RETURN_NONE;
}

static PyObject *describeArray(PyObject *self, PyObject *) {
  return PyBytes_FromStringAndSize(
      reinterpret_cast<const char *>(&asArray(self)->descriptor),
      sizeof(ArrayDescriptor));
}

//===----------------------------------------------------------------------===//
// Attributes
//===----------------------------------------------------------------------===//

static PyObject *makeTuple(const int32_t *values, int count) {
  PyObject *tuple = PyTuple_New(count);
  for (int i = 0; tuple && i < count; ++i)
    PyTuple_SET_ITEM(tuple, i, PyLong_FromLong(values[i]));
  return tuple;
}

static PyObject *getShape(PyObject *self, void *) {
  ArrayObject *array = asArray(self);
  if (!array->shape)
    array->shape = makeTuple(array->descriptor.shape, array->descriptor.ndim);
  return Py_XNewRef(array->shape);
}

static PyObject *getStrides(PyObject *self, void *) {
  ArrayObject *array = asArray(self);
  if (!array->strides)
    array->strides =
        makeTuple(array->descriptor.strides, array->descriptor.ndim);
  return Py_XNewRef(array->strides);
}

static PyObject *getSize(PyObject *self, void *) {
  const ArrayDescriptor &descriptor = asArray(self)->descriptor;
  int64_t size = 1;
  for (int i = 0; i < descriptor.ndim; ++i)
    size *= descriptor.shape[i];
  return PyLong_FromLongLong(size);
}

static PyObject *fromPointer(const void *pointer) {
  // An empty array has no memory; None would only get in the way.
  return PyLong_FromVoidPtr(const_cast<void *>(pointer));
}

static PyObject *getPtr(PyObject *self, void *) {
  if (!asArray(self)->descriptor.data)
    Py_RETURN_NONE;
  return fromPointer(asArray(self)->descriptor.data);
}

static PyObject *getGradPtr(PyObject *self, void *) {
  return fromPointer(asArray(self)->descriptor.grad);
}

/// Sets an address of the descriptor; None is null.
static int setPointer(PyObject *self, PyObject *value,
                      void *ArrayDescriptor::*field) {
  void *pointer = nullptr;
  if (value && value != Py_None) {
    pointer = PyLong_AsVoidPtr(value);
    if (!pointer && PyErr_Occurred())
      return -1;
  }
  asArray(self)->descriptor.*field = pointer;
  findFacts(asArray(self));
  return 0;
}

static int setGradPtr(PyObject *self, PyObject *value, void *) {
  return setPointer(self, value, &ArrayDescriptor::grad);
}

static int setPtr(PyObject *self, PyObject *value, void *) {
  return setPointer(self, value, &ArrayDescriptor::data);
}

static PyObject *isContiguousArray(PyObject *self, void *) {
  return PyBool_FromLong(asArray(self)->isContiguous());
}

static PyObject *getOwner(PyObject *self, void *) {
  PyObject *owner = asArray(self)->owner;
  return Py_NewRef(owner ? owner : Py_None);
}

static PyObject *getDtype(PyObject *self, void *) {
  PyObject *dtype = asArray(self)->dtype;
  return Py_NewRef(dtype ? dtype : Py_None);
}

static int setDtype(PyObject *self, PyObject *value, void *) {
  if (value == asArray(self)->dtype)
    return 0;
  // The size of an element and the number of its type would stay.
  PyErr_SetString(PyExc_AttributeError,
                  "the element type of an array cannot be set, use "
                  "`a.view(dtype)`");
  return -1;
}

static PyGetSetDef attributes[] = {
    {"ptr", getPtr, setPtr, "Address of the first element, or None.", nullptr},
    {"grad_ptr", getGradPtr, setGradPtr, "Address of the gradient.", nullptr},
    {"shape", getShape, nullptr, "Extents.", nullptr},
    {"strides", getStrides, nullptr, "Strides in bytes.", nullptr},
    {"size", getSize, nullptr, "Number of elements.", nullptr},
    {"is_contiguous", isContiguousArray, nullptr,
     "True if elements are packed in row-major order.", nullptr},
    {"_owner", getOwner, nullptr, "The object that keeps the memory alive.",
     nullptr},
    {"dtype", getDtype, setDtype, "Type of the elements.", nullptr},
    {nullptr, nullptr, nullptr, nullptr, nullptr}};

#define WARP_FIELD(name) offsetof(ArrayObject, name)
static PyMemberDef members[] = {
    {"ndim", T_INT, WARP_FIELD(descriptor.ndim), READONLY, nullptr},
    {"_facts", T_INT, WARP_FIELD(descriptor.flags), READONLY, nullptr},
    {"item_size", T_LONGLONG, WARP_FIELD(itemSize), READONLY, nullptr},
    {"type_id", T_INT, WARP_FIELD(typeId), READONLY, nullptr},
    {"device_index", T_INT, WARP_FIELD(device), READONLY, nullptr},
    {"pinned", T_BOOL, WARP_FIELD(pinned), READONLY, nullptr},
    {"read_only", T_BOOL, WARP_FIELD(readOnly), READONLY,
     "True if the memory must not be written."},
    {"_retain_grad", T_BOOL, WARP_FIELD(retainsGradient), 0, nullptr},
    {nullptr, 0, 0, 0, nullptr}};
#undef WARP_FIELD

/// Name, offset, bytes of a number and count of each field of a descriptor.
static py::tuple describeLayout() {
  ArrayDescriptor example;
  auto field = [&](const char *name, auto &member) {
    using Member = std::remove_reference_t<decltype(member)>;
    using Number = std::remove_extent_t<Member>;
    auto offset =
        reinterpret_cast<char *>(&member) - reinterpret_cast<char *>(&example);
    return py::make_tuple(name, offset, sizeof(Number),
                          sizeof(member) / sizeof(Number));
  };
  return py::make_tuple(
      field("data", example.data), field("grad", example.grad),
      field("shape", example.shape), field("strides", example.strides),
      field("ndim", example.ndim), field("flags", example.flags));
}

/// The gradient that an array has; the first time, Python makes it.
static PyObject *gradientOf(PyObject *, PyObject *array) {
  static PyObject *const made = PyUnicode_InternFromString("_grad");
  static PyObject *const wanted = PyUnicode_InternFromString("_requires_grad");
  static PyObject *const make = PyUnicode_InternFromString("_first_grad");
  PyObject *found = PyObject_GetAttr(array, made);
  if (found != Py_None)
    return found;
  PyObject *wants = PyObject_GetAttr(array, wanted);
  if (!wants || wants == Py_False) {
    Py_XDECREF(wants);
    return wants ? found : nullptr;
  }
  Py_DECREF(wants);
  return PyObject_CallMethodNoArgs(array, make);
}

void python::bindArray(py::module_ &m) {
  static PyMethodDef functions[] = {
      {"gradient_of", gradientOf, METH_O,
       "gradient_of(array)\n\nThe array of derivatives, or None; zero when it "
       "is first read."},
      {nullptr, nullptr, 0, nullptr}};
  if (PyModule_AddFunctions(m.ptr(), functions) != 0)
    throw py::error_already_set();
  static PyMethodDef methods[] = {
      {"_setup", asMethod(setupArray), METH_VARARGS | METH_KEYWORDS,
       "_setup(ptr, shape, strides, dtype, type_id, item_size, device, "
       "owner=None, pinned=False)\n\nMakes the array one of that memory. "
       "Strides are in bytes; None means packed."},
      {"_describe_itself", letDescribe, METH_NOARGS,
       "Lets launches ask `__ctype__` for the memory."},
      {"_protect", protectArray, METH_NOARGS,
       "Lets nothing write the memory through this array."},
      {"descriptor", describeArray, METH_NOARGS,
       "The `ArrayDescriptor` that kernels get, as bytes."},
      {nullptr, nullptr, 0, nullptr}};
  PyType_Slot slots[] = {
      {Py_tp_new, reinterpret_cast<void *>(newArray)},
      {Py_tp_init, reinterpret_cast<void *>(initArray)},
      {Py_tp_dealloc, reinterpret_cast<void *>(deallocArray)},
      {Py_tp_traverse, reinterpret_cast<void *>(traverseArray)},
      {Py_tp_clear, reinterpret_cast<void *>(clearArray)},
      {Py_tp_methods, methods},
      {Py_tp_members, members},
      {Py_tp_getset, attributes},
      {Py_tp_doc, const_cast<char *>("Base class of arrays.")},
      {0, nullptr}};
  PyType_Spec spec = {
      "warp._native.Array", sizeof(ArrayObject), 0,
      Py_TPFLAGS_DEFAULT | Py_TPFLAGS_BASETYPE | Py_TPFLAGS_HAVE_GC, slots};
  auto *type = PyType_FromSpec(&spec);
  if (!type)
    throw py::error_already_set();
  arrayType = reinterpret_cast<PyTypeObject *>(type);
  m.add_object("Array", py::reinterpret_steal<py::object>(type));
  m.attr("DESCRIPTOR_FIELDS") = describeLayout();
  m.attr("DESCRIPTOR_SIZE") = sizeof(ArrayDescriptor);
  m.attr("READ_ONLY_FLAG") = readOnlyFlag;
  m.attr("OWNER_MASK") = ownerMask;
  m.def(
      "type_id", [](const std::string &text) { return typeId(text); },
      py::arg("text"), "Number of a native type's text.");
  m.def("set_type_resolver", &setTypeResolver, py::arg("resolver").none(true),
        "Registers a function from Python classes to native type texts.");
}
