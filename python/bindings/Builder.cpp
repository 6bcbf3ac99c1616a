//===- Builder.cpp - The kernel builder in Python -------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// One to one with "warp/Builder.h", in Python's spelling. Values and types are
// small objects that compare by identity of what they stand for.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include "warp/Builder.h"
#include "warp/NativeCode.h"

#include <pybind11/stl.h>

#include <unordered_map>

namespace py = pybind11;
using namespace warp;

static const char *kindText(Type::Kind kind) {
  switch (kind) {
  case Type::Kind::Bool:
    return "bool";
  case Type::Kind::Int:
    return "int";
  case Type::Kind::Float:
    return "float";
  case Type::Kind::Vector:
    return "vec";
  case Type::Kind::Matrix:
    return "mat";
  case Type::Kind::Quaternion:
    return "quat";
  case Type::Kind::Transform:
    return "transform";
  case Type::Kind::Array:
    return "array";
  case Type::Kind::Struct:
    return "struct";
  case Type::Kind::Tile:
    return "tile";
  case Type::Kind::Other:
    return "other";
  }
  return "other";
}

/// A Python number; ints beyond 64 bits are an error.
static Number toNumber(py::handle object) {
  if (PyBool_Check(object.ptr()))
    return object.ptr() == Py_True;
  if (PyFloat_Check(object.ptr()))
    return PyFloat_AS_DOUBLE(object.ptr());
  py::object index =
      py::reinterpret_steal<py::object>(PyNumber_Index(object.ptr()));
  if (!index) {
    PyErr_Clear();
    return object.cast<double>();
  }
  int overflow = 0;
  int64_t value = PyLong_AsLongLongAndOverflow(index.ptr(), &overflow);
  if (overflow == 0)
    return value;
  uint64_t large = overflow > 0 ? PyLong_AsUnsignedLongLong(index.ptr()) : 0;
  if (overflow < 0 || PyErr_Occurred()) {
    PyErr_Clear();
    throw Error(Error::Kind::Overflow, "integer " +
                                           py::str(index).cast<std::string>() +
                                           " does not fit 64 bits");
  }
  return large;
}

static py::object toPython(const std::optional<Number> &number) {
  if (!number)
    return py::none();
  return std::visit([](auto value) { return py::object(py::cast(value)); },
                    *number);
}

/// The C++ object in one of pybind11's, of a class without bases: a front end
/// reads types so often that the search for a converter counts.
template <typename T> static T *held(PyObject *object) {
  auto *instance = reinterpret_cast<py::detail::instance *>(object);
  return static_cast<T *>(instance->simple_value_holder[0]);
}

namespace {
/// The objects of a type in Python, which live as long as the type: always.
struct TypeObjects {
  PyObject *type, *kind;
};
} // namespace

static const TypeObjects &objectsOf(Type type) {
  static auto &known = *new std::unordered_map<const void *, TypeObjects>;
  if (auto found = known.find(type.impl); found != known.end())
    return found->second;
  py::object object = py::cast(type);
  PyObject *kind = PyUnicode_InternFromString(kindText(type.kind()));
  if (!kind)
    throw py::error_already_set();
  TypeObjects made = {object.release().ptr(), kind};
  return known.try_emplace(type.impl, made).first->second;
}

static PyObject *kindOf(PyObject *self, void *) {
  return Py_NewRef(objectsOf(*held<Type>(self)).kind);
}

static PyObject *typeOf(PyObject *self, void *) {
  return Py_NewRef(objectsOf(held<Value>(self)->type()).type);
}

static PyObject *compareTypes(PyObject *self, PyObject *other, int operation) {
  if (operation != Py_EQ && operation != Py_NE)
    Py_RETURN_NOTIMPLEMENTED;
  bool isSame = Py_TYPE(self) == Py_TYPE(other) &&
                *held<Type>(self) == *held<Type>(other);
  return PyBool_FromLong(isSame == (operation == Py_EQ));
}

static Py_hash_t hashType(PyObject *self) {
  return reinterpret_cast<intptr_t>(held<Type>(self)->impl) >> 3;
}

