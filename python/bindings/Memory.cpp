//===- Memory.cpp - Allocation, copies and fills for Python ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "Native.h"

#include "warp/Memory.h"

namespace py = pybind11;
using namespace warp;
using namespace warp::python;

/// Bytes below which a host copy is over before another thread would run.
static constexpr size_t shortCopy = 64 << 10;

static void *pointer(uintptr_t address) {
  return reinterpret_cast<void *>(address);
}

/// Calls `fn`, without the GIL if it may take long. `waits`: for work of a GPU.
template <typename Fn>
static void runUnlocked(size_t bytes, Fn &&fn, bool waits = false) {
  if (bytes < shortCopy && !waits)
    return fn();
  warp::python::Unlocked unlocked;
  fn();
}

/// True if a copy waits for what a GPU does to its source.
static bool isRead(int to, int from) { return isHost(to) && !isHost(from); }

static ArrayObject *expectArray(const py::handle &object, const char *what) {
  if (!isArray(object.ptr()))
    throw Error(Error::Kind::LaunchType,
                std::string("expects an array as ") + what + ", but got '" +
                    Py_TYPE(object.ptr())->tp_name + "'");
  return asArray(object.ptr());
}

/// An array that is about to be written.
static ArrayObject *expectWritable(const py::object &object, const char *what) {
  ArrayObject *array = expectArray(object, what);
  if (array->readOnly)
    throw Error(Error::Kind::LaunchValue,
                std::string("expects an array that can be written as ") + what +
                    ", but got a read-only one");
  return array;
}

static size_t byteCount(const ArrayObject *array) {
  size_t bytes = array->itemSize;
  for (int i = 0; i < array->descriptor.ndim; ++i)
    bytes *= array->descriptor.shape[i];
  return bytes;
}

static void copyArrays(const py::object &dst, const py::object &src,
                       const Stream *stream) {
  ArrayObject *to = expectWritable(dst, "destination");
  ArrayObject *from = expectArray(src, "source");
  if (to->itemSize != from->itemSize)
    throw Error(Error::Kind::LaunchType, "expects elements of " +
                                             std::to_string(to->itemSize) +
                                             " bytes to copy from, but got " +
                                             std::to_string(from->itemSize));
  hold(to->device, dst.ptr());
  hold(to->device, src.ptr());
  if (from->device != to->device) {
    hold(from->device, dst.ptr());
    hold(from->device, src.ptr());
  }
  runUnlocked(
      byteCount(to),
      [&] {
        copyArray({&to->descriptor, to->device},
                  {&from->descriptor, from->device}, to->itemSize, stream);
      },
      isRead(to->device, from->device));
}

static void fill(const py::object &dst, const py::bytes &pattern,
                 const Stream *stream) {
  ArrayObject *to = expectWritable(dst, "destination");
  std::string bytes = pattern;
  if (static_cast<int64_t>(bytes.size()) != to->itemSize)
    throw Error(Error::Kind::LaunchType,
                "expects a value of " + std::to_string(to->itemSize) +
                    " bytes, but got " + std::to_string(bytes.size()));
  hold(to->device, dst.ptr());
  runUnlocked(byteCount(to), [&] {
    fillArray({&to->descriptor, to->device}, bytes.data(), bytes.size(),
              stream);
  });
}

void python::bindMemory(py::module_ &m) {
  py::class_<Buffer>(m, "Buffer", "Memory that lives as long as this object.")
      .def(py::init<int, size_t, bool>(), py::arg("device"), py::arg("size"),
           py::arg("pinned") = false)
      .def_property_readonly(
          "ptr",
          [](Buffer &self) { return reinterpret_cast<uintptr_t>(self.data()); })
      .def_property_readonly("size", &Buffer::size)
      .def_property_readonly("device", &Buffer::device)
      .def_property_readonly("pinned", &Buffer::pinned)
      .def("track", &Buffer::track, py::arg("site"));
  m.def(
      "copy_memory",
      [](uintptr_t dst, int dstDevice, uintptr_t src, int srcDevice,
         size_t bytes, const Stream *stream) {
        runUnlocked(
            bytes,
            [&] {
              copyMemory(pointer(dst), dstDevice, pointer(src), srcDevice,
                         bytes, stream);
            },
            isRead(dstDevice, srcDevice));
      },
      py::arg("dst"), py::arg("dst_device"), py::arg("src"),
      py::arg("src_device"), py::arg("size"), py::arg("stream") = nullptr);
  m.def(
      "set_memory",
      [](uintptr_t dst, int device, int byte, size_t bytes,
         const Stream *stream) {
        runUnlocked(bytes, [&] {
          setMemory(pointer(dst), device, byte, bytes, stream);
        });
      },
      py::arg("ptr"), py::arg("device"), py::arg("byte"), py::arg("size"),
      py::arg("stream") = nullptr);
  m.def(
      "clear_new_memory",
      [](uintptr_t memory, int device, size_t bytes) {
        runUnlocked(bytes,
                    [&] { clearNewMemory(pointer(memory), device, bytes); });
      },
      py::arg("ptr"), py::arg("device"), py::arg("size"));
  m.def(
      "write_new_memory",
      [](uintptr_t memory, int device, const py::buffer &contents) {
        py::buffer_info info = contents.request();
        size_t bytes = info.size * info.itemsize;
        runUnlocked(bytes, [&] {
          writeNewMemory(pointer(memory), device, info.ptr, bytes);
        });
      },
      py::arg("ptr"), py::arg("device"), py::arg("contents"),
      "Writes packed bytes of the host to memory that nobody uses yet, at once "
      "and not as part of a graph.");
  m.def(
      "fill_memory",
      [](uintptr_t dst, int device, const py::bytes &pattern, size_t count,
         const Stream *stream) {
        std::string bytes = pattern;
        runUnlocked(bytes.size() * count, [&] {
          fillMemory(pointer(dst), device, bytes.data(), bytes.size(), count,
                     stream);
        });
      },
      py::arg("ptr"), py::arg("device"), py::arg("pattern"), py::arg("count"),
      py::arg("stream") = nullptr);
  m.def("copy_array", &copyArrays, py::arg("dst"), py::arg("src"),
        py::arg("stream") = nullptr,
        "Copies between arrays of one shape, whatever strides and devices.");
  m.def("fill_array", &fill, py::arg("dst"), py::arg("pattern"),
        py::arg("stream") = nullptr,
        "Sets every element to the bytes of a value.");
}
