"""Plans: messages that are checked once over all ranks, and exchanged again and again."""

from __future__ import annotations

import threading
import typing
from _blake2 import blake2b
from array import array

import warp as wp
from warp import _native
from warp._src.arrays.hooks import captures
from warp._src.arrays.observers import Observers, Observing
from warp._src.distributed import forward
from warp._src.distributed.communicator import Message
from warp._src.distributed.failures import DistributedError
from warp._src.types.dtypes import type_repr

_ALIGNMENT = 64


def digest(*facts) -> int:
    """64 bits of facts, as a signed number."""
    data = repr(facts).encode()
    return int.from_bytes(blake2b(data, digest_size=8).digest(), "little", signed=True)


def check_plan(comm, name, common, messages=()) -> int:
    """Compares a plan over all ranks; gives its number.

    Args:
        name: of the plan, in messages.
        common: facts that have to be the same on all ranks.
        messages: (peer, bytes given or None, bytes taken or None, tag given, tag taken).

    Raises:
        DistributedError: ranks disagree; all ranks raise it.
    """
    comm.check_use(name)
    comm.user = threading.get_ident()
    try:
        return _checked_plan(comm, name, common + forward.described(), messages)
    finally:
        comm.user = None


def _checked_plan(comm, name, common, messages) -> int:
    number = len(comm.plan_names) + 1
    comm.plan_names[number] = name
    if comm.size == 1:
        return number
    comm.log.begin(number, 0)
    balance = 0
    for peer, give, take, give_tag, take_tag in messages:
        if give is not None:
            balance += digest(comm.rank, peer, give_tag, give)
        if take is not None:
            balance -= digest(peer, comm.rank, take_tag, take)
    same = digest(number, name, common) % (1 << 24)
    balance = (balance + 2**63) % 2**64 - 2**63
    found = comm.check_sum([balance, same, same * same])
    if found[0] == 0 and int(found[2]) * comm.size == int(found[1]) ** 2:
        return number
    all_facts = comm.gather_objects((number, name, common, list(messages)))
    raise DistributedError(_difference(comm, all_facts))


def _difference(comm, facts) -> str:
    """The first difference between what ranks planned."""
    own = facts[comm.rank]
    for rank, (number, name, common, _) in enumerate(facts):
        if (number, name, common) != own[:3]:
            return (
                f"rank {comm.rank}: plan {own[0]} is {_shown(own)}, but plan {number} of rank "
                f"{rank} is {_shown(facts[rank])}: call it alike on all ranks"
            )
    for rank, (_, name, _, messages) in enumerate(facts):
        for peer, give, _, tag, _ in messages:
            wanted = [
                take
                for source, _, take, _, take_tag in facts[peer][3]
                if source == rank and take_tag == tag and take is not None
            ]
            if give is not None and wanted != [give]:
                expects = f"{wanted[0]} bytes" if wanted else "no message"
                return (
                    f"rank {comm.rank}: {name}: rank {rank} sends {give} bytes to rank {peer}, "
                    f"which expects {expects}: give all ranks fields of the same types"
                )
    return f"rank {comm.rank}: {own[1]}: a rank expects a message that no rank sends"


def _shown(facts) -> str:
    return f"{facts[1]} {facts[2]}" if facts[2] else facts[1]


def check_capture(comm, name) -> bool:
    """True if a capture on the communicator's GPU is to hold messages.

    Raises:
        DistributedError: it cannot.
    """
    if comm.size == 1 or not comm.device.is_cuda or not comm.device.is_capturing:
        return False
    if not comm.supports(wp.float32, capture=True):
        raise DistributedError(
            f"rank {comm.rank}: {name} by {comm.engine} in a capture on '{comm.device}': "
            "captures hold messages of NCCL alone, use `wd.nccl(comm)`"
        )
    return True


