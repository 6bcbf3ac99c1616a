//===- PackForeign.cpp - Marshalling of foreign arrays --------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// NumPy, CuPy, PyTorch and others describe their memory with a dictionary:
// `__array_interface__` for the host, `__cuda_array_interface__` for a device.
// Element types must agree exactly. The extents of a composite element are the
// last extents of the array and must be packed: an (n, 3) array of float32 is
// a one-dimensional array of vec3. Nothing is copied. Where the library says
// which stream wrote the memory, the device's current stream waits for it.
//
//===----------------------------------------------------------------------===//

#include "Pack.h"

#include "warp/Device.h"
#include "warp/LaunchQueue.h"

#include <climits>
#include <cstring>
#include <pybind11/numpy.h>

using namespace warp;
using namespace warp::python;
namespace py = pybind11;

/// The attribute, or null; no error stays behind.
static py::object attribute(PyObject *value, const char *name) {
  PyObject *found = PyObject_GetAttrString(value, name);
  PyErr_Clear();
  return py::reinterpret_steal<py::object>(found);
}

/// True if what an object converted to has memory of its own.
static bool isCopy(PyObject *value, const py::object &converted) {
  if (py::object address = attribute(value, "data_ptr"))
    return py::isinstance<py::array>(converted) &&
           address().cast<uint64_t>() !=
               reinterpret_cast<uint64_t>(py::array(converted).data());
  return converted.attr("base").is_none();
}

/// The memory of a host array of a library without array interface, as NumPy
/// sees it. PyTorch's convert without a copy; of Paddle's only DLPack gives the
/// memory itself, in a copy what a kernel writes would be lost. NumPy marks
/// memory of capsules without a version, as Paddle's are, as read-only:
/// `unmarked` says that this mark means nothing.
static py::object convertToNumpy(PyObject *value, bool &unmarked) {
  py::object convert = attribute(value, "__array__");
  if (!convert)
    return {};
  py::object converted = convert();
  if (!isCopy(value, converted) || !attribute(value, "__dlpack__"))
    return converted;
  try {
    py::object shared =
        py::module_::import("numpy").attr("from_dlpack")(py::handle(value));
    unmarked = true;
    return shared;
  } catch (const py::error_already_set &) {
    return converted;
  }
}

/// "<f4" for float32.
static std::string typeString(Scalar scalar) {
  if (scalar == Scalar::Bool)
    return "|b1";
  int64_t size = byteSize(scalar);
  char kind = scalar >= Scalar::F16 ? 'f' : scalar >= Scalar::U8 ? 'u' : 'i';
  return std::string(size == 1 ? "|" : "<") + kind + std::to_string(size);
}

static bool elementFits(const TypeShape &shape, int64_t elementSize,
                        const std::string &text) {
  if (shape.kind == TypeShape::Kind::Struct)
    return text == "|V" + std::to_string(elementSize);
  // NumPy has no bfloat16; the libraries that do spell it as two raw bytes.
  if (shape.scalar == Scalar::BF16)
    return text == "<V2" || text == "|V2";
  return text == typeString(shape.scalar);
}

static std::vector<int64_t> integers(const py::handle &sequence) {
  std::vector<int64_t> values;
  for (py::handle item : sequence)
    values.push_back(item.cast<int64_t>());
  return values;
}

namespace {
struct Interface {
  uint64_t data = 0;
  std::string type;
  std::vector<int64_t> shape, strides;
  bool readOnly = false;
};
} // namespace

static Interface readInterface(const py::dict &fields) {
  Interface found;
  found.type = fields["typestr"].cast<std::string>();
  found.shape = integers(fields["shape"]);
  py::object data = fields["data"];
  bool isPair = py::isinstance<py::tuple>(data);
  py::object first = isPair ? py::object(py::tuple(data)[0]) : data;
  // The other member says whether the memory must not be written.
  found.readOnly = isPair && py::bool_(py::object(py::tuple(data)[1]));
  if (!first.is_none())
    found.data = first.cast<uint64_t>();
  if (fields.contains("strides") && !fields["strides"].is_none()) {
    found.strides = integers(fields["strides"]);
    return found;
  }
  int64_t stride = std::strtoll(found.type.c_str() + 2, nullptr, 10);
  found.strides.resize(found.shape.size());
  for (size_t i = found.shape.size(); i-- > 0;) {
    found.strides[i] = stride;
    stride *= found.shape[i];
  }
  return found;
}

