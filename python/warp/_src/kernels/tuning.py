"""Questions about compiled kernels: what they use, and which block size suits them."""

from __future__ import annotations

import os

from warp import _native, config
from warp._src import errors
from warp._src.argument_kinds import TEXT
from warp._src.arguments import checked
from warp._src.devices.devices import get_device
from warp._src.kernels.kernel import Kernel
from warp._src.version import PACKAGE, VERSION


@checked()
def get_suggested_block_size(kernel, device=None) -> tuple[int, int]:
    """Threads per block that fill a multiprocessor best, and how many such blocks fill the device.

    A small launch may run faster with smaller blocks, which spread over more multiprocessors. The
    CPU has no blocks; the answer is `(1, 1)`.

    With `wp.config.lazy_compile` nobody waits for code that other threads make: for a kernel
    without code the answer is what its launch bounds promise. While launches wait for their code,
    it is for one without bounds blocks of the usual size, as many as fit with 64 registers a
    thread.

    Raises:
        TypeError: `kernel` is not a kernel.
        RuntimeError: it is generic and the device is a GPU; overloads of it are not.
    """
    device = get_device(device)
    if device.is_cpu and isinstance(kernel, Kernel):
        return 1, 1
    native = _prepared(kernel, "get_suggested_block_size")
    return _native.suggested_block(native, device.index)


@checked()
def get_cuda_kernel_properties(kernel, device=None, block_dim=None) -> dict:
    """Resources of a kernel's machine code on a CUDA device.

    Returns:
        Per thread `register_count` and `local_memory_size` (bytes); `shared_memory_size` and
        `constant_memory_size` (bytes); `max_threads_per_block`; `binary_version` (90 for `sm_90`);
        for blocks of `block_dim` threads the `blocks_per_multiprocessor` and the `occupancy`, the
        share of a multiprocessor's threads that can be resident.

    Raises:
        TypeError: `kernel` is not a kernel.
        ValueError: `block_dim` is not positive.
        RuntimeError: the device is no CUDA device, or the kernel is generic.
    """
    native = _prepared(kernel, "get_cuda_kernel_properties")
    if block_dim is not None and (not isinstance(block_dim, int) or block_dim < 1):
        raise ValueError(f"block_dim expects a positive int, but got {block_dim!r}")
    device = get_device(device)
    if device.is_cpu:
        raise errors.WarpError(
            f"kernel '{kernel.key}' has no CUDA properties on device '{device}'",
            code="cuda-properties",
        )
    return _native.cuda_kernel_properties(native, device.index, block_dim or 0)


@checked()
def get_cuda_max_cluster_dim(
    kernel, device=None, *, block_dim: int | None = None, dynamic_smem_bytes: int = 0
) -> int:
    """Blocks that a launch of a kernel can have in a cluster: 1, as no launch has clusters.

    Raises:
        TypeError: `kernel` is not a kernel.
        RuntimeError: it is generic; overloads of it are not.
    """
    _prepared(kernel, "get_cuda_max_cluster_dim")
    get_device(device)
    return 1


def get_cuda_supported_archs() -> list[int]:
    """GPU architectures that kernels can be compiled for, 90 for `sm_90`."""
    return _native.gpu_architectures()


@checked(cpu_compiler_flags=TEXT)
def get_cpu_kernel_cache_key(*, cpu_compiler_flags=None) -> str:
    """A name for caches of CPU kernels: it differs where compiled code may.

    Args:
        cpu_compiler_flags: names of caches differ where they do, by default those of
            `wp.config.cpu_compiler_flags`; code is always for the host.
    """
    import hashlib
    import platform

    flags = cpu_compiler_flags
    if flags is None:
        flags = config.cpu_compiler_flags
    if flags is None:
        flags = "-march=native"
    processors = [flag for flag in flags.split() if flag.startswith(("-march=", "-mcpu="))]
    text = _native.host_processor() + " ".join(processors)
    digest = hashlib.blake2b(text.encode(), digest_size=4).hexdigest()
    return f"{VERSION}-{platform.system()}-{platform.machine()}-{digest}"


def get_include() -> str:
    """Folder of the C++ headers, for `#include "warp/SavedModule.h"`."""
    return os.path.join(_package(), "include")


def get_cmake_dir() -> str:
    """Folder where CMake's `find_package(warp)` finds headers and library."""
    return os.path.join(_package(), "cmake")


def _package() -> str:
    return os.path.abspath(PACKAGE)


def _prepared(kernel, caller: str):
    if not isinstance(kernel, Kernel):
        raise errors.WarpTypeError(
            f"{caller}: expects a kernel, but got '{type(kernel).__name__}'",
            code="kernel-expected",
            facts={"name": type(kernel).__name__},
        )
    if kernel.is_generic:
        raise errors.WarpError(
            f"{caller}: kernel '{kernel.key}' is generic, its types are open",
            hint="ask for what `wp.overload` gives",
            code="kernel-generic",
            facts={"caller": caller},
        )
    return kernel.prepare()
