"""Adjoints of exchanges: those of ghosts go home, are added there, and are zero then.

All of it is prepared once: messages between gradients themselves where they lie in one piece, and
launches for parts of arrays.
"""

from __future__ import annotations

import warp as wp
from warp import _native
from warp._src.arrays import lending
from warp._src.arrays.gradients import has_gradient
from warp._src.arrays.observers import Observers, Observing, Place
from warp._src.arrays.versions import event
from warp._src.distributed.buffers import Buffer
from warp._src.distributed.plans import run_or_record


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
    """The adjoint of an exchange, or a part of it, on a tape.

    Args:
        exchange: whose.
        arrays: parts with gradients that take part.
        written: those of them that the exchange writes.
        method: of `Home` that does it: `run`, or `send` or `add`.
    """

    def __init__(self, exchange, arrays, written, method):
        self._exchange, self._arrays, self._written = exchange, arrays, written
        self._method = method
        self.event = event(exchange.name)

    def arrays(self) -> list:
        return self._arrays

    def written(self) -> list:
        return self._written

    def reverse(self, state) -> None:
        if self._exchange.comm.closed:
            self._exchange.comm.check_use(f"adjoint of {self._exchange.name}")
        if Observers.executor is not None:
            changed = [one.grad for one in self._arrays]
            Observers.executor.access(changed, changed)
        # Tangents have adjoints of their own.
        with Observing(executor=None):
            getattr(self._exchange.home, self._method)()


class Home:
    """The way home of adjoints of ghosts, in messages.

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
        self._work = None
        self._prepare(exchange, ghosts, own)

    def _prepare(self, exchange, ghosts, own) -> None:
        # Kernels are declared when they are used.
        from warp._src.distributed.parts import clearing

        device, sides = self._comm.device, exchange.sides
        if exchange.is_own:
            by_tag = {side.take_tag: parts for side, parts in zip(sides, ghosts, strict=True)}
            come = [by_tag[side.give_tag] for side in sides]
            # Nothing waits in between.
            cleared = [clearing(one) for parts in ghosts for one in parts]
            self._adding = [*_additions(own, come), *cleared]
            return
        arrived = [Buffer(parts, device) for parts in own]
        gone = [self._leaving(parts, device) for parts in ghosts]
        pairs = [(one.bytes, other) for one, other in zip(arrived, gone, strict=True)]
        self._work = exchange.work(pairs, backwards=True)
        self._adding = _additions(own, [one.parts for one in arrived])

    def _leaving(self, parts, device):
        """The memory that is sent of adjoints of ghosts, which are zero then."""
        from warp._src.distributed.parts import clearing, removals

        if len(parts) == 1 and parts[0].is_contiguous:
            self._after.append(clearing(parts[0]))
            return parts[0]
        buffer = Buffer(parts, device)
        for part, one in zip(buffer.parts, parts, strict=True):
            self._before += removals(part, one)
        return buffer.bytes

    def run(self) -> None:
        """Sends adjoints of ghosts, and adds what has come."""
        self.send()
        self.add()

    def send(self) -> None:
        """Sends adjoints of ghosts to the owners, and sets them to zero."""
        self._sent.tell()
        _call(self._before)
        if self._work is not None:
            run_or_record(self._comm, self._name, self._transfer)
        _call(self._after)

    def _transfer(self) -> None:
        self._comm.log.begin(*self._plan)
        self._work.start()
        self._work.finish()

    def add(self) -> None:
        """Adds what has come to the adjoints of the owners."""
        self._added.tell()
        _call(self._adding)


class SharedHome(Home):
    """The way home by shared memory of a plan, and in messages to ranks of other hosts."""

    def _prepare(self, exchange, ghosts, own) -> None:
        from warp._src.distributed.parts import copying, removals

        comm, shared = self._comm, exchange.plan.shared
        self._shared = shared
        # For each half: what moves adjoints there, and what came.
        self._moving: tuple = ([], [])
        come: tuple = ([], [])
        kept, pairs = [], []
        for side, sent, added in zip(exchange.sides, ghosts, own, strict=True):
            arrived = Buffer(added, comm.device)
            kept.append(arrived.parts)
            if side.peer not in shared.ranks:
                pairs.append((arrived.bytes, self._leaving(sent, comm.device)))
                for found in come:
                    found.append(arrived.parts)
                continue
            for half in (0, 1):
                if sent:
                    there = shared.buffer(half, comm.rank, side.peer, side.take_tag, sent)
                    for part, one in zip(there.parts, sent, strict=True):
                        self._moving[half].extend(removals(part, one))
                here = []
                if added:
                    here = shared.buffer(half, side.peer, comm.rank, side.give_tag, added).parts
                come[half].append(here)
            is_other = side.peer != comm.rank
            pairs.append(tuple(wp.empty(int(is_other), dtype=wp.uint8) for _ in range(2)))
        self._work = exchange.work(pairs, backwards=True)
        self._adding_from = [_additions(own, parts) for parts in come]
        self._adding = _additions(own, kept)
        self._keeping = [
            [
                copying(to, part)
                for parts, all_to in zip(found, kept, strict=True)
                for part, to in zip(parts, all_to, strict=True)
                if part is not to
            ]
            for found in come
        ]

    def run(self) -> None:
        self._sent.tell()
        self._added.tell()
        run_or_record(self._comm, self._name, self._run)

    def send(self) -> None:
        self._sent.tell()
        # Other exchanges of the plan may come before these are added.
        run_or_record(self._comm, self._name, lambda: _call(self._keeping[self._move()]))

    def _run(self) -> None:
        _call(self._adding_from[self._move()])

    def _move(self) -> int:
        """Moves adjoints to a half of the memory, tells all ranks, and gives the half."""
        half = self._shared.turn()
        _call(self._before)
        _call(self._moving[half])
        self._transfer()
        _call(self._after)
        return half


def _additions(own, come) -> list:
    """Functions that add what came, in the order in which launches that pack run backwards."""
    from warp._src.distributed.parts import additions

    return [
        function
        for parts, others in zip(reversed(own), reversed(come), strict=True)
        for one, other in zip(reversed(parts), reversed(others), strict=True)
        for function in additions(one, other)
    ]


def _call(functions) -> None:
    for function in functions:
        function()
