"""Start of the runtime, and the kernel cache."""

from __future__ import annotations

import os

from warp import _native, config
from warp._src import config as settings
from warp._src.devices import devices
from warp._src.types import dtypes


def init() -> None:
    """Starts the runtime. Everything that needs it does so by itself."""
    devices.initialize()


def clear_kernel_cache() -> None:
    """Removes all compiled kernels from disk; those of this process stay usable."""
    from warp._src.kernels.inspection import forget

    _native.clear_cache()
    forget()


def clear_lto_cache() -> None:
    """There is no such cache: linking is part of compiling."""


def _notice(message: str) -> None:
    from warp._src.logger import notice

    notice(message)


def _type_text(cls):
    """The runtime's question about a value of a new class in a launch."""
    try:
        return dtypes.native_text(cls)
    except TypeError:
        return None


def _set_cache_directory(path) -> None:
    _native.set_cache_directory(os.fsencode(path or ""))


def _set_cache_limit(gibibytes) -> None:
    _native.set_cache_limit(int(gibibytes * (1 << 30)))


def _set_threads(count) -> None:
    """The thread pool reads the variable when it starts."""
    if count is None:
        os.environ.pop("WARP_NUM_THREADS", None)
    else:
        os.environ["WARP_NUM_THREADS"] = str(count)


def _set_lazy(value=None) -> None:
    _native.set_lazy_compile(config.lazy_compile and not config.verbose)


def _set_compile_threads(count) -> None:
    _native.set_compile_threads(max(count or 0, 0))


def _set_assembler(file) -> None:
    _native.set_assembler("" if file == "none" else os.fsencode(file))


def _show_progress(done, all_kernels) -> None:
    from warp._src.kernels.progress import show

    show(done, all_kernels)


def connect() -> None:
    """Hands settings, notices and type names to the runtime."""
    for name in ("lazy_compile", "verbose"):
        settings.on_change(name, _set_lazy)
    settings.on_change("compile_threads", _set_compile_threads)
    _native.set_progress(_show_progress)
    if not config.lazy_compile or config.verbose:
        _set_lazy()
    if config.compile_threads:
        _set_compile_threads(config.compile_threads)
    settings.on_change("ptxas", _set_assembler)
    if config.ptxas != "auto":
        _set_assembler(config.ptxas)
    _native.set_type_resolver(_type_text)
    _native.set_notice_handler(_notice)
    settings.on_change("kernel_cache_dir", _set_cache_directory)
    settings.on_change("kernel_cache_limit", _set_cache_limit)
    settings.on_change("num_threads", _set_threads)
    settings.on_change("cache_kernels", _native.set_cache_enabled)
    if config.kernel_cache_dir:
        _set_cache_directory(config.kernel_cache_dir)
    settings.on_change("profile", _native.set_profile)
    if config.profile:
        _native.set_profile(config.profile)
    _set_cache_limit(config.kernel_cache_limit)
    if not config.cache_kernels:
        _native.set_cache_enabled(False)
