"""Arrays of a thread whose addresses are reckoned with: `wp.array(ptr=a.ptr + wp.uint64(8), ...)`.

Other arrays of a thread are values (`local_arrays`). One whose address is added to lies in memory
that the thread has for itself, and is an array like those that are passed to kernels: what is
written through one address is read through another. There is no derivative through it.
"""

from __future__ import annotations

import ast
import itertools
import math

from warp._src.frontend.bindings import INT32
from warp._src.kernels import texts
from warp._src.types import dtypes

_FUNCTION = "_warp_thread_memory"


def is_addressed(source, node) -> bool:
    """True if the array that a call makes gets a name whose `ptr` is added to."""
    if "ptr" not in source.words():
        return False
    names, moved = set(), set()
    for item in texts.walk(source.tree):
        if isinstance(item, ast.Assign) and item.value is node:
            names.update(one.id for one in item.targets if isinstance(one, ast.Name))
        elif isinstance(item, ast.BinOp):
            for side in (item.left, item.right):
                if isinstance(side, ast.Attribute) and side.attr == "ptr":
                    moved.update(one.id for one in [side.value] if isinstance(one, ast.Name))
    return not names.isdisjoint(moved)


def make(context, shape, native, node):
    """An array of a shape in memory of the thread, all zero."""
    dtype = dtypes.dtype_of(native)
    size = math.prod(shape) * dtypes.type_size_in_bytes(dtype)
    context.at(node)
    builder, session = context.builder, context.session
    numbers = [builder.constant(INT32, number) for number in (session.next_memory(), size)]
    (address,), _ = builder.builtin(_FUNCTION, numbers)
    extents = [context.materialize(extent, node) for extent in shape]
    kind = type(native).parse(f"!warp.array<{len(shape)} x {native}>")
    context.at(node)
    array = builder.array_at(kind, address, extents, None)
    zero = builder.zero(native)
    for place in itertools.product(*map(range, shape)):
        builder.store(array, [builder.constant(INT32, index) for index in place], zero)
    return array
