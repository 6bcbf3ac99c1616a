//===- Peers.cpp - Access, pools, sharing and the tracker for Python ------===//
//
// Part of Warp on MLIR, under the Apache License v2.0.
//
//===----------------------------------------------------------------------===//

#include "Native.h"

#include "warp/MemoryTracker.h"
#include "warp/Peers.h"

#include <algorithm>

namespace py = pybind11;
using namespace warp;

static void *pointer(uintptr_t address) {
  return reinterpret_cast<void *>(address);
}

static py::bytes toBytes(const IpcHandle &handle) {
  return py::bytes(handle.data(), handle.size());
}

static IpcHandle toHandle(const py::bytes &bytes) {
  std::string text = bytes;
  IpcHandle handle;
  if (text.size() != handle.size())
    throw Error(Error::Kind::LaunchValue,
                "expects a handle of 64 bytes, but got " +
                    std::to_string(text.size()));
  std::copy(text.begin(), text.end(), handle.begin());
  return handle;
}

static void bindAccess(py::module_ &m) {
  m.def("can_peers_link", &canPeersLink, py::arg("device"), py::arg("peer"));
  m.def("is_peer_access_enabled", &isPeerAccessEnabled, py::arg("device"),
        py::arg("peer"));
  m.def("set_peer_access_enabled", &setPeerAccessEnabled, py::arg("device"),
        py::arg("peer"), py::arg("enable"));
  m.def("is_pool_access_enabled", &isPoolAccessEnabled, py::arg("device"),
        py::arg("peer"));
  m.def("set_pool_access_enabled", &setPoolAccessEnabled, py::arg("device"),
        py::arg("peer"), py::arg("enable"));
  m.def(
      "can_access",
      [](int device, int owner, uintptr_t memory) {
        return canAccess(device, owner, pointer(memory));
      },
      py::arg("device"), py::arg("owner"), py::arg("ptr"));
  m.def(
      "memory_kind",
      [](int device, uintptr_t memory) {
        return static_cast<int>(memoryKind(device, pointer(memory)));
      },
      py::arg("device"), py::arg("ptr"));
  m.def("map_context",
        [](uintptr_t context) { return mapContext(pointer(context)); });
  m.def(
      "set_current_context",
      [](uintptr_t context) {
        return reinterpret_cast<uintptr_t>(
            setCurrentCudaContext(pointer(context)));
      },
      py::arg("context"), "Returns the one that was current.");
  m.def("current_context",
        [] { return reinterpret_cast<uintptr_t>(currentCudaContext()); });
}

static void bindPools(py::module_ &m) {
  m.def("is_pool_enabled", &isPoolEnabled, py::arg("device"));
  m.def("set_pool_enabled", &setPoolEnabled, py::arg("device"),
        py::arg("enable"));
  m.def("pool_release_threshold", &poolReleaseThreshold, py::arg("device"));
  m.def("set_pool_release_threshold", &setPoolReleaseThreshold,
        py::arg("device"), py::arg("bytes"));
  m.def("pool_use", &poolUse, py::arg("device"),
        "Bytes in use from the pool: (now, at most).");
  m.def(
      "allocate_managed",
      [](int device, size_t bytes) {
        return reinterpret_cast<uintptr_t>(allocateManaged(device, bytes));
      },
      py::arg("device"), py::arg("size"));
  m.def(
      "free_managed",
      [](int device, uintptr_t memory) {
        freeManaged(device, pointer(memory));
      },
      py::arg("device"), py::arg("ptr"));
}

static void bindSharing(py::module_ &m) {
  m.def(
      "export_memory",
      [](int device, uintptr_t memory) {
        auto [handle, offset] = exportMemory(device, pointer(memory));
        return py::make_tuple(toBytes(handle), offset);
      },
      py::arg("device"), py::arg("ptr"));
  m.def(
      "import_memory",
      [](int device, const py::bytes &handle) {
        return reinterpret_cast<uintptr_t>(
            importMemory(device, toHandle(handle)));
      },
      py::arg("device"), py::arg("handle"));
  m.def(
      "close_imported",
      [](int device, uintptr_t memory) {
        closeImported(device, pointer(memory));
      },
      py::arg("device"), py::arg("ptr"));
  m.def(
      "import_event",
      [](int device, const py::bytes &handle) {
        return std::make_shared<Event>(device, toHandle(handle));
      },
      py::arg("device"), py::arg("handle"));
}

static void bindTracker(py::module_ &m) {
  m.def(
      "tracker_live",
      [] {
        py::list list;
        for (const MemoryTracker::Allocation &allocation :
             MemoryTracker::get().live())
          list.append(py::make_tuple(allocation.number, allocation.bytes,
                                     allocation.device, allocation.pinned,
                                     allocation.site));
        return list;
      },
      "Memory that was not freed yet: (number, bytes, device, pinned, site).");
  m.def(
      "tracker_totals",
      [] {
        py::dict totals;
        for (const auto &[device, sum] : MemoryTracker::get().totals())
          totals[py::int_(device)] =
              py::make_tuple(sum.current, sum.peak, sum.allocations, sum.frees);
        return totals;
      },
      "By device: (current bytes, peak bytes, allocations, frees).");
  m.def("tracker_clear", [] { MemoryTracker::get().clear(); });
  m.def(
      "tracker_add",
      [](uintptr_t memory, size_t bytes, int device, const std::string &site) {
        MemoryTracker::get().add(pointer(memory), bytes, device, false, site);
      },
      py::arg("ptr"), py::arg("size"), py::arg("device"), py::arg("site"));
  m.def("tracker_remove",
        [](uintptr_t memory) { MemoryTracker::get().remove(pointer(memory)); });
}

void python::bindPeers(py::module_ &m) {
  bindAccess(m);
  bindPools(m);
  bindSharing(m);
  bindTracker(m);
}
