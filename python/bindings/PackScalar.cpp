//===- PackScalar.cpp - Marshalling of numbers ----------------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// Python's own ints and floats are recognised by their exact class and never
// reach anything slow. Other numbers (bool, NumPy scalars, zero-dimensional
// arrays, Warp scalars) are first turned into one of those. A float is no
// integer, and a number that does not fit is not cut to size.
//
//===----------------------------------------------------------------------===//

#include "Pack.h"

#include <algorithm>
#include <climits>
#include <cmath>
#include <cstring>

using namespace warp;
using namespace warp::python;
namespace py = pybind11;

template <typename T> static Outcome put(char *out, T value) {
  std::memcpy(out, &value, sizeof(T));
  return Outcome::Ok;
}

static bool isFloat(Scalar scalar) { return scalar >= Scalar::F16; }

/// Bits of the nearest number, ties to even, of a 16-bit format with that many
/// bits of fraction. Written out, since the compiler's conversion needs a
/// recent libgcc at run time.
static uint16_t shortFloatBits(double number, int fraction) {
  int bias = (1 << (14 - fraction)) - 1;
  uint16_t infinity = static_cast<uint16_t>((2 * bias + 1) << fraction);
  uint16_t sign = std::signbit(number) ? 0x8000 : 0;
  if (std::isnan(number))
    return sign | infinity | 1 << (fraction - 1);
  if (number == 0.0)
    return sign;
  int exponent = 0;
  if (std::isfinite(number))
    std::frexp(number, &exponent);
  // Below the normal range the spacing stays what it is at its lower end.
  exponent = std::max(exponent, 2 - bias);
  if (std::isinf(number) || exponent > bias + 1)
    return sign | infinity;
  // In units of the last place; a carry goes on into the exponent.
  double units =
      std::nearbyint(std::ldexp(std::fabs(number), fraction + 1 - exponent));
  int bits = ((exponent + bias - 2) << fraction) + static_cast<int>(units);
  return sign | static_cast<uint16_t>(bits);
}

static Outcome storeFloat(Scalar scalar, double number, char *out) {
  switch (scalar) {
  case Scalar::F64:
    return put(out, number);
  case Scalar::F32: {
    auto single = static_cast<float>(number);
    if (std::isinf(single) && std::isfinite(number))
      return Outcome::OutOfRange;
    return put(out, single);
  }
  case Scalar::F16: {
    uint16_t bits = shortFloatBits(number, 10);
    if ((bits & 0x7fff) == 0x7c00 && std::isfinite(number))
      return Outcome::OutOfRange;
    return put(out, bits);
  }
  default: {
    uint16_t bits = shortFloatBits(number, 7);
    if ((bits & 0x7fff) == 0x7f80 && std::isfinite(number))
      return Outcome::OutOfRange;
    return put(out, bits);
  }
  }
}

template <typename T> static Outcome storeInRange(long long value, char *out) {
  if (value < static_cast<long long>(std::numeric_limits<T>::min()) ||
      value > static_cast<long long>(std::numeric_limits<T>::max()))
    return Outcome::OutOfRange;
  return put(out, static_cast<T>(value));
}

static Outcome storeUnsigned64(PyObject *number, char *out) {
  unsigned long long value = PyLong_AsUnsignedLongLong(number);
  if (value == ULLONG_MAX && PyErr_Occurred()) {
    PyErr_Clear();
    return Outcome::OutOfRange;
  }
  return put<uint64_t>(out, value);
}

/// `number` is a Python int.
static Outcome storeInt(Scalar scalar, PyObject *number, char *out) {
  if (scalar == Scalar::U64)
    return storeUnsigned64(number, out);
  int overflow = 0;
  long long value = PyLong_AsLongLongAndOverflow(number, &overflow);
  if (overflow)
    return Outcome::OutOfRange;
  switch (scalar) {
  case Scalar::Bool:
    return put<uint8_t>(out, value != 0);
  case Scalar::I8:
    return storeInRange<int8_t>(value, out);
  case Scalar::I16:
    return storeInRange<int16_t>(value, out);
  case Scalar::I32:
    return storeInRange<int32_t>(value, out);
  case Scalar::I64:
    return put<int64_t>(out, value);
  case Scalar::U8:
    return storeInRange<uint8_t>(value, out);
  case Scalar::U16:
    return storeInRange<uint16_t>(value, out);
  default:
    return storeInRange<uint32_t>(value, out);
  }
}

static Outcome storeExact(Scalar scalar, PyObject *number, char *out) {
  if (PyFloat_Check(number))
    return isFloat(scalar) ? storeFloat(scalar, PyFloat_AS_DOUBLE(number), out)
                           : Outcome::WrongType;
  if (!isFloat(scalar))
    return storeInt(scalar, number, out);
  double value = PyLong_AsDouble(number);
  if (value == -1.0 && PyErr_Occurred()) {
    PyErr_Clear();
    return Outcome::OutOfRange;
  }
  return storeFloat(scalar, value, out);
}

/// A Python int or float that stands for a number of another class; null if
/// it is none. Never leaves a Python error behind.
static py::object plainNumber(Scalar scalar, PyObject *value) {
  PyNumberMethods *methods = Py_TYPE(value)->tp_as_number;
  if (value == Py_None || !methods)
    return {};
  // A composite is no number, even if it could be turned into one.
  if (PyObject_Size(value) >= 0)
    return {};
  PyErr_Clear();
  static PyObject *name = PyUnicode_InternFromString("value");
  PyObject *found = PyObject_GetAttr(value, name);
  if (found && !PyLong_Check(found) && !PyFloat_Check(found))
    Py_CLEAR(found);
  PyErr_Clear();
  if (!found && methods->nb_index)
    found = PyNumber_Index(value);
  PyErr_Clear();
  if (!found && isFloat(scalar) && methods->nb_float)
    found = PyNumber_Float(value);
  PyErr_Clear();
  // NumPy's bool is neither an index nor a Python bool.
  if (!found && std::strncmp(Py_TYPE(value)->tp_name, "numpy.bool", 10) == 0)
    found = PyBool_FromLong(PyObject_IsTrue(value));
  PyErr_Clear();
  return py::reinterpret_steal<py::object>(found);
}

Outcome python::storeScalar(Scalar scalar, PyObject *value, char *out) {
  if (scalar == Scalar::F32 && PyFloat_CheckExact(value))
    return storeFloat(Scalar::F32, PyFloat_AS_DOUBLE(value), out);
  if (PyLong_Check(value) || PyFloat_Check(value))
    return storeExact(scalar, value, out);
  py::object number = plainNumber(scalar, value);
  if (!number)
    return Outcome::WrongType;
  return storeExact(scalar, number.ptr(), out);
}
