"""Exchanges: parts of arrays that travel between neighbours, again and again."""

from __future__ import annotations

import functools
import typing
from array import array

from warp import _native
from warp._src.arrays.gradients import has_wide_gradient
from warp._src.arrays.hooks import captures
from warp._src.arrays.observers import Observers
from warp._src.distributed.adjoints import Home, HomeRecord, SharedHome, Writes, active
from warp._src.distributed.buffers import Buffer, memory_of, size_of
from warp._src.distributed.communicator import Message
from warp._src.distributed.plans import check_capture, check_plan, run_or_record
from warp._src.distributed.shared_memory import share_memory
from warp._src.types.dtypes import type_repr


class Side(typing.NamedTuple):
    """One neighbour of an exchange: parts of arrays that go there and that come from there."""

    peer: int
    give: list
    take: list
    give_tag: int
    take_tag: int


def described_gradients(fields) -> str:
    """Gradients that a tape is going to record of an exchange, for comparison and messages."""
    if Observers.tape is None:
        return ""
    found = [number for number, one in enumerate(fields) if one.requires_grad]
    if not found:
        return ""
    text = ", on a tape"
    if len(found) < len(fields):
        text += f" with gradients of fields {', '.join(map(str, found))}"
    wide = [number for number in found if has_wide_gradient(fields[number])]
    return text + (f" with gradients of 32 bits of fields {wide}" if wide else "")


def gradient_places(fields) -> tuple:
    """The memory of gradients of fields."""
    return tuple(one.requires_grad and one.grad_ptr for one in fields)


class Plan(array):
    """Number and step of a plan that was compared over all ranks, two words.

    Attributes:
        shared: memory of the host that its adjoints go through, or None.
    """

    shared = None


