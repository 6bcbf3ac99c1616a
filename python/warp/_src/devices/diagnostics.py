"""`wp.print_diagnostics`: what is asked of somebody who reports a problem."""

from __future__ import annotations

import platform
import sys

from warp import _native, config
from warp._src import config as settings
from warp._src.devices import devices


def print_diagnostics() -> dict:
    """Prints versions, devices and settings that differ from their default; gives the same.

    Returns:
        A dictionary; what this package has nothing of is None or False.
    """
    info = {**_versions(), **_build(), "devices": [_device(one) for one in devices.get_devices()]}
    print("Software")
    for name in ("warp_python", "numpy", "python", "platform", "torch", "jax", "jaxlib"):
        if name in info:
            print(f"  {name}: {info[name]}")
    print(f"  kernel cache: {_native.cache_directory()}")
    print("Devices")
    for device in devices.get_devices():
        free, total = device.free_memory, device.total_memory
        size = f"{free / 2**30:.1f} of {total / 2**30:.1f} GiB free"
        print(f"  {device.alias}: {device.name}, {size}")
    if not devices.is_cuda_available():
        print(f"  no CUDA device: {_native.cuda_unavailable_reason()}")
    changed = [
        f"  {setting.name} = {getattr(config, setting.name)!r}"
        for setting in settings.SETTINGS.values()
        if getattr(config, setting.name) != setting.default
    ]
    if changed:
        print("\n".join(("Settings", *changed)))
    return info


def _versions() -> dict:
    import importlib.metadata

    found = {
        "warp_python": config.version,
        "warp_native": config.version,
        "warp_clang": None,
        "llvm": "22",
        "numpy": importlib.metadata.version("numpy"),
        "python": sys.version.split()[0],
        "platform": platform.platform(),
    }
    for name in ("torch", "jax", "jaxlib"):
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _build() -> dict:
    return {
        "cuda_enabled": devices.is_cuda_available(),
        "cuda_toolkit": devices.get_cuda_toolkit_version(),
        "cuda_driver": devices.get_cuda_driver_version(),
        **dict.fromkeys(("nvrtc", "cuda_compatibility", "libmathdx", "nanovdb", "host_compiler")),
        **dict.fromkeys(("mathdx_enabled", "cubql_enabled"), False),
        "debug": config.mode == "debug",
        "verify_fp": bool(config.verify_fp),
        "fast_math": bool(config.fast_math),
    }


def _device(device) -> dict:
    described = {
        "alias": device.alias,
        "name": device.name,
        "memory_gb": device.total_memory / 2**30,
    }
    if device.is_cuda:
        described |= {"arch": f"sm_{device.arch}", "sm_count": device.sm_count}
        described["mempool_enabled"] = device.is_mempool_enabled
        described["pci_bus_id"] = device.pci_bus_id
    return described
