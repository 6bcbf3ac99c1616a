"""Arrays over the buffers that XLA passes to a Python function, one set per entry of a batch."""

from __future__ import annotations

import contextlib
import math
import threading
from _blake2 import blake2b

from warp import _native
from warp._src.arrays.array import array
from warp._src.devices import devices
from warp._src.devices.graphs import ScopedCapture
from warp._src.devices.scoped import ScopedStream
from warp._src.devices.streams import Stream
from warp._src.types import dtypes

TARGET = "warp_mlir_callback"
RECORDABLE_TARGET = "warp_mlir_recordable_callback"
"""For functions that JAX may record in a CUDA graph of its own instead of calling each time."""

_registered = False


def register() -> None:
    """Makes the native functions known to XLA."""
    global _registered
    if not _registered:
        import jax

        on_cpu, on_cuda, recordable = _native.xla_callback_handlers()
        for target, handler in ((TARGET, on_cuda), (RECORDABLE_TARGET, recordable)):
            jax.ffi.register_ffi_target(target, on_cpu, platform="cpu")
            jax.ffi.register_ffi_target(target, handler, platform="CUDA")
        _registered = True


def add_callback(text, function) -> int:
    """The number under which XLA finds a function.

    The number comes from a text that says what the function does, so that a program that JAX has
    kept on disk finds it again.
    """
    for copy in range(1 << 20):
        digest = blake2b(f"{copy} {text}".encode(), digest_size=8).digest()
        number = int.from_bytes(digest, "little") >> 1
        if _native.xla_add_callback(number, function):
            return number
    raise RuntimeError("too many functions with the same source")


class Buffer:
    """An array as one of XLA's buffers: its type, and its extents without those of a batch."""

    def __init__(self, dtype, shape):
        self.dtype, self.shape = dtype, tuple(shape)
        self.rank = len(self.shape) + len(getattr(dtype, "_shape_", ()))
        self.bytes = math.prod(self.shape) * dtypes.type_size_in_bytes(dtype)

    def batch(self, extents) -> tuple:
        """The leading extents that `vmap` has added."""
        return tuple(extents[: len(extents) - self.rank])

    def array(self, address, device):
        return array(ptr=address, shape=self.shape, dtype=self.dtype, device=device)


def entries(layout, given):
    """Addresses of the buffers for each entry of a batch.

    Args:
        layout: a `Buffer` for each of them.
        given: address and extents of each.
    """
    batches = [one.batch(extents) for one, (_, extents) in zip(layout, given, strict=True)]
    rank = max(map(len, batches), default=0)
    whole = [1] * rank
    for batch in batches:
        for axis, extent in enumerate(batch):
            whole[axis] = extent if extent != 1 else whole[axis]
    for index in range(math.prod(whole)):
        where, rest = [0] * rank, index
        for axis in reversed(range(rank)):
            rest, where[axis] = divmod(rest, whole[axis])
        addresses = []
        for one, (address, _), batch in zip(layout, given, batches, strict=True):
            position = 0
            for at, extent in zip(where, batch, strict=False):
                position = position * extent + (at if extent != 1 else 0)
            addresses.append(address + position * one.bytes)
        yield addresses


class Place:
    """Makes the device and the stream of a call the current ones for a block.

    XLA calls from threads of its own, several at once. The device is the default of the calling
    thread alone; the stream is that of its device for everybody, so calls on a GPU are serialised.

    Where JAX records a graph, what the block uses is kept for good: JAX does not tell when the
    graph goes.
    """

    def __init__(self, index, stream):
        self.device = devices.by_index(index)
        self.stream = Stream.from_handle(index, stream) if self.device.is_cuda else None

    def __enter__(self):
        self._blocks = contextlib.ExitStack()
        if self.stream is not None:
            turn = _turns.setdefault(self.device.index, threading.RLock())
            self._blocks.enter_context(turn)
        self._blocks.enter_context(devices.OwnDefault(self.device))
        self._blocks.enter_context(ScopedStream(self.stream, sync_enter=False))
        self._recorded = None
        if self.stream is not None and self.stream.is_capturing:
            capture = ScopedCapture(stream=self.stream, external=True)
            self._recorded = self._blocks.enter_context(capture)
        return self

    def __exit__(self, *exception):
        self._blocks.__exit__(*exception)
        if self._recorded is not None and self._recorded.graph is not None:
            _recorded.append(self._recorded.graph)


_turns: dict = {}
_recorded: list = []
