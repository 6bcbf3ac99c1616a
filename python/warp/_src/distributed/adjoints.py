"""Adjoints of exchanges: those of ghosts go home, are added there, and are zero then.

All of it is prepared once: messages between gradients themselves where they lie in one piece, and
launches for parts of arrays.
"""

from __future__ import annotations

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
        # Kernels are declared when they are used.
        from warp._src.distributed.parts import additions, clearing

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
            self._after = [clearing(one) for parts in ghosts for one in parts]
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
        from warp._src.distributed.parts import clearing, removals

        if len(parts) == 1 and parts[0].is_contiguous:
            self._after.append(clearing(parts[0]))
            return parts[0]
        buffer = Buffer(parts, device)
        for part, one in zip(buffer.parts, parts, strict=True):
            self._before += removals(part, one)
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
