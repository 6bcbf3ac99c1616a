"""Public names that are made when first asked for: builtins and submodules."""

from __future__ import annotations

import importlib

from warp._src.language import namespace
from warp._src.language.builtins import names as builtin_names

_SUBMODULES = ("autograd", "optim", "sparse", "types", "utils")
# What few programs use, by the module that holds it.
_RARE = {
    name: home
    for home, held in (
        ("logger", ("Logger", "ScopedLogLevel", "ScopedLogger", "get_logger", "set_logger")),
        (
            "devices.timing",
            (
                *("TIMING_ALL", "TIMING_GRAPH", "TIMING_KERNEL", "TIMING_KERNEL_BUILTIN"),
                *("TIMING_MEMCPY", "TIMING_MEMSET", "TimingResult", "timing_begin", "timing_end"),
                *("timing_print", "cuda_profiler_start", "cuda_profiler_stop"),
                "ScopedCudaProfiler",
            ),
        ),
    )
    for name in held
}
# Written in the kernel language.
LIBRARY_NAMES = (
    *("curlnoise", "quat_from_euler", "quat_to_euler", "spatial_adjoint", "spatial_bottom"),
    *("spatial_cross", "spatial_cross_dual", "spatial_dot", "spatial_top", "transform_twist"),
    *("transform_wrench", "velocity_at_point"),
)


def find(name: str):
    """What `warp.<name>` is, for names that the package does not hold itself.

    Raises:
        AttributeError: there is no such name.
    """
    if name in _SUBMODULES:
        return importlib.import_module(f"warp.{name}")
    if name in _RARE:
        return getattr(importlib.import_module(f"warp._src.{_RARE[name]}"), name)
    if name == "sym_fn3":
        from warp._src.language.symmetric import sym_fn3

        return sym_fn3
    found = None if name.startswith("_") else namespace.find(name)
    if name in LIBRARY_NAMES:
        from warp._src.language.library import LIBRARY

        found = LIBRARY[name]
    if found is None:
        raise AttributeError(f"module 'warp' has no attribute '{name}'")
    return found


def names(held) -> list[str]:
    """All public names."""
    public = {name for name in held if not name.startswith("_")}
    return sorted(
        public | set(builtin_names()) | set(_SUBMODULES) | set(LIBRARY_NAMES) | set(_RARE)
    )
