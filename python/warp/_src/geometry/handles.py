"""Handles: the numbers by which kernels know geometry.

A handle leads to a slot of 256 bytes (lib/Geometry/Slots.h). In kernels `words(id, kind)` are those
bytes: of the object, or of an empty one where the handle is none of that kind that is alive.
"""

from warp._src.builtin_table import HANDLES
from warp._src.device_table import KINDS
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.scalars import int32, uint64

GRID, BVH, MESH, VOLUME = (KINDS[name] for name in ("HashGrid", "Bvh", "Mesh", "Volume"))
# Words of an array descriptor from its first one: the address of gradients, the extent.
GRADIENTS, EXTENT = 1, 2


def _words(id: uint64, kind: int):
    return wp.array(ptr=wp._library_call("warp_slot", id, kind), shape=32, dtype=uint64)


def _integers(address: uint64, count: int):
    return wp.array(ptr=address, shape=count, dtype=int32)


words = Function(_words, "words")
integers = Function(_integers, "integers")


def publish(functions: dict) -> None:
    """Makes functions public names of kernels, whose launches check the handles they get."""
    for name, function in functions.items():
        function.__module__ = "warp"
        if name in HANDLES:
            function.handle = KINDS[HANDLES[name]]
