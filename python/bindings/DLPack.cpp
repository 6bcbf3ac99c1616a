//===- DLPack.cpp - Tensors to and from other libraries -------------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
// DLPack hands a tensor over as a capsule that holds a struct with a deleter.
// The structs below are the binary interface of DLPack 1.0 and of the older
// version that knew no flags; libraries still use both.
//
// Lending: `dlpack_export` makes such a struct over an array and keeps the
// array alive until the deleter runs. A capsule that nobody takes frees it.
// Borrowing: `dlpack_inspect` tells what is in a capsule and leaves it alone;
// once Python has found it usable, `dlpack_take` renames the capsule, as the
// protocol asks, and returns an owner that runs the deleter when it is dropped.
// Python decides which stream waits for which, before and after.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include <cstdint>
#include <memory>
#include <vector>

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

//===----------------------------------------------------------------------===//
// The binary interface
//===----------------------------------------------------------------------===//

namespace {

struct DlDevice {
  int32_t type;
  int32_t id;
};

struct DlType {
  uint8_t code;
  uint8_t bits;
  uint16_t lanes;
};

struct DlTensor {
  void *data;
  DlDevice device;
  int32_t ndim;
  DlType dtype;
  int64_t *shape;
  int64_t *strides;
  uint64_t byteOffset;
};
static_assert(sizeof(DlTensor) == 48);

struct Legacy {
  static constexpr const char *name = "dltensor";
  static constexpr const char *usedName = "used_dltensor";

  DlTensor tensor;
  void *context;
  void (*deleter)(Legacy *);

  uint64_t flagBits() const { return 0; }
  void setFlags(uint64_t) {}
};
static_assert(sizeof(Legacy) == 64);

struct Versioned {
  static constexpr const char *name = "dltensor_versioned";
  static constexpr const char *usedName = "used_dltensor_versioned";

  uint32_t major;
  uint32_t minor;
  void *context;
  void (*deleter)(Versioned *);
  uint64_t flags;
  DlTensor tensor;

  uint64_t flagBits() const { return flags; }
  void setFlags(uint64_t bits) {
    major = 1;
    minor = 0;
    flags = bits;
  }
};
static_assert(sizeof(Versioned) == 80);

/// The state that an exported tensor keeps until its deleter runs.
template <typename Managed> struct Lent {
  Managed managed = {};
  std::vector<int64_t> shape, strides;
  PyObject *array = nullptr;
};

} // namespace

//===----------------------------------------------------------------------===//
// Lending
//===----------------------------------------------------------------------===//

static bool isFinalizing() {
#if PY_VERSION_HEX >= 0x030D0000
  return Py_IsFinalizing();
#else
  return _Py_IsFinalizing();
#endif
}

/// Called by the consumer, from any thread, with or without the GIL.
template <typename Managed> static void release(Managed *managed) {
  auto *lent = static_cast<Lent<Managed> *>(managed->context);
  // At exit a thread that asked for the GIL would never get it; the memory goes
  // with the process.
  if (Py_IsInitialized() && !isFinalizing()) {
    PyGILState_STATE state = PyGILState_Ensure();
    Py_DECREF(lent->array);
    PyGILState_Release(state);
  }
  delete lent;
}

/// Destructor of capsules: frees what nobody has taken.
template <typename Managed> static void dropCapsule(PyObject *capsule) {
  if (!PyCapsule_IsValid(capsule, Managed::name))
    return;
  // The deleter may run Python code, which must not see a pending error.
  PyObject *type, *value, *trace;
  PyErr_Fetch(&type, &value, &trace);
  auto *managed =
      static_cast<Managed *>(PyCapsule_GetPointer(capsule, Managed::name));
  if (managed && managed->deleter)
    managed->deleter(managed);
  PyErr_Restore(type, value, trace);
}

/// Extents and strides in scalars, those of the element last.
static void describe(const ArrayObject &array, const py::tuple &inner,
                     int64_t scalarSize, std::vector<int64_t> &shape,
                     std::vector<int64_t> &strides) {
  const ArrayDescriptor &descriptor = array.descriptor;
  for (int i = 0; i < descriptor.ndim; ++i) {
    if (descriptor.strides[i] % scalarSize)
      throw py::buffer_error("cannot export strides that are no multiple of "
                             "the element size to DLPack");
    shape.push_back(descriptor.shape[i]);
    strides.push_back(descriptor.strides[i] / scalarSize);
  }
  int64_t step = array.itemSize / scalarSize;
  for (py::handle extent : inner) {
    shape.push_back(extent.cast<int64_t>());
    step /= shape.back();
    strides.push_back(step);
  }
}

