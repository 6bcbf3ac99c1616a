"""Gradients of the arrays of a launch, which are made when they are first used."""

from __future__ import annotations

from warp import _native
from warp._src.arrays.array import array
from warp._src.devices.devices import get_stream
from warp._src.types.structs import StructInstance


def gradients_of(call, values, same=()) -> list[array]:
    """The gradients of a launch's arrays; they are there from then on, also in structs.

    Arguments that are one array (`same_arrays`) share one.
    """
    if not call.signature.flat:
        for value in values:
            if isinstance(value, StructInstance):
                value.refresh()
    leaves = [(i, leaf) for i, (_, leaf) in enumerate(call.leaves) if not same or same[i] == i]
    return [leaf.grad for _, leaf in leaves if leaf is not None and leaf.requires_grad]


def make_gradients(call) -> None:
    """Lets the stream of a launch wait for gradients that are used for the first time."""
    if any(
        leaf is not None and leaf.requires_grad and leaf._grad is None for _, leaf in call.leaves
    ):
        gradients_of(call, call.values)
        if not _native.is_capturing(call.device):
            call.stream.wait_stream(get_stream(call.stream.device))