/// True if the last extents are the element's own and packed.
static bool innerFits(const Interface &found, const TypeShape &shape,
                      int rank) {
  size_t inner = shape.extents.size();
  if (found.shape.size() != rank + inner ||
      found.strides.size() != found.shape.size())
    return false;
  int64_t stride = byteSize(shape.scalar);
  for (size_t i = inner; i-- > 0;) {
    if (found.shape[rank + i] != shape.extents[i] ||
        found.strides[rank + i] != stride)
      return false;
    stride *= shape.extents[i];
  }
  return true;
}

static std::string describe(const Interface &found) {
  std::string text = ": an array of type '" + found.type + "' and shape (";
  for (size_t i = 0; i < found.shape.size(); ++i)
    text += (i ? ", " : "") + std::to_string(found.shape[i]);
  return text + (found.shape.size() == 1 ? ",)" : ")");
}

/// Lets the device's current stream wait for the stream that wrote an array;
/// false if there is nothing to wait for. Work that is recorded into a graph
/// runs later, and cannot wait for other streams.
static bool waitForWriter(const py::dict &fields, int device) {
  shareWithOthers();
  if (capturesInProgress || !fields.contains("stream") ||
      fields["stream"].is_none())
    return false;
  auto *handle = reinterpret_cast<void *>(fields["stream"].cast<uintptr_t>());
  std::shared_ptr<Stream> reader = currentStream(device);
  if (handle != reader->handle()) {
    Stream writer(device, handle);
    Event event(device);
    event.record(writer);
    waitEvent(*reader, event);
  }
  return true;
}

bool python::readForeignArray(const Packer &packer, const PackParam &param,
                              PyObject *value, int device, ArrayDescriptor &out,
                              std::vector<py::object> &keep) {
  bool onHost = isHost(device);
  py::object fields = attribute(value, onHost ? "__array_interface__"
                                              : "__cuda_array_interface__");
  bool unmarked = false;
  if (!fields && onHost && !PyType_Check(value) &&
      !attribute(value, "__cuda_array_interface__")) {
    if (py::object converted = convertToNumpy(value, unmarked)) {
      keep.push_back(std::move(converted));
      fields = attribute(keep.back().ptr(), "__array_interface__");
    }
  }
  if (!fields || !py::isinstance<py::dict>(fields))
    return false;
  int rank = param.param->rank;
  TypeShape shape = shapeOfType(param.param->element);
  Interface found;
  try {
    found = readInterface(py::reinterpret_borrow<py::dict>(fields));
  } catch (const std::exception &) {
    throw packer.error(param, value, " with a malformed array interface");
  }
  if (!elementFits(shape, param.param->elementSize, found.type) ||
      !innerFits(found, shape, rank))
    throw packer.error(param, value, describe(found));
  out = ArrayDescriptor();
  out.data = reinterpret_cast<void *>(found.data);
  out.ndim = rank;
  out.flags = found.readOnly && !unmarked ? readOnlyFlag : 0;
  for (int i = 0; i < rank; ++i) {
    if (found.shape[i] > INT32_MAX || found.strides[i] > INT32_MAX ||
        found.strides[i] < INT32_MIN)
      throw packer.error(param, value,
                         ": extents and strides must be below 2^31");
    out.shape[i] = static_cast<int32_t>(found.shape[i]);
    out.strides[i] = static_cast<int32_t>(found.strides[i]);
  }
  if (!onHost &&
      waitForWriter(py::reinterpret_borrow<py::dict>(fields), device))
    keep.push_back(std::move(fields));
  return true;
}
