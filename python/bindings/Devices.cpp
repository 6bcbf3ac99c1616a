//===- Devices.cpp - Devices, streams and events for Python ---------------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Gil.h"
#include "Native.h"

#include "warp/Device.h"
#include "warp/Graph.h"
#include "warp/JitListener.h"
#include "warp/KernelCache.h"
#include "warp/LaneTrials.h"
#include "warp/LaunchQueue.h"
#include "warp/ThreadPool.h"

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

namespace py = pybind11;
using namespace warp;
using WithoutLock = py::call_guard<warp::python::Unlocked>;

static std::string uuidText(const DeviceInfo &info) {
  std::string text = "GPU-";
  char part[4];
  for (size_t i = 0; i < info.uuid.size(); ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10)
      text += '-';
    std::snprintf(part, sizeof(part), "%02x", info.uuid[i]);
    text += part;
  }
  return text;
}

static py::dict describe(int device) {
  const DeviceInfo &info = deviceInfo(device);
  py::dict fields;
  fields["alias"] = info.alias;
  fields["name"] = info.name;
  fields["arch"] = info.arch;
  fields["sm_count"] = info.smCount;
  fields["max_shared_memory_per_block"] = info.maxSharedMemoryPerBlock;
  fields["is_uva"] = info.isUva;
  fields["has_memory_pool"] = info.hasMemoryPool;
  fields["has_managed_memory"] = info.hasManagedMemory;
  fields["has_concurrent_managed_access"] = info.hasConcurrentManagedAccess;
  fields["has_direct_managed_access_from_host"] =
      info.hasDirectManagedAccessFromHost;
  fields["has_pageable_memory_access"] = info.hasPageableMemoryAccess;
  fields["has_host_native_atomics"] = info.hasHostNativeAtomics;
  fields["uuid"] = isHost(device) ? "" : uuidText(info);
  fields["pci_bus_id"] = info.pciBusId;
  return fields;
}

static uintptr_t address(void *pointer) {
  return reinterpret_cast<uintptr_t>(pointer);
}

/// The package's object for a device, as users know it.
static py::object deviceObject(int index) {
  return py::module_::import("warp._src.devices.devices")
      .attr("by_index")(index);
}

static int cudaIndex(const py::object &device) {
  if (PyLong_CheckExact(device.ptr()))
    return device.cast<int>();
  return py::module_::import("warp._src.devices.streams")
      .attr("cuda_index")(device)
      .cast<int>();
}

static int readPriority(const py::object &priority) {
  if (!PyLong_Check(priority.ptr()))
    throw Error(Error::Kind::LaunchType,
                std::string("expects an int as priority of a stream, but got "
                            "'") +
                    Py_TYPE(priority.ptr())->tp_name + "'");
  return priority.cast<int>();
}

