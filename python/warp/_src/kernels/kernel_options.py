"""The options of a kernel that `@wp.kernel` accepts."""

from __future__ import annotations

import warnings

from warp._src.argument_kinds import NAMES
from warp._src.arguments import shown

_INERT = {"enable_cuda_smem_spilling", "cluster_dim", "entry_point_abi", "grid_stride"}


def check_launch_bounds(bounds) -> tuple[int, int]:
    """Launch bounds as (threads of a block, blocks of a multiprocessor or 0).

    Raises:
        TypeError, ValueError: they are not one or two positive ints.
    """
    values = bounds if isinstance(bounds, (tuple, list)) else (bounds,)
    if not all(isinstance(value, int) and not isinstance(value, bool) for value in values):
        raise TypeError(f"launch_bounds expects an int or two, but got {bounds!r}")
    if not 1 <= len(values) <= 2 or min(values) < 1 or values[0] > 1024:
        raise ValueError(
            "launch_bounds expects 1 to 1024 threads, and perhaps a positive number of blocks, "
            f"but got {bounds!r}"
        )
    return values[0], values[1] if len(values) == 2 else 0


def check_registers(count) -> int:
    """The number of registers of a thread.

    Raises:
        TypeError, ValueError: it is no int from 1 to 255.
    """
    if not isinstance(count, int) or isinstance(count, bool):
        raise TypeError(f"cuda_max_registers expects an int, but got {count!r}")
    if not 1 <= count <= 255:
        raise ValueError(f"cuda_max_registers expects 1 to 255, but got {count}")
    return count


def check_constants(names) -> tuple[str, ...]:
    """Names of parameters that many launches share.

    Raises:
        TypeError: they are no names.
    """
    if not NAMES.fits(names):
        raise TypeError(f"launch_constants expects names of parameters, but got {shown(names)}")
    return tuple(names)


def inert_options(options: dict, enable_backward) -> dict:
    """Options that change nothing, but tell kernels apart.

    Raises:
        TypeError, ValueError: an option is unknown or has an impossible value.
    """
    unknown = set(options) - _INERT
    if unknown:
        raise TypeError(f"kernel has no option '{unknown.pop()}'")
    inert = {name: value for name, value in options.items() if value is not None}
    if inert.get("enable_cuda_smem_spilling") is False:
        del inert["enable_cuda_smem_spilling"]
    elif not isinstance(inert.get("enable_cuda_smem_spilling", True), bool):
        given = inert["enable_cuda_smem_spilling"]
        raise TypeError(f"enable_cuda_smem_spilling expects a bool, but got {given!r}")
    _check_clusters(inert.get("cluster_dim", 1))
    _check_entry_point(options.get("entry_point_abi", "warp"), enable_backward)
    return inert


def _check_clusters(count) -> None:
    if not isinstance(count, int) or isinstance(count, bool):
        raise TypeError(f"cluster_dim expects an int, but got {count!r}")
    if not 1 <= count <= 16:
        raise ValueError(f"cluster_dim expects 1 to 16 blocks, but got {count}")
    if count > 1:
        warnings.warn(
            f"cluster_dim={count} changes nothing: blocks are launched without clusters",
            stacklevel=4,
        )


def _check_entry_point(abi, enable_backward) -> None:
    if abi not in ("warp", "external_constant_params"):
        raise ValueError(
            f"entry_point_abi must be 'warp' or 'external_constant_params', but got {abi!r}"
        )
    if abi != "warp" and enable_backward is not False:
        raise ValueError(f"entry_point_abi={abi!r} requires enable_backward=False")


def ordered_threads(value) -> int:
    """Most threads of a CPU launch that keep their order, by a value of `ordered_slots`."""
    most = (1 << 63) - 1
    # 1 is True, as it is in environment variables: one thread has no order.
    return most if value == 1 else min(int(value or 0), most)
