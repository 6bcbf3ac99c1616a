"""Adjoints of exchanges: those of ghosts go home, are added there, and are zero then.

All of it is prepared once: messages between gradients themselves where they lie in one piece, and
launches that add parts of arrays, or take them away.
"""

from __future__ import annotations

import functools
from typing import Any

import warp as wp
from warp import _native
from warp._src.arrays import lending
from warp._src.arrays.casts import cast
from warp._src.arrays.gradients import has_gradient
from warp._src.arrays.observers import Observers, Observing, Place
from warp._src.arrays.versions import event
from warp._src.derivatives import cotangents
from warp._src.distributed.buffers import Buffer
from warp._src.distributed.plans import run_or_record
from warp._src.types import dtypes


@wp.kernel(module="warp.distributed", enable_backward=False)
def _add1(a: wp.array(dtype=Any), b: wp.array(dtype=Any)):
    i = wp.tid()
    a[i] = a[i] + b[i]


@wp.kernel(module="warp.distributed", enable_backward=False)
def _add2(a: wp.array2d(dtype=Any), b: wp.array2d(dtype=Any)):
    i, j = wp.tid()
    a[i, j] = a[i, j] + b[i, j]


@wp.kernel(module="warp.distributed", enable_backward=False)
def _add3(a: wp.array3d(dtype=Any), b: wp.array3d(dtype=Any)):
    i, j, k = wp.tid()
    a[i, j, k] = a[i, j, k] + b[i, j, k]


@wp.kernel(module="warp.distributed", enable_backward=False)
def _take1(a: wp.array(dtype=Any), b: wp.array(dtype=Any)):
    i = wp.tid()
    a[i] = b[i]
    b[i] = b.dtype(0.0)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _take2(a: wp.array2d(dtype=Any), b: wp.array2d(dtype=Any)):
    i, j = wp.tid()
    a[i, j] = b[i, j]
    b[i, j] = b.dtype(0.0)


@wp.kernel(module="warp.distributed", enable_backward=False)
def _take3(a: wp.array3d(dtype=Any), b: wp.array3d(dtype=Any)):
    i, j, k = wp.tid()
    a[i, j, k] = b[i, j, k]
    b[i, j, k] = b.dtype(0.0)


_ADD, _TAKE = (_add1, _add2, _add3), (_take1, _take2, _take3)


def _as_numbers(a, b):
    """Two arrays of a shape as numbers, in as few axes as their strides allow."""
    inner = a.item_size // dtypes.type_size_in_bytes(scalar := dtypes.type_scalar_type(a.dtype))
    step = a.item_size // inner
    axes = [(inner, step, step)]
    for n, s, t in zip(*(reversed(one) for one in (a.shape, a.strides, b.strides)), strict=True):
        m, u, v = axes[-1]
        if n == 1:
            continue
        if m == 1:
            axes[-1] = n, s, t
        elif (s, t) == (m * u, m * v):
            axes[-1] = m * n, u, v
        else:
            axes.append((n, s, t))
    shape, *strides = zip(*reversed(axes), strict=True)
    return [one._view(0, shape, each, scalar) for one, each in zip((a, b), strides, strict=True)]


def _launches(kernels, a, b):
    if a.ndim > len(kernels):
        for i in range(a.shape[0]):
            yield from _launches(kernels, a[i], b[i])
        return
    made = wp.launch(kernels[a.ndim - 1], a.shape, [a, b], device=a.device, record_cmd=True)
    # Writes are told of by `Home.run`, once for all.
    yield functools.partial(_native.PackedLaunch.launch, made, None)


def _is_plain(a, b) -> bool:
    return a.dtype is b.dtype and not dtypes.is_struct(a.dtype)


def additions(target, source) -> list:
    """Functions that add the elements of an array to those of another one of its shape."""
    if not target.size:
        return []
    if _is_plain(target, source):
        return [*_launches(_ADD, *_as_numbers(target, source))]
    return [functools.partial(cotangents.add_into, target, source)]


def _removals(target, source) -> list:
    """Functions that copy an array to another one and set it to zero."""
    if not source.size:
        return []
    if _is_plain(target, source):
        return [*_launches(_TAKE, *_as_numbers(target, source))]
    return [copying(target, source), _clearing(source)]