static void bindStreams(py::module_ &m) {
  py::class_<Stream, std::shared_ptr<Stream>> stream(
      m, "Stream", "An order in which a CUDA device does its work.");
  py::class_<Event, std::shared_ptr<Event>> event(
      m, "Event",
      "A place in a stream, which others can wait for and measure.");
  stream
      .def(py::init([](const py::object &device, const py::object &priority,
                       const py::object &handle) {
             int index = cudaIndex(device);
             if (!handle.is_none()) {
               shareWithOthers();
               return std::make_shared<Stream>(
                   index, reinterpret_cast<void *>(handle.cast<uintptr_t>()));
             }
             // The priorities that every device has.
             return std::make_shared<Stream>(
                 index, std::clamp(readPriority(priority), -1, 0));
           }),
           py::arg("device") = py::none(), py::arg("priority") = 0,
           py::arg("cuda_stream") = py::none(),
           "A new stream, or with `cuda_stream` one that somebody else owns.")
      .def_static(
          "from_handle",
          [](int device, uintptr_t handle) {
            shareWithOthers();
            return std::make_shared<Stream>(device,
                                            reinterpret_cast<void *>(handle));
          },
          py::arg("device"), py::arg("handle"))
      .def_property_readonly("device_index", &Stream::device)
      .def_property_readonly(
          "device", [](Stream &self) { return deviceObject(self.device()); })
      .def_property_readonly(
          "cuda_stream",
          [](Stream &self) {
            shareWithOthers();
            return address(self.handle());
          },
          "The driver's handle, for other libraries.")
      .def_property_readonly(
          "_handle", [](Stream &self) { return address(self.handle()); },
          "The same, to tell streams apart.")
      .def_property_readonly("is_complete", &Stream::isComplete)
      .def_property_readonly("is_capturing", &Stream::isCapturing)
      .def_property_readonly("is_blocking", &Stream::isBlocking)
      .def_property_readonly("priority", &Stream::priority)
      .def("synchronize", &Stream::synchronize, WithoutLock())
      .def(
          "record_event",
          [](Stream &self, std::shared_ptr<Event> event, bool external) {
            if (!event)
              event = std::make_shared<Event>(self.device());
            event->record(self, external);
            return event;
          },
          py::arg("event") = nullptr, py::arg("external") = false,
          "Records an event, a new one if none is given. `external`: in a "
          "capture, for streams and graphs outside of it.")
      .def(
          "wait_event",
          [](Stream &self, const Event &event, bool external) {
            waitEvent(self, event, external);
          },
          py::arg("event"), py::arg("external") = false,
          "Lets work queued from now on wait for an event.")
      .def(
          "wait_stream",
          [](Stream &self, const Stream &other, std::shared_ptr<Event> event,
             bool external) {
            if (!event)
              event = std::make_shared<Event>(other.device());
            event->record(other, external);
            waitEvent(self, *event, external);
          },
          py::arg("other_stream"), py::arg("event") = nullptr,
          py::arg("external") = false,
          "Lets work queued from now on wait for what another stream has.")
      .def("__cuda_stream__", [](Stream &self) {
        shareWithOthers();
        return py::make_tuple(0, address(self.handle()));
      });
  event
      .def(py::init([](const py::object &device, bool timing, bool shared) {
             return std::make_shared<Event>(cudaIndex(device), timing, shared);
           }),
           py::arg("device") = py::none(), py::arg("enable_timing") = false,
           py::arg("interprocess") = false)
      .def("ipc_handle",
           [](const Event &self) {
             IpcHandle handle = self.ipcHandle();
             return py::bytes(handle.data(), handle.size());
           })
      .def_property_readonly("device_index", &Event::device)
      .def_property_readonly(
          "device", [](Event &self) { return deviceObject(self.device()); })
      .def_property_readonly("cuda_event",
                             [](Event &self) {
                               shareWithOthers();
                               return address(self.handle());
                             })
      .def_property_readonly("is_complete", &Event::isComplete)
      .def(
          "synchronize",
          [](const Event &self) {
            if (isCapturing(self.device()))
              throw Error(Error::Kind::Runtime,
                          "cannot wait for an event of '" +
                              deviceInfo(self.device()).alias +
                              "' while a graph is being captured on it");
            self.synchronize();
          },
          WithoutLock());
  m.def("elapsed_time", &elapsedMilliseconds, py::arg("start"), py::arg("end"),
        "Milliseconds between two recorded events.");
  m.def("synchronize_busy_streams", &synchronizeBusyStreams, WithoutLock(),
        "Waits for the streams that have work, without looking at reports.");
  m.def("join_streams", &joinStreams, py::arg("stream"),
        "Lets a stream wait for all work queued on its device.");
  m.def("current_stream", &currentStream, py::arg("device"));
  m.def("set_current_stream", &setCurrentStream, py::arg("device"),
        py::arg("stream"));
}

/// The Python function that gets notices; guarded by the GIL.
static PyObject *noticeFunction = nullptr;

static void passNotice(const char *message);

static int passLater(void *message) {
  std::unique_ptr<std::string> text(static_cast<std::string *>(message));
  passNotice(text->c_str());
  return 0;
}