template <typename Managed>
static py::object lend(py::object array, DlType dtype, const py::tuple &inner,
                       DlDevice device, uint64_t flags) {
  auto lent = std::make_unique<Lent<Managed>>();
  const ArrayObject &object = *asArray(array.ptr());
  describe(object, inner, dtype.bits / 8, lent->shape, lent->strides);
  Managed &managed = lent->managed;
  managed.tensor = {object.descriptor.data,
                    device,
                    static_cast<int32_t>(lent->shape.size()),
                    dtype,
                    lent->shape.data(),
                    lent->strides.data(),
                    0};
  managed.context = lent.get();
  managed.deleter = release<Managed>;
  managed.setFlags(flags);
  PyObject *capsule =
      PyCapsule_New(&managed, Managed::name, dropCapsule<Managed>);
  if (!capsule)
    throw py::error_already_set();
  lent.release()->array = array.release().ptr();
  return py::reinterpret_steal<py::object>(capsule);
}

static py::object exportArray(py::object array, uint8_t code, uint8_t bits,
                              const py::tuple &inner, int deviceType,
                              int deviceId, bool versioned, uint64_t flags) {
  if (!isArray(array.ptr()))
    throw py::type_error("expects an array to export");
  DlType dtype{code, bits, 1};
  DlDevice device{deviceType, deviceId};
  return versioned ? lend<Versioned>(std::move(array), dtype, inner, device,
                                     flags)
                   : lend<Legacy>(std::move(array), dtype, inner, device, 0);
}

//===----------------------------------------------------------------------===//
// Borrowing
//===----------------------------------------------------------------------===//

/// Calls `fn` with the struct of a capsule that nobody has taken yet.
template <typename Fn> static auto visit(const py::handle &capsule, Fn &&fn) {
  PyObject *object = capsule.ptr();
  if (PyCapsule_IsValid(object, Versioned::name))
    return fn(*static_cast<Versioned *>(
        PyCapsule_GetPointer(object, Versioned::name)));
  if (PyCapsule_IsValid(object, Legacy::name))
    return fn(
        *static_cast<Legacy *>(PyCapsule_GetPointer(object, Legacy::name)));
  if (!PyCapsule_CheckExact(object))
    throw py::type_error("expects a DLPack capsule");
  const char *name = PyCapsule_GetName(object);
  if (name && std::string(name).rfind("used_", 0) == 0)
    throw py::value_error("the DLPack capsule was used already; ask its maker "
                          "for a new one");
  throw py::type_error(std::string("expects a DLPack capsule, but got one "
                                   "named '") +
                       (name ? name : "") + "'");
}

static void checkVersion(const Legacy &) {}
static void checkVersion(const Versioned &managed) {
  if (managed.major != 1)
    throw py::buffer_error("expects DLPack version 1, but got " +
                           std::to_string(managed.major) + "." +
                           std::to_string(managed.minor));
}

/// (address, device type, device id, code, bits, lanes, shape, strides in
/// scalars or None, flags).
static py::tuple inspect(const py::object &capsule) {
  return visit(capsule, [](auto &managed) {
    checkVersion(managed);
    const DlTensor &tensor = managed.tensor;
    py::tuple shape(tensor.ndim), strides(tensor.ndim);
    for (int i = 0; i < tensor.ndim; ++i) {
      shape[i] = tensor.shape[i];
      if (tensor.strides)
        strides[i] = tensor.strides[i];
    }
    auto address = reinterpret_cast<uint64_t>(tensor.data) + tensor.byteOffset;
    return py::make_tuple(
        tensor.data ? address : 0, tensor.device.type, tensor.device.id,
        tensor.dtype.code, tensor.dtype.bits, tensor.dtype.lanes, shape,
        tensor.strides ? py::object(strides) : py::object(py::none()),
        managed.flagBits());
  });
}

/// Marks the capsule as used; the result frees the tensor when it goes.
static py::capsule take(const py::object &capsule) {
  return visit(capsule, [&](auto &managed) {
    using Managed = std::remove_reference_t<decltype(managed)>;
    py::capsule owner(&managed, [](void *pointer) {
      auto *taken = static_cast<Managed *>(pointer);
      if (taken->deleter)
        taken->deleter(taken);
    });
    if (PyCapsule_SetName(capsule.ptr(), Managed::usedName))
      throw py::error_already_set();
    return owner;
  });
}

void python::bindDlpack(py::module_ &m) {
  m.def("dlpack_export", &exportArray, py::arg("array"), py::arg("code"),
        py::arg("bits"), py::arg("inner"), py::arg("device_type"),
        py::arg("device_id"), py::arg("versioned"), py::arg("flags"),
        "A capsule over the memory of an array.");
  m.def(
      "dlpack_inspect", &inspect, py::arg("capsule"),
      "The tensor of a capsule: (address, device type, device id, code, bits, "
      "lanes, shape, strides or None, flags).");
  m.def("dlpack_take", &take, py::arg("capsule"),
        "Takes the tensor out of a capsule and returns its owner.");
}