def run_or_record(comm, name, function) -> None:
    """Calls a function of the host, or records the call in a capture of this thread.

    Raises:
        DistributedError: a capture on a GPU cannot hold it, or forward mode would lose tangents.
    """
    if Observers.executor is not None and comm.size > 1:
        raise DistributedError(
            f"rank {comm.rank}: {name} in forward mode: tangents do not go through solvers, "
            "differentiate the equation that they solve"
        )
    if captures:
        capture = captures.get(threading.get_ident())
        if capture is not None:
            capture.add_host(function, name)
            return
        if check_capture(comm, name):
            for key, capture in captures.items():
                if isinstance(key, tuple):
                    capture.note_other(f"messages of NCCL, '{name}'")
    function()


class Side(typing.NamedTuple):
    """One neighbour of an exchange: parts of arrays that go there and that come from there."""

    peer: int
    give: list
    take: list
    give_tag: int
    take_tag: int


def _size(parts) -> int | None:
    """Bytes of a packed buffer of parts, None for none."""
    total = 0
    for one in parts:
        total = -(-total // _ALIGNMENT) * _ALIGNMENT + one.size * one.item_size
    return total or None


class Buffer:
    """Packed memory of parts of arrays, outside of the pool, and of their gradients."""

    def __init__(self, parts, device):
        size = _size(parts) or 0
        self.bytes = wp.empty(size, dtype=wp.uint8, device=device)
        grads = any(one.requires_grad for one in parts)
        self.grad = wp.zeros(size, dtype=wp.uint8, device=device) if grads else None
        self.parts = []
        offset = 0
        for one in parts:
            offset = -(-offset // _ALIGNMENT) * _ALIGNMENT
            part = self._part(self.bytes, offset, one)
            if one.requires_grad:
                part.grad = self._part(self.grad, offset, one)
            self.parts.append(part)
            offset += one.size * one.item_size

    @staticmethod
    def _part(memory, offset, like):
        strides, step = [], like.item_size
        for extent in reversed(like.shape):
            strides.insert(0, step)
            step *= extent
        return memory._view(offset, like.shape, strides, like.dtype)


class Exchange:
    """Parts of arrays that travel between neighbours, in one message for each.

    Args:
        comm: communicator.
        name: in messages, such as `halo of 'f'`.
        sides: what goes where; parts of the same memory every time.
        dtypes: of the arrays, the same on ranks without neighbours, too.
        is_recorded: a tape records it, so that all ranks have to take part in its adjoint.
        plan: number and step of one that was checked, with sides of these types and sizes.
    """

    def __init__(self, comm, name, sides, dtypes, is_recorded, plan=None):
        self.comm, self.name = comm, name
        self.dtypes, self.is_recorded = dtypes, is_recorded
        self.sides = [
            side
            for side in sides
            if any(one.size for one in side.give) or any(one.size for one in side.take)
        ]
        self.plan = self.check() if plan is None else plan
        self._is_packed = False
        self._packed = self._packed_work = None
        self._direct = None
        self._gradients = None
        self.is_direct = all(
            len(side.give) <= 1
            and len(side.take) <= 1
            and all(one.is_contiguous for one in (*side.give, *side.take))
            for side in self.sides
        )
        self._own = None if self.is_direct else self._own_copies()
        self._has_copied = False

    def _own_copies(self) -> list | None:
        """Pairs of parts of the rank itself, if all sides are, as in a process alone."""
        if any(side.peer != self.comm.rank for side in self.sides):
            return None
        by_tag = {side.take_tag: side.take for side in self.sides}
        return [
            pair
            for side in self.sides
            for pair in zip(by_tag[side.give_tag], side.give, strict=True)
            if pair[0].size
        ]

    def check(self) -> array:
        """Compares the exchange over all ranks; gives its number and step, two words."""
        facts = [
            (side.peer, _size(side.give), _size(side.take), side.give_tag, side.take_tag)
            for side in self.sides
        ]
        kinds = sorted({type_repr(one) for one in self.dtypes})
        common = f"of {', '.join(kinds)}{', on a tape' if self.is_recorded else ''}"
        return array("q", [check_plan(self.comm, self.name, common, facts), 0])

    # Running.

    def run(self) -> None:
        """Sends and receives."""
        self.start()
        self.finish()

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
        comm = self.comm
        if comm.closed:
            comm.check_use(self.name)
        self._has_copied = self._own is not None and not Observers.active
        if self._has_copied:
            # Nothing travels, so nothing is packed.
            self.plan[1] += 1
            for take, give in self._own:
                _native.copy_array(take, give, None)
            return
        self._is_packed = bool(captures) or Observers.active or not self.is_direct
        if self._is_packed:
            if captures:
                check_capture(comm, self.name)
            self._pack()
            run_or_record(comm, self.name, self._start_packed)
        else:
            work = self._direct or self._direct_work()
            self._begin(work)

    def finish(self) -> None:
        """Waits, and unpacks."""
        if self._has_copied:
            return
        if self._is_packed:
            run_or_record(self.comm, self.name, self._packed_work.finish)
            self._record()
            for side, (_, taken) in zip(self.sides, self.packed(), strict=True):
                for view, part in zip(side.take, taken.parts, strict=True):
                    _copy(view, part)
        else:
            self._direct.finish()

    def _begin(self, work) -> None:
        plan = self.plan
        plan[1] += 1
        self.comm.log.begin(plan[0], plan[1])
        work.start()

    def _start_packed(self) -> None:
        self._begin(self._packed_work)

    # Memory.

    def packed(self) -> list:
        """For each side the buffers of what is given and taken."""
        if self._packed is None:
            device = self.comm.device
            self._packed = [
                (Buffer(side.give, device), Buffer(side.take, device)) for side in self.sides
            ]
            pairs = [(given.bytes, taken.bytes) for given, taken in self._packed]
            self._packed_work = self._work(pairs)
        return self._packed

    def _pack(self) -> None:
        for side, (given, _) in zip(self.sides, self.packed(), strict=True):
            for view, part in zip(side.give, given.parts, strict=True):
                _copy(part, view)

    def _direct_work(self):
        if self._direct is None:
            pairs = [
                (side.give[0] if side.give else None, side.take[0] if side.take else None)
                for side in self.sides
            ]
            self._direct = self._work(pairs)
        return self._direct

    def _work(self, pairs, backwards=False) -> Work:
        messages = []
        for side, (give, take) in zip(self.sides, pairs, strict=True):
            give = _memory(give)
            take = _memory(take)
            if backwards:
                # Ghosts go back to their owners.
                back = Message(side.peer, take, give, side.take_tag, side.give_tag)
                messages.append(back)
            else:
                messages.append(Message(side.peer, give, take, side.give_tag, side.take_tag))
        return Work(self.comm, self.name, messages)

    # Derivatives.

    def _record(self) -> None:
        tape = Observers.tape
        if tape is None:
            return
        pairs = self._packed
        arrays = [
            part
            for given, taken in pairs
            for part in (*given.parts, *taken.parts)
            if part.requires_grad
        ]
        if not arrays:
            return
        if self._gradients is None:
            grads = [(given.grad, taken.grad) for given, taken in pairs]
            self._gradients = self._work(grads, backwards=True)
        record(tape, self._reverse, arrays)

    def _reverse(self) -> None:
        """Sends adjoints of ghosts home."""

        def transfer():
            self.comm.log.begin(*self.plan)
            self._gradients.start()
            self._gradients.finish()

        run_or_record(self.comm, f"adjoint of {self.name}", transfer)
        for _, taken in self._packed:
            if taken.grad is not None and taken.grad.size:
                taken.grad.zero_()


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


def _memory(array):
    """The bytes of a contiguous array, None for an empty one."""
    if array is None or not array.size:
        return None
    if array.dtype is wp.uint8 and array.ndim == 1:
        return array
    size = array.size * array.item_size
    return array._view(0, (size,), (1,), wp.uint8)


def _copy(dest, source) -> None:
    if Observers.active:
        wp.copy(dest, source)
    elif dest.size:
        _native.copy_array(dest, source, None)


def record(tape, backward, arrays) -> None:
    """Records an adjoint that tangents have one of their own of."""
    tape.record_func(lambda: forward.values_only(backward), arrays)


def without_tape(function):
    """Calls a function whose work no tape records."""
    with Observing(tape=None):
        return function()
