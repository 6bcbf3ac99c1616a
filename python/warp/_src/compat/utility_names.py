"""Names of the peer's `warp._src.utils`: those of `warp.utils`, and what packages' tests ask for.

The package of that name is ours: a name that it does not have is looked up here.
"""

from __future__ import annotations

import importlib

from warp._src.devices import devices
from warp._src.kernels.maps import map as map


def check_p2p() -> bool:
    """True if copies between GPUs arrive: the driver says so, nothing is tried."""
    from warp._src.devices.memory import is_peer_access_supported

    found = devices.get_cuda_devices()
    return all(is_peer_access_supported(a, b) for a in found for b in found if a is not b)


def __getattr__(name):
    if name.startswith("__"):
        raise AttributeError(name)
    return getattr(importlib.import_module("warp.utils"), name)
