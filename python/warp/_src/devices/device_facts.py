"""Facts about a device that the runtime knows."""

from __future__ import annotations

import sys

from warp import _native


class DeviceFacts:
    """Mixin of `Device`, which has `index`, its number, and `is_cpu` and `is_cuda`."""

    _info = None

    @property
    def info(self) -> dict:
        """The runtime's facts about the device, by name."""
        if self._info is None:
            self._info = _native.device_info(self.index)
        return self._info

    @property
    def name(self) -> str:
        """The name by its maker."""
        return self.info["name"]

    @property
    def arch(self) -> int:
        """Compute capability as 10 * major + minor; 0 for the CPU."""
        return self.info["arch"]

    @property
    def sm_count(self) -> int:
        """Multiprocessors of a GPU; 0 for the CPU."""
        return self.info["sm_count"] if self.is_cuda else 0

    @property
    def max_shared_memory_per_block(self) -> int:
        """Bytes of shared memory that a block may have."""
        return self.info["max_shared_memory_per_block"]

    @property
    def is_uva(self) -> bool:
        """True if host and device share one space of addresses."""
        return self.info["is_uva"]

    @property
    def is_mempool_supported(self) -> bool:
        """True if memory can be allocated in the order of a stream."""
        return self.info["has_memory_pool"]

    @property
    def is_mempool_enabled(self) -> bool:
        """True if new arrays come from the device's memory pool."""
        return _native.is_pool_enabled(self.index)

    @property
    def is_managed_memory_supported(self) -> bool:
        """True if memory can move between the device and the host on its own."""
        return self.info["has_managed_memory"]

    @property
    def is_concurrent_managed_access_supported(self) -> bool:
        """True if the host may use managed memory while kernels of a GPU run."""
        return self.info["has_concurrent_managed_access"]

    @property
    def is_cpu_memory_access_from_gpu_supported(self) -> bool:
        """True if kernels of a GPU may use memory of the host that is not pinned."""
        return self.info["has_pageable_memory_access"]

    @property
    def is_gpu_memory_access_from_cpu_supported(self) -> bool:
        """True if the host may use managed memory on a GPU without moving it."""
        return self.info["has_direct_managed_access_from_host"]

    @property
    def is_cpu_gpu_atomic_supported(self) -> bool:
        """True if atomics of a GPU and of the host on the same memory are native ones."""
        return self.info["has_host_native_atomics"]

    @property
    def is_ipc_supported(self) -> bool:
        """True if other processes can open the device's memory."""
        return self.is_cuda and sys.platform == "linux"

    @property
    def uuid(self) -> str | None:
        """The device's identity, `GPU-...`; None for the CPU."""
        return self.info["uuid"] or None

    @property
    def pci_bus_id(self) -> str | None:
        """The device's place as domain, bus and device, `00000000:0A:00`; None for the CPU."""
        place = self.info["pci_bus_id"].partition(".")[0]
        if not place:
            return None
        domain, bus, device = (int(part, 16) for part in place.split(":"))
        return f"{domain:08X}:{bus:02X}:{device:02X}"

    @property
    def free_memory(self) -> int:
        """Bytes of memory that are free now."""
        return _native.device_memory(self.index)[0]

    @property
    def total_memory(self) -> int:
        """Bytes of memory in all."""
        return _native.device_memory(self.index)[1]
