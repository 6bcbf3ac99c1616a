"""Start of the runtime, and the kernel cache."""

from __future__ import annotations

import os
import sys

from warp import _native, config
from warp._src import config as settings
from warp._src.devices import devices
from warp._src.types import dtypes


def init() -> None:
    """Starts the runtime. Everything that needs it does so by itself."""
    devices.initialize()


def clear_kernel_cache() -> None:
    """Removes all compiled kernels from disk; those of this process stay usable."""
    _native.clear_cache()


def clear_lto_cache() -> None:
    """There is no such cache: linking is part of compiling."""


def print_diagnostics() -> None:
    """Prints version, devices and settings that differ from their default."""
    print(f"warp-mlir {config.version}, Python {sys.version.split()[0]}")
    print(f"kernel cache: {_native.cache_directory()}")
    for device in devices.get_devices():
        free, total = device.free_memory, device.total_memory
        print(f"{device.alias}: {device.name}, {free / 2**30:.1f} of {total / 2**30:.1f} GiB free")
    if not devices.is_cuda_available():
        print(f"no CUDA device: {_native.cuda_unavailable_reason()}")
    for setting in settings.SETTINGS.values():
        value = getattr(config, setting.name)
        if value != setting.default:
            print(f"config.{setting.name} = {value!r}")


def _notice(message: str) -> None:
    from warp._src.logger import notice

    notice(message)


def _type_text(cls):
    """What the runtime asks when it meets a value of a new class in a launch."""
    try:
        return dtypes.native_text(cls)
    except TypeError:
        return None


def _set_cache_directory(path) -> None:
    _native.set_cache_directory(os.fsencode(path or ""))


def _set_threads(count) -> None:
    """The thread pool reads the variable when it starts."""
    if count is None:
        os.environ.pop("WARP_NUM_THREADS", None)
    else:
        os.environ["WARP_NUM_THREADS"] = str(count)


def connect() -> None:
    """Hands settings, notices and type names to the runtime."""
    _native.set_type_resolver(_type_text)
    _native.set_notice_handler(_notice)
    settings.on_change("kernel_cache_dir", _set_cache_directory)
    settings.on_change("num_threads", _set_threads)
    settings.on_change("cache_kernels", _native.set_cache_enabled)
    if config.kernel_cache_dir:
        _set_cache_directory(config.kernel_cache_dir)
    if not config.cache_kernels:
        _native.set_cache_enabled(False)