/// set_location(file, line, column).
static PyObject *setLocation(PyObject *self, PyObject *const *args,
                             Py_ssize_t count) {
  if (count != 3) {
    PyErr_SetString(PyExc_TypeError, "expects a file, a line and a column");
    return nullptr;
  }
  Py_ssize_t length;
  const char *file = PyUnicode_AsUTF8AndSize(args[0], &length);
  long line = file ? PyLong_AsLong(args[1]) : 0;
  long column = file ? PyLong_AsLong(args[2]) : 0;
  if (PyErr_Occurred())
    return nullptr;
  // Memory that the next call uses again, under the GIL.
  static std::string &path = *new std::string;
  path.assign(file, length);
  held<Builder>(self)->setLocation(path, static_cast<int>(line),
                                   static_cast<int>(column));
  Py_RETURN_NONE;
}

/// Adds an attribute that is read without pybind11.
static void defineGetter(py::handle type, PyGetSetDef &getter) {
  PyObject *descriptor =
      PyDescr_NewGetSet(reinterpret_cast<PyTypeObject *>(type.ptr()), &getter);
  type.attr(getter.name) = py::reinterpret_steal<py::object>(descriptor);
}

static void bindType(py::module_ &m) {
  static PyGetSetDef kind = {"kind", kindOf, nullptr, nullptr, nullptr};
  py::class_<Type> type(m, "Type", "A type of the compiler.");
  defineGetter(type, kind);
  auto *object = reinterpret_cast<PyTypeObject *>(type.ptr());
  object->tp_richcompare = compareTypes;
  object->tp_hash = hashType;
  type.def_static("parse", [](const std::string &s) { return Type::parse(s); })
      .def("__str__", &Type::str)
      .def("__repr__", [](Type t) { return "Type(" + t.str() + ")"; })
      .def_property_readonly("python_name", &Type::pythonName)
      .def_property_readonly("width", &Type::width)
      .def_property_readonly("signed", &Type::isSigned)
      .def_property_readonly("element",
                             [](Type t) {
                               Type element = t.element();
                               return element
                                          ? py::reinterpret_borrow<py::object>(
                                                objectsOf(element).type)
                                          : py::object(py::none());
                             })
      .def_property_readonly("shape", &Type::shape)
      .def_property_readonly("rank", &Type::rank)
      .def_property_readonly("struct_name", &Type::structName)
      .def_property_readonly("fields",
                             [](Type t) {
                               py::list fields;
                               for (const Type::Field &field : t.fields())
                                 fields.append(
                                     py::make_tuple(field.name, field.type));
                               return fields;
                             })
      .def_property_readonly("byte_size", &Type::byteSize)
      .def_property_readonly("byte_align", &Type::byteAlign);
}

static void bindValue(py::module_ &m) {
  static PyGetSetDef type = {"type", typeOf, nullptr, nullptr, nullptr};
  py::class_<Value> value(m, "Value", "An SSA value under construction.");
  defineGetter(value, type);
  value.def("constant", [](Value v) { return toPython(v.constant()); })
      .def("__bool__", [](Value) -> bool {
        throw py::type_error("a value of a kernel has no truth in Python");
      });
}

static void bindModule(py::module_ &m) {
  py::class_<Module>(m, "Module", "A verified module of the compiler.")
      .def_static("from_text",
                  [](const std::string &s) { return Module::fromText(s); })
      .def("text", &Module::text, py::arg("locations") = false)
      .def_property_readonly("kernel_name", &Module::kernelName);
}

static py::tuple toTuple(const Builder::Results &results) {
  return py::make_tuple(results.values, results.inout);
}

static void bindControl(py::class_<Builder> &c) {
  c.def("begin_if", &Builder::beginIf)
      .def("begin_else", &Builder::beginElse)
      .def("end_if", &Builder::endIf)
      .def_property_readonly("loop_depth", &Builder::loopDepth)
      .def("carry", &Builder::carry)
      .def("trip_count", &Builder::tripCount)
      .def("begin_for", &Builder::beginFor)
      .def("end_for", &Builder::endFor, py::arg("yields"),
           py::arg("late") = Builder::Values())
      .def("begin_while", &Builder::beginWhile)
      .def("while_condition", &Builder::whileCondition)
      .def("end_while", &Builder::endWhile, py::arg("yields"),
           py::arg("late") = Builder::Values());
}

