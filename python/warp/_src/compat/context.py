"""`warp._src.context`: names that public packages import, with who does.

Nothing here is promised to stay. `runtime` and `user_modules` are used by Newton and
nvalchemi-toolkit-ops; the classes stand in annotations of many packages.
"""

from __future__ import annotations

from collections.abc import Mapping

from warp._src.builtin_table import BUILTINS, LIBRARY

from warp._src.compat.core import Core
from warp._src.devices import devices
from warp._src.devices.allocators import Allocator as Allocator
from warp._src.devices.devices import Device as Device
from warp._src.devices.devices import DeviceLike as DeviceLike
from warp._src.devices.devices import get_device as get_device
from warp._src.devices.graphs import Graph as Graph
from warp._src.devices.runtime import init as init
from warp._src.devices.streams import Event as Event
from warp._src.devices.streams import Stream as Stream
from warp._src.kernels.function import Function as Function
from warp._src.kernels.kernel import Kernel as Kernel
from warp._src.kernels.launch import Launch as Launch
from warp._src.kernels.launch import launch as launch
from warp._src.kernels.modules import Module as Module
from warp._src.kernels.modules import get_module as get_module
from warp._src.kernels.modules import modules_by_name
from warp._src.language.builtins import lookup
from warp._src.language.public import library_function

# Modules by name: nvalchemi-toolkit-ops renames kernels in it, Newton's tests look modules up.
user_modules = modules_by_name


class _Runtime:
    """The peer's runtime object as packages read it: its devices and versions."""

    core = Core()

    @property
    def cpu_device(self):
        return devices.by_index(devices.CPU)

    @property
    def cuda_devices(self):
        return devices.get_cuda_devices()

    @property
    def is_cuda_enabled(self) -> bool:
        return devices.is_cuda_available()

    @property
    def device_map(self) -> dict:
        return {device.alias: device for device in devices.get_devices()}

    @property
    def default_device(self):
        return devices.get_device()

    @property
    def driver_version(self):
        return devices.get_cuda_driver_version()

    @property
    def toolkit_version(self):
        return devices.get_cuda_toolkit_version()

    @property
    def tape(self):
        """The tape that is recording, or None."""
        from warp._src.arrays.observers import Observers

        return Observers.tape

    def get_device(self, ident=None):
        return devices.get_device(ident)


_runtime = _Runtime()


def __getattr__(name):
    # Packages look whether they have started it.
    if name == "runtime":
        return _runtime if devices.is_initialized() else None
    raise AttributeError(f"module 'warp._src.context' has no attribute '{name}'")


class _BuiltinFunctions(Mapping):
    """Builtins and library functions by name: Newton looks for names in it."""

    def __getitem__(self, name):
        if name not in BUILTINS and name not in LIBRARY:
            raise KeyError(name)
        return library_function(name) or lookup(name)

    def __iter__(self):
        return iter((*BUILTINS, *LIBRARY))

    def __len__(self):
        return len(BUILTINS) + len(LIBRARY)


builtin_functions = _BuiltinFunctions()