static void passNotice(const char *message) {
  // Nobody may have to wait for a thread that is not Python's while it waits
  // for the lock; the main thread gives the notice when it comes to it.
  if (!PyGILState_GetThisThreadState()) {
    std::unique_ptr<std::string> copy(new std::string(message));
    if (Py_AddPendingCall(&passLater, copy.get()) == 0)
      copy.release();
    return;
  }
  py::gil_scoped_acquire locked;
  if (!noticeFunction)
    return;
  py::object result = py::reinterpret_steal<py::object>(
      PyObject_CallFunction(noticeFunction, "s", message));
  // A notice must not turn into an error of whatever gave it.
  if (!result)
    PyErr_WriteUnraisable(noticeFunction);
}

static void setNoticeFunction(py::object function) {
  Py_XDECREF(noticeFunction);
  noticeFunction = function.is_none() ? nullptr : function.release().ptr();
  setNoticeHandler(noticeFunction ? passNotice : nullptr);
}

static void bindCache(py::module_ &m) {
  m.def("cache_directory", [] {
    // Paths are bytes; Python escapes those that are no text.
    std::string path = KernelCache::get().directory();
    return py::reinterpret_steal<py::object>(
        PyUnicode_DecodeFSDefaultAndSize(path.data(), path.size()));
  });
  m.def(
      "set_cache_directory",
      [](std::string path) { KernelCache::get().setDirectory(path); },
      py::arg("path"));
  m.def(
      "set_cache_enabled",
      [](bool enabled) { KernelCache::get().setEnabled(enabled); },
      py::arg("enabled"));
  m.def(
      "set_profile",
      [](const std::string &name) {
        setJitListener(name == "perf"  ? JitListener::Perf
                       : name == "gdb" ? JitListener::Debugger
                                       : JitListener::None);
      },
      py::arg("name"), "Who is told of loaded code: 'perf', 'gdb' or ''.");
  m.def(
      "clear_cache", [] { return KernelCache::get().clear(); },
      "Removes every entry; returns how many there were.");
  m.def(
      "cache_entries",
      [] {
        std::vector<CacheEntry> entries;
        {
          warp::python::Unlocked unlocked;
          entries = KernelCache::get().entries();
        }
        py::list list;
        for (const CacheEntry &entry : entries)
          list.append(py::make_tuple(entry.file, entry.kind, entry.kernel,
                                     entry.bytes, entry.used));
        return list;
      },
      "(file, kind, kernel, bytes, time of last use) of each, the last used "
      "first.");
  m.def(
      "remove_cached",
      [](const std::string &file) { KernelCache::get().remove(file); },
      py::arg("file"), "Removes a file of the cache.");
  m.def(
      "set_cache_limit",
      [](int64_t bytes) { KernelCache::get().setLimit(bytes); },
      py::arg("bytes"), "Bytes that all files may take; 0 is no limit.");
  m.def(
      "trim_cache", [] { return KernelCache::get().trim(); },
      "Removes what was not used for longest if the files take more than the "
      "limit; returns the bytes removed.");
  m.def("set_notice_handler", &setNoticeFunction,
        py::arg("function").none(true),
        "Function that gets one-line messages to the user; None drops them.");
}

void python::bindDevices(py::module_ &m) {
  m.def("cuda_device_count", &cudaDeviceCount);
  m.def("cuda_unavailable_reason", &cudaUnavailableReason);
  m.def("cuda_driver_version", &cudaDriverVersion);
  m.def("device_info", &describe, py::arg("device"));
  m.def("device_memory", &deviceMemory, py::arg("device"),
        "Bytes of memory: (free, total).");
  m.def(
      "cuda_context", [](int device) { return address(cudaContext(device)); },
      py::arg("device"));
  m.def("synchronize_device", &synchronizeDevice, py::arg("device"),
        WithoutLock());
  m.def("synchronize_all", &synchronizeAll, WithoutLock());
  m.def("set_schedule_trials", &setScheduleTrials, py::arg("enabled"),
        "Has kernels compiled for GPUs from now on check their schedules.");
  m.def("set_lane_trials", &setLaneTrials, py::arg("enabled"),
        "Compare lanes of a CPU with scalar code once they have run for a "
        "while, in kernels that are compiled from now on.");
  m.def("num_threads", &ThreadPool::size, "Threads that CPU launches use.");
  m.def("cpu_quota", &ThreadPool::quota,
        "CPUs that control groups pay for, a large number without a quota.");
  bindStreams(m);
  bindCache(m);
}
