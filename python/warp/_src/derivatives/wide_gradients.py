"""Gradients with elements of 16 bits, while a derivative runs.

Kernels add to gradients of at least 32 bits. A launch of a derivative gets copies of narrow
gradients with such elements, and what is in them in the end is rounded once: sums inside a launch
lose nothing, and what was in a gradient before is part of the sum.
"""

from __future__ import annotations

from warp._src.arrays.array import array
from warp._src.arrays.casts import cast
from warp._src.arrays.create import empty
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.layout import bytes_spanned
from warp._src.arrays.observers import Observing
from warp._src.devices.devices import by_index
from warp._src.devices.scoped import ScopedStream
from warp._src.types.scalars import uint8


class WideGradients:
    """The arguments of an adjoint launch, whose arrays have gradients of at least 32 bits.

    Gradients that share memory share it as wide ones, too.

    Args:
        call: the launch.
        replaced: arrays to use in place of the launch's, by number.

    Attributes:
        values: the arguments.
    """

    def __init__(self, call, replaced=None):
        self._call = call
        self._pairs: list[tuple[array, array]] = []
        replaced = replaced or {}
        narrow = {
            i: leaf
            for i, (_, leaf) in enumerate(call.leaves)
            if leaf is not None and leaf.requires_grad and is_narrow(leaf)
        }
        if narrow:
            wide = self._allocate([leaf.grad for leaf in narrow.values()])
            replaced = dict(replaced)
            for i, leaf in narrow.items():
                contents = replaced.get(i, leaf)
                view = contents._view(0, contents.shape, contents.strides)
                view.grad = wide[_place(leaf.grad)]
                replaced[i] = view
        self.values = call.with_leaves(replaced)

    def _allocate(self, gradients) -> dict:
        """Wide arrays by place of the narrow ones, over memory that lies as theirs does."""
        found = {_place(one): one for one in gradients}
        wide: dict = {}
        block: list = []
        end = 0
        for place, one in sorted(found.items(), key=lambda item: item[0][0]):
            if block and place[0] >= end:
                wide |= _wide_views(block, end)
                block = []
            end = max(end if block else 0, place[0] + bytes_spanned(one))
            block.append(one)
        wide |= _wide_views(block, end)
        self._pairs = [(one, wide[place]) for place, one in found.items() if one.size]
        return wide

    def load(self) -> None:
        """Copies what is in the narrow gradients to the wide ones."""
        self._cast(self._pairs)

    def store(self) -> None:
        """Rounds what is in the wide gradients to the narrow ones."""
        self._cast([(wide, narrow) for narrow, wide in self._pairs])

    def _cast(self, pairs) -> None:
        if pairs:
            with Observing(tape=None), ScopedStream(self._call.stream):
                for source, target in pairs:
                    cast(source, target)


def is_narrow(one: array) -> bool:
    """True if the gradient of an array has elements of 16 bits."""
    return gradient_type(one.dtype) is not one.dtype and one.grad.item_size == one.item_size


def _place(one) -> tuple:
    return (one.ptr or 0, one.shape, one.strides, one.dtype)


def _wide_views(block, end) -> dict:
    """For arrays in one piece of memory, the first of them where it begins, arrays like them."""
    start = block[0].ptr or 0
    memory = empty(max(2 * (end - start), 1), uint8, by_index(block[0].device_index))
    return {
        _place(one): memory._view(
            2 * ((one.ptr or 0) - start),
            one.shape,
            [2 * stride for stride in one.strides],
            gradient_type(one.dtype),
        )
        for one in block
    }