class Exchange:
    """Parts of arrays that travel between neighbours, in one message for each.

    Args:
        comm: communicator.
        name: in messages, such as `halo of 'f'`.
        sides: what goes where; parts of the same memory every time.
        dtypes: of the arrays, the same on ranks without neighbours, too.
        gradients: what a tape records of it, for comparison and messages; empty for nothing.
        plan: one that was checked, with sides of these types and sizes.

    Attributes:
        is_own: all that is sent comes from the rank itself, as in a process alone.
        gradient_places: of the fields.
    """

    gradient_places: tuple = ()

    def __init__(self, comm, name, sides, dtypes, gradients="", plan=None):
        self.comm, self.name = comm, name
        self.dtypes, self.gradients = dtypes, gradients
        self.sides = [
            side
            for side in sides
            if any(one.size for one in side.give) or any(one.size for one in side.take)
        ]
        self.plan = self.check() if plan is None else plan
        self.is_own = all(side.peer == comm.rank for side in self.sides)
        self._own = self._own_copies() if self.is_own else None
        self._packed = self._packed_work = self._direct = None
        self.is_direct = not self.is_own and all(
            len(side.give) <= 1
            and len(side.take) <= 1
            and all(one.is_contiguous for one in (*side.give, *side.take))
            for side in self.sides
        )
        taken = [one for side in self.sides for one in side.take]
        given = [one for side in self.sides for one in side.give]
        self._written = Writes(taken, name)
        # Parts with gradients take part in the adjoint.
        self.taken, self.given = active(taken), active(given)
        self._home = None

    def suits(self, fields) -> bool:
        """True if a tape can record the exchange of fields."""
        places = gradient_places(fields)
        return places == self.gradient_places and bool(self.gradients) == any(
            one is not False for one in places
        )

    def _own_copies(self) -> list:
        """Pairs of parts of the rank itself."""
        by_tag = {side.take_tag: side.take for side in self.sides}
        return [
            pair
            for side in self.sides
            for pair in zip(by_tag[side.give_tag], side.give, strict=True)
            if pair[0].size
        ]

    def check(self) -> Plan:
        """Compares the exchange over all ranks."""
        facts = [
            (side.peer, size_of(side.give), size_of(side.take), side.give_tag, side.take_tag)
            for side in self.sides
        ]
        kinds = sorted({type_repr(one) for one in self.dtypes})
        common = f"of {', '.join(kinds)}{self.gradients}"
        plan = Plan("q", [check_plan(self.comm, self.name, common, facts), 0])
        if self.gradients:
            sent = ((side.peer, side.take_tag, active(side.take)) for side in self.sides)
            sizes = {(peer, tag): size_of([x.grad for x in parts]) for peer, tag, parts in sent}
            plan.shared = share_memory(self.comm, {k: v for k, v in sizes.items() if v})
        return plan

    # Running.

    def run(self) -> None:
        """Sends and receives."""
        self._start()
        self._finish()
        if Observers.tape is not None and (self.taken or self.given):
            self._record([*self.given, *self.taken], self.taken, "run")

    def quick(self):
        """A function that does what `run` does where nobody observes or captures, or None.

        It gives what `settle` takes if that is not 0.
        """
        return self._direct_work().quick(self.plan) if self.is_direct else None

    def settle(self, found) -> None:
        """Goes on from what the function of `quick` gave."""
        self._direct.settle(found)

    def start(self) -> None:
        """Packs and begins to send."""
        if Observers.tape is not None and self.given:
            self._record(self.given, [], "add")
        self._start()

    def _start(self) -> None:
        comm = self.comm
        if comm.closed:
            comm.check_use(self.name)
        if self.is_own:
            # Nothing travels, so nothing is packed.
            self._tell()
            self.plan[1] += 1
            for take, give in self._own:
                _native.copy_array(take, give, None)
            return
        if captures:
            check_capture(comm, self.name)
        if self.is_direct:
            # From now on messages are written.
            self._tell()
            work = self._direct or self._direct_work()
        else:
            self._pack()
            work = self._packed_work
        if captures:
            run_or_record(comm, self.name, functools.partial(self._begin, work))
        else:
            self._begin(work)

    def finish(self) -> None:
        """Waits, and unpacks."""
        self._finish()
        if Observers.tape is not None and (self.taken or self.given):
            self._record(self.taken, self.taken, "send")

    def _finish(self) -> None:
        if not self.is_own:
            work = self._direct if self.is_direct else self._packed_work
            if captures:
                run_or_record(self.comm, self.name, work.finish)
            else:
                work.finish()
        if not (self.is_own or self.is_direct):
            self._tell()
            for side, (_, taken) in zip(self.sides, self._packed, strict=True):
                for view, part in zip(side.take, taken.parts, strict=True):
                    _copy(view, part)

    def _tell(self) -> None:
        if Observers.active:
            self._written.tell()

    def _begin(self, work) -> None:
        plan = self.plan
        plan[1] += 1
        self.comm.log.begin(plan[0], plan[1])
        work.start()

    # Memory.

    def _pack(self) -> None:
        if self._packed is None:
            device = self.comm.device
            self._packed = [
                (Buffer(side.give, device), Buffer(side.take, device)) for side in self.sides
            ]
            pairs = [(given.bytes, taken.bytes) for given, taken in self._packed]
            self._packed_work = self.work(pairs)
        for side, (given, _) in zip(self.sides, self._packed, strict=True):
            for view, part in zip(side.give, given.parts, strict=True):
                _copy(part, view)

    def _direct_work(self):
        if self._direct is None:
            pairs = [
                (side.give[0] if side.give else None, side.take[0] if side.take else None)
                for side in self.sides
            ]
            self._direct = self.work(pairs)
        return self._direct

    def work(self, pairs, backwards=False) -> Work:
        """Messages of memory that is given and taken, for each side.

        Args:
            backwards: what is taken goes back to where it is given.
        """
        messages = []
        for side, (give, take) in zip(self.sides, pairs, strict=True):
            give, take = memory_of(give), memory_of(take)
            if backwards:
                back = Message(side.peer, take, give, side.take_tag, side.give_tag)
                messages.append(back)
            else:
                messages.append(Message(side.peer, give, take, side.give_tag, side.take_tag))
        name = f"adjoint of {self.name}" if backwards else self.name
        return Work(self.comm, name, messages)

    # Derivatives.

    @property
    def home(self) -> Home:
        """The way home of adjoints of ghosts."""
        if self._home is None:
            is_shared = self.plan.shared is not None and not self.is_own
            self._home = SharedHome(self) if is_shared else Home(self)
        return self._home

    def _record(self, arrays, written, method) -> None:
        Observers.tape._add(HomeRecord(self, arrays, written, method))


class Work:
    """Messages to other ranks and to the rank itself."""

    def __init__(self, comm, name, messages):
        self.comm = comm
        own = [one for one in messages if one.peer == comm.rank]
        by_tag = {one.take_tag: one.take for one in own if one.take is not None}
        self.local = [(by_tag[one.give_tag], one.give) for one in own if one.give is not None]
        others = [one for one in messages if one.peer != comm.rank]
        self.engine = comm.persistent(others) if others else None
        if self.engine is not None:
            self.engine.what = name
            if not self.local:
                self.start, self.finish = self.engine.start, self.engine.finish

    def start(self) -> None:
        """Begins to send and receive."""
        if self.engine is not None:
            self.engine.start()
        if self.local:
            for take, give in self.local:
                _native.copy_array(take, give, None)

    def finish(self) -> None:
        """Waits until all is sent and received."""
        if self.engine is not None:
            self.engine.finish()

    def quick(self, plan):
        """See `Exchange.quick`; None where messages go to the rank itself."""
        return None if self.engine is None or self.local else self.engine.quick(plan)

    def settle(self, found) -> None:
        """Goes on from what the function of `quick` gave."""
        self.engine.settle(found)


def _copy(dest, source) -> None:
    if dest.size:
        _native.copy_array(dest, source, None)