def copying(target, source):
    """A function that copies an array, whose elements may be those of a wider gradient."""
    if target.item_size != source.item_size:
        return functools.partial(cast, source, target)
    return functools.partial(_native.copy_array, target, source, None)


def _clearing(one):
    return functools.partial(_native.fill_array, one, bytes(one.item_size))


def active(parts) -> list:
    """The parts of arrays that have gradients, and elements."""
    return [one for one in parts if one.requires_grad and one.size and has_gradient(one.dtype)]


class Writes:
    """Memory that is written without an operation that tells observers.

    Args:
        arrays: the memory.
        name: of what writes, in messages.
    """

    def __init__(self, arrays, name):
        self.arrays, self._name, self._regions = arrays, name, None

    def tell(self) -> None:
        """Called before it is written while somebody observes."""
        if lending.lent:
            lending.settle()
        memory = Observers.memory
        if not len(memory):
            return
        if self._regions is None:
            self._regions = [_native.Region(one) for one in self.arrays if one.size]
        memory.end(self._regions, Place(self._name))


class HomeRecord:
    """A part of the adjoint of an exchange, on a tape.

    Args:
        exchange: whose.
        arrays: parts with gradients that take part.
        function: `Home.send` or `Home.add`.
    """

    def __init__(self, exchange, arrays, function):
        self._exchange, self._arrays, self._function = exchange, arrays, function
        self.event = event(exchange.name)

    def arrays(self) -> list:
        return self._arrays

    def written(self) -> list:
        return self._arrays if self._function is Home.send else []

    def reverse(self, state) -> None:
        if self._exchange.comm.closed:
            self._exchange.comm.check_use(f"adjoint of {self._exchange.name}")
        if Observers.executor is not None:
            changed = [one.grad for one in self._arrays]
            Observers.executor.access(changed, changed)
        # Tangents have adjoints of their own.
        with Observing(executor=None):
            self._function(self._exchange.home)


class Home:
    """The way home of adjoints of ghosts.

    Args:
        exchange: whose; gives parts of arrays, and messages.
    """

    def __init__(self, exchange):
        comm, sides = exchange.comm, exchange.sides
        self._comm, self._name, self._plan = comm, f"adjoint of {exchange.name}", exchange.plan
        ghosts = [[one.grad for one in active(side.take)] for side in sides]
        own = [[one.grad for one in active(side.give)] for side in sides]
        self._sent, self._added = (
            Writes([one for parts in found for one in parts], self._name) for found in (ghosts, own)
        )
        self._before: list = []
        self._after: list = []
        self._adding: list = []
        self._work = None
        if exchange.is_own:
            by_tag = {side.take_tag: parts for side, parts in zip(sides, ghosts, strict=True)}
            come = [by_tag[side.give_tag] for side in sides]
            self._after = [_clearing(one) for parts in ghosts for one in parts]
        else:
            arrived = [Buffer(parts, comm.device) for parts in own]
            come = [one.parts for one in arrived]
            gone = [self._leaving(parts, comm.device) for parts in ghosts]
            pairs = [(one.bytes, other) for one, other in zip(arrived, gone, strict=True)]
            self._work = exchange.work(pairs, backwards=True)
        # In the order in which launches that pack would be run backwards.
        for parts, others in zip(reversed(own), reversed(come), strict=True):
            for one, other in zip(reversed(parts), reversed(others), strict=True):
                self._adding += additions(one, other)
        if exchange.is_own:
            # Nothing waits in between.
            self._adding += self._after
            self._after = []

    def _leaving(self, parts, device):
        """The memory that is sent of adjoints of ghosts, which are zero then."""
        if len(parts) == 1 and parts[0].is_contiguous:
            self._after.append(_clearing(parts[0]))
            return parts[0]
        buffer = Buffer(parts, device)
        for part, one in zip(buffer.parts, parts, strict=True):
            self._before += _removals(part, one)
        return buffer.bytes

    def send(self) -> None:
        """Sends adjoints of ghosts to the owners, and sets them to zero."""
        self._sent.tell()
        for function in self._before:
            function()
        if self._work is not None:
            run_or_record(self._comm, self._name, self._transfer)
        for function in self._after:
            function()

    def _transfer(self):
        self._comm.log.begin(*self._plan)
        self._work.start()
        self._work.finish()

    def add(self) -> None:
        """Adds what has come to the adjoints of the owners."""
        self._added.tell()
        for function in self._adding:
            function()
