"""`warp._src.build`: what packages call before they compile."""

from __future__ import annotations

from warp import config
from warp._src.devices.runtime import clear_kernel_cache as clear_kernel_cache
from warp._src.devices.runtime import clear_lto_cache as clear_lto_cache


def init_kernel_cache(path=None) -> None:
    """Puts the kernel cache into a folder; without one into the default folder."""
    config.kernel_cache_dir = path