static void bindArrays(py::class_<Builder> &c) {
  c.def("load", &Builder::load)
      .def("store", &Builder::store)
      .def("atomic", &Builder::atomic)
      .def("atomic_cas", &Builder::atomicCas)
      .def("view", &Builder::view)
      .def("component_view", py::overload_cast<Value, const std::string &>(
                                 &Builder::componentView))
      .def("component_view", py::overload_cast<Value, const Builder::Values &>(
                                 &Builder::componentView))
      .def("slice",
           [](Builder &b, Value array, int dimension,
              std::optional<Value> start, std::optional<Value> stop,
              std::optional<Value> step) {
             return b.slice(array, dimension, start.value_or(Value()),
                            stop.value_or(Value()), step.value_or(Value()));
           })
      .def("index_dim", &Builder::indexDim)
      .def("grad", &Builder::grad)
      .def("dim", &Builder::dim)
      .def("stride", &Builder::stride)
      .def("pointer", &Builder::pointer)
      .def("array_at",
           [](Builder &b, Type type, Value address,
              const Builder::Values &extents, std::optional<Value> grad) {
             return b.arrayAt(type, address, extents, grad.value_or(Value()));
           });
}

static void bindValues(py::class_<Builder> &c) {
  c.def("constant",
        [](Builder &b, Type type, py::handle number) {
          return b.constant(type, toNumber(number));
        })
      .def("zero", &Builder::zero)
      .def("call", &Builder::call)
      .def("set_pullback", &Builder::setPullback)
      .def("set_pushforward", &Builder::setPushforward)
      .def("set_replay", &Builder::setReplay)
      .def("vjp", &Builder::vjp)
      .def("jvp", &Builder::jvp)
      .def("builtin",
           [](Builder &b, const std::string &name, const Builder::Values &a) {
             return toTuple(b.builtin(name, a));
           })
      .def_static("has_builtin", &Builder::hasBuiltin)
      .def_static("inout_arguments", &Builder::inoutArguments)
      .def("construct", &Builder::construct)
      .def_static("parameter_names", &Builder::parameterNames)
      .def("cast", &Builder::cast)
      .def("bitcast", &Builder::bitcast)
      .def("tid", &Builder::tid)
      .def("printf", &Builder::printf)
      .def("assertion", &Builder::assertion)
      .def("require", &Builder::require)
      .def("struct_create", &Builder::structCreate)
      .def("struct_get", &Builder::structGet)
      .def("struct_set", &Builder::structSet)
      .def("extract", &Builder::extract)
      .def("part_type", &Builder::partType)
      .def("position", &Builder::position)
      .def("table_get",
           [](Builder &b, Type element, const std::vector<int64_t> &shape,
              const py::bytes &bytes, const Builder::Values &indices) {
             return b.tableGet(element, shape, bytes, indices);
           })
      .def("insert", &Builder::insert);
}

void bindBuilder(py::module_ &m) {
  bindType(m);
  bindValue(m);
  bindModule(m);
  m.def(
      "add_native_code",
      [](const std::string &symbol, const std::string &name,
         const std::string &text, const std::string &place,
         std::vector<std::string> cpuFolders,
         std::vector<std::string> gpuFolders) {
        addNativeCode(symbol, {name, text, place, std::move(cpuFolders),
                               std::move(gpuFolders)});
      },
      py::arg("symbol"), py::arg("name"), py::arg("text"), py::arg("place"),
      py::arg("cpu_folders"), py::arg("gpu_folders"),
      "Makes a function in C++ known to kernels.");
  m.def("native_compiler", &nativeCompiler, py::arg("gpu"));
  m.def("set_nvrtc_folders", &setNvrtcFolders, py::arg("folders"));
  py::class_<Builder> builder(m, "Builder", "Builds the module of a kernel.");
  static PyMethodDef location = {"set_location", python::asMethod(setLocation),
                                 METH_FASTCALL, nullptr};
  builder.attr(location.ml_name) =
      py::reinterpret_steal<py::object>(PyDescr_NewMethod(
          reinterpret_cast<PyTypeObject *>(builder.ptr()), &location));
  builder.def(py::init<const std::string &>())
      .def("begin_function", &Builder::beginFunction)
      .def("end_function", &Builder::endFunction)
      .def("set_inline_budget", &Builder::setInlineBudget)
      .def("result_types", &Builder::resultTypes)
      .def("finish", &Builder::finish);
  bindValues(builder);
  bindArrays(builder);
  bindControl(builder);
}
