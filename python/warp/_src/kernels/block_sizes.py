"""Threads per block: the number of a launch, its default and its limit."""

from __future__ import annotations

from warp import config
from warp._src import errors

# Threads of a block where none are named.
DEFAULT_THREADS = 256
# More, no block has.
MOST_THREADS = 1024


def block_threads(kernel, index, block_dim) -> int:
    """Threads of the blocks of a launch.

    Args:
        kernel: what `@wp.kernel` made.
        index: of the device; negative is the CPU.
        block_dim: what the launch asks for, None or 0 for no wish.

    Raises:
        WarpLaunchValueError: there are more than blocks have.
    """
    if index < 0 and not config.enable_cpu_blocks:
        return 1
    threads = block_dim if block_dim and block_dim > 0 else kernel.option("block_dim") or 0
    if threads > MOST_THREADS:
        raise errors.WarpLaunchValueError(
            f"launch('{kernel.key}'): block_dim={threads}, but a block has at most {MOST_THREADS} "
            "threads"
        )
    return threads or (1 if index < 0 else DEFAULT_THREADS)
