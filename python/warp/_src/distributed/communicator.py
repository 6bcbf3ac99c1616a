"""Communicators: the interface of engines, and a process alone."""

from __future__ import annotations

import functools
import os
import pickle
import threading
import typing
import weakref

import numpy as np

import warp as wp
from warp._src import errors
from warp._src.distributed.failures import DistributedError, RankLog
from warp._src.types import dtypes

OPERATIONS = ("sum", "min", "max")
alive: weakref.WeakSet = weakref.WeakSet()


def _leave_to_parent() -> None:
    """In a fork: messages are those of the parent."""
    for one in alive:
        one._end_use()


os.register_at_fork(after_in_child=_leave_to_parent)


def flat(array, scalar=None):
    """A contiguous array as one of scalars, or of bytes."""
    scalar = scalar or getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    if dtypes.is_struct(scalar):
        scalar = wp.uint8
    size = dtypes.type_size_in_bytes(scalar)
    count = array.size * array.item_size // size
    return array._view(0, (count,), (size,), scalar)


class Message(typing.NamedTuple):
    """A message to a rank and one from it; either may be absent.

    Attributes:
        peer: the other rank.
        give, take: contiguous arrays of bytes or scalars, or None.
        give_tag, take_tag: numbers that tell messages between two ranks apart.
    """

    peer: int
    give: typing.Any
    take: typing.Any
    give_tag: int
    take_tag: int


# Methods that are errors once a communicator is closed, or in a fork.
_OF_ENGINES = (
    *("exchange", "all_reduce", "reduce_scatter", "all_gather", "broadcast", "all_to_all"),
    *("barrier", "split", "persistent", "gather_objects", "broadcast_object", "check_sum"),
)


class _EndedLog:
    """The log of a communicator that is closed; beginning anything is an error."""

    def __init__(self, comm):
        self.comm, self.former = comm, comm.log

    def __getattr__(self, name):
        return getattr(self.former, name)

    def begin(self, plan, step) -> None:
        """Raises the error of a use."""
        self.comm.check_use(self.comm.plan_names.get(plan, "an exchange"))


class Communicator:
    """Ranks that work together, over an engine.

    Made by `wd.init`, or by `wd.mpi`, `wd.torch` and `wd.nccl` of what an engine has. Arrays that
    its methods take are contiguous, of scalars, on `device`; the functions of `warp.distributed`
    take any. Another engine implements `exchange`, `all_reduce`, `barrier` and `abort`, and as many
    of the others as it has.

    Attributes:
        rank, size: number of this rank, and how many there are.
        local_rank, local_size: the same among ranks of this host.
        device: where this rank computes.
        stream: CUDA stream of transfers, or None.
        timeout: seconds after which a rank that does not answer is an error.
    """

    engine = "none"
    stream = None
    # True if adjoints go through memory that ranks of a host share, see `shared_memory`.
    shares_memory = False

    def __init__(self, rank, size, local_rank=0, local_size=1, device=None, timeout=300.0):
        self.rank, self.size = rank, size
        self.local_rank, self.local_size = local_rank, local_size
        self.device = wp.get_device(device)
        self.timeout = float(timeout)
        self.closed = False
        self.process = os.getpid()
        self.plan_names: dict[int, str] = {}
        # Names of graphs that hold messages, by negative numbers.
        self.graph_names: dict[int, str] = {}
        self.plans: dict = {}
        self.log = RankLog(size, rank)
        alive.add(self)
        # The thread that makes a plan.
        self.user = None

    def __repr__(self):
        return f"<rank {self.rank} of {self.size} by {self.engine} on '{self.device}'>"

    def __reduce__(self):
        raise TypeError("cannot pickle a communicator: make one in each process by `wd.init`")

    # Engines.

    def exchange(self, messages) -> None:
        """Sends and receives messages at once."""
        for one in messages:
            raise DistributedError(f"rank 0 of 1: no rank {one.peer} to exchange with")

    def all_reduce(self, array, op="sum") -> None:
        """Combines arrays of all ranks, in place."""

    def reduce_scatter(self, out, array, counts) -> None:
        """Sums arrays of all ranks; each gets as many elements as `counts` says for it."""
        total = wp.clone(array)
        self.all_reduce(total)
        first = sum(counts[: self.rank])
        wp.copy(out, total, 0, first, counts[self.rank])

    def all_gather(self, out, array, counts) -> None:
        """Puts arrays of all ranks one behind the other; `counts` are their elements."""
        offsets = np.concatenate([[0], np.cumsum(counts)])
        messages = []
        for peer in range(self.size):
            part = out[int(offsets[peer]) : int(offsets[peer + 1])] if counts[peer] else None
            if peer == self.rank:
                if part is not None:
                    wp.copy(part, array)
            else:
                give = array if array.size else None
                messages.append(Message(peer, give, part, self.rank, peer))
        self.exchange(messages)

    def broadcast(self, array, root=0) -> None:
        """Copies the array of a rank to all."""
        if self.rank == root:
            peers = [peer for peer in range(self.size) if peer != root]
            self.exchange([Message(peer, array, None, 0, 0) for peer in peers])
        else:
            self.exchange([Message(root, None, array, 0, 0)])

    def all_to_all(self, out, array, out_counts, counts) -> None:
        """Sends the first `counts[0]` elements to rank 0, the next to rank 1, and so on."""
        messages, given, taken = [], 0, 0
        for peer in range(self.size):
            give = array[given : given + counts[peer]] if counts[peer] else None
            take = out[taken : taken + out_counts[peer]] if out_counts[peer] else None
            given, taken = given + counts[peer], taken + out_counts[peer]
            if peer != self.rank:
                messages.append(Message(peer, give, take, self.rank, peer))
            elif give is not None:
                wp.copy(take, give)
        self.exchange(messages)

    def barrier(self) -> None:
        """Waits for all ranks."""

    def split(self, color, key=0) -> Communicator:
        """A communicator of the ranks that give the same color, in the order of their keys."""
        return Communicator(0, 1, device=self.device, timeout=self.timeout)

    def abort(self, code=1) -> None:
        """Ends all ranks."""
        os._exit(code)

    def supports(self, dtype, op="sum", device=None, capture=False) -> bool:
        """True if the engine reduces a type on a device, perhaps while a graph is captured."""
        return True

    def close(self) -> None:
        """Ends the use of the communicator; its plans are of no use any more."""
        self._end_use()
        self.plans.clear()

    def _end_use(self) -> None:
        """Makes all uses from now on errors; until then nothing is checked."""
        if self.closed:
            return
        self.closed = True
        for name in _OF_ENGINES:
            setattr(self, name, functools.partial(self._refuse, name))
        self.log = _EndedLog(self)

    def _refuse(self, name, *_, **__):
        self.check_use(name)

    # Engines may do better.

    def persistent(self, messages):
        """Messages between the same arrays, to be exchanged again and again."""
        return Repeated(self, messages)

    def gather_objects(self, value) -> list:
        """A Python object of each rank, on all ranks."""
        if self.size == 1:
            return [value]
        data = np.frombuffer(pickle.dumps(value), np.uint8)
        sizes = np.zeros(self.size, np.int64)
        sizes[self.rank] = len(data)
        lengths = wp.array(sizes, dtype=wp.int64, device="cpu").to(self.device)
        self.all_reduce(lengths)
        counts = lengths.numpy().tolist()
        out = wp.zeros(sum(counts), dtype=wp.uint8, device=self.device)
        self.all_gather(out, wp.array(data, dtype=wp.uint8, device=self.device), counts)
        parts = np.split(out.numpy(), np.cumsum(counts)[:-1])
        return [pickle.loads(part.tobytes()) for part in parts]

    def broadcast_object(self, value, root=0):
        """A Python object of one rank, on all ranks."""
        return self.gather_objects(value if self.rank == root else None)[root]

    # Checks.

    def check_sum(self, numbers) -> np.ndarray:
        """Sums of a few integers over all ranks."""
        if self.size == 1:
            return np.array(numbers, np.int64)
        words = wp.array(np.array(numbers, np.int64), dtype=wp.int64, device=self.device)
        self.all_reduce(words)
        return words.numpy()

    def check_use(self, what) -> None:
        """Rejects a use after `close`, in a fork, or by two threads at once.

        Raises:
            DistributedError: one of these.
        """
        if os.getpid() != self.process:
            raise DistributedError(
                f"rank {self.rank}: {what} in process {os.getpid()}, a fork, but the communicator "
                f"is of process {self.process}: call `wd.init` in each process"
            )
        if self.closed:
            raise DistributedError(
                f"rank {self.rank}: {what} after its communicator was closed: make a new one"
            )
        thread = threading.get_ident()
        user = self.user
        if user not in (None, thread):
            raise DistributedError(
                f"rank {self.rank}: {what} by thread {thread} while thread {user} uses the "
                "communicator: give each thread its own, `comm.split(0)`"
            )


class Repeated:
    """Messages that an engine has no persistent form of."""

    def __init__(self, comm, messages):
        self.comm, self.messages = comm, messages

    def start(self) -> None:
        """Begins to send and receive."""

    def finish(self) -> None:
        """Waits until all is sent and received."""
        self.comm.exchange(self.messages)

    def quick(self, plan) -> None:
        """No function does all of an exchange."""

    def free(self) -> None:
        """Nothing is held."""


# The communicator of functions that are given none.
_current: list = []


def current() -> Communicator:
    """The communicator that `init` made, or a process alone."""
    if not _current:
        _current.append(Communicator(0, 1))
    return _current[-1]


def resolve(comm) -> Communicator:
    """A communicator that a function was given, or the current one.

    Raises:
        TypeError: it is none.
    """
    if comm is None:
        return current()
    if not isinstance(comm, Communicator):
        raise errors.WarpTypeError(
            f"expects a communicator, but got '{type(comm).__name__}': make one by `wd.mpi(comm)` "
            "or `wd.torch(group)`"
        )
    return comm


def set_current(comm) -> None:
    """Makes a communicator the one of functions that are given none."""
    _current[:] = [comm]
