"""Failures of ranks: errors that name plan, step and rank, time limits, exit of all ranks."""

from __future__ import annotations

import atexit
import contextlib
import mmap
import os
import sys
import tempfile
import time

from warp._src import errors


class DistributedError(errors.WarpError):
    """Ranks disagree, or one of them is gone or does not answer."""


class DistributedValueError(DistributedError, ValueError):
    """An argument has a value that an operation over ranks does not take."""


# Seconds between two looks at the ranks that are waited for.
_LOOK = 0.5
# Words of a rank in the log: process, plan, step, stop.
_WORDS = 4
_PROCESS, PLAN, _STEP, _STOP = range(_WORDS)


def memory_of_host(comm, size):
    """Zeros that the ranks of a host share, or None on all ranks if one of them has no room."""
    folder = "/dev/shm" if os.path.isdir("/dev/shm") else tempfile.gettempdir()
    token = comm.broadcast_object(os.urandom(8).hex(), 0)
    path = os.path.join(folder, f"warp-ranks-{os.getuid()}-{token}")
    memory = None
    flags = os.O_RDWR | os.O_CREAT
    with contextlib.suppress(OSError), open(os.open(path, flags, 0o600), "r+b") as file:
        # Memory that is not there would end a process when it is written.
        os.posix_fallocate(file.fileno(), 0, size)
        memory = mmap.mmap(file.fileno(), size)
    lacking = comm.check_sum([memory is None])[0]
    with contextlib.suppress(OSError):
        os.unlink(path)
    return None if lacking else memory


class RankLog:
    """The last work that each rank of a host began, in memory that they share.

    Attributes:
        own: words of this rank.
    """

    def __init__(self, size, rank, memory=None):
        self.size, self.rank = size, rank
        memory = memory or mmap.mmap(-1, size * _WORDS * 8)
        self.words = memoryview(memory).cast("q")
        self.own = self.words[rank * _WORDS : (rank + 1) * _WORDS]
        self.own[_PROCESS] = os.getpid()

    @classmethod
    def shared(cls, comm) -> RankLog:
        """A log in memory of the host; each rank sees those of its own host."""
        log = cls(comm.size, comm.rank, memory_of_host(comm, comm.size * _WORDS * 8))
        # No rank looks before all have said who they are.
        comm.barrier()
        atexit.register(log.leave, os.getpid())
        return log

    def leave(self, process) -> None:
        """Notes that this rank has come to its end, if this is no fork of it."""
        if process == os.getpid():
            self.own[_PROCESS] = -process

    def begin(self, plan, step) -> None:
        """Notes that this rank begins a step of a plan."""
        own = self.own
        own[PLAN] = plan
        own[_STEP] = step

    def last(self, rank) -> tuple[int, int, int]:
        """Process, plan and step of a rank; zeros if it is of another host.

        The process is negative once the rank has come to its end.
        """
        return tuple(self.words[rank * _WORDS : rank * _WORDS + 3])

    def request_stop(self, step) -> None:
        """Asks all ranks of the host to stop before a step."""
        self.own[_STOP] = step

    def stop_step(self) -> int:
        """The last step that a rank of the host asks all to stop before, 0 for none."""
        return max(self.words[_STOP::_WORDS])

    def clear_stop(self) -> None:
        """Takes the request of this rank back."""
        self.own[_STOP] = 0


def is_alive(process) -> bool:
    """True if a process of this host exists."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    try:
        with open(f"/proc/{process}/stat") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return True


def describe_ranks(comm, plan, step) -> str:
    """The ranks that are gone or behind, and what they began last."""
    parts = []
    for rank in range(comm.size):
        if rank == comm.rank:
            continue
        process, number, count = comm.log.last(rank)
        if not process:
            parts.append(f"rank {rank} is on another host")
        elif process < 0:
            parts.append(f"rank {rank} has come to its end")
        elif not is_alive(process):
            parts.append(f"rank {rank} is gone")
        elif (number, count) != (plan, step):
            parts.append(f"rank {rank} last began {describe_work(comm, number, count)}")
    return ", ".join(parts) or "all ranks are there"


def describe_work(comm, number, step, name=None) -> str:
    """A step of a plan, or a replay of a graph that holds messages.

    Args:
        number: of a plan, or of a graph if it is negative; 0 for none.
        name: of a plan that has no name, or of work without a plan.
    """
    if number < 0:
        names = comm.graph_names.get(number, "messages that this rank has not captured")
        return f"replay {step} of graph {-number} with {names}"
    if not number and name is None:
        return "nothing"
    name = comm.plan_names.get(number, name or "a plan that this rank has not made")
    return f"{name} (plan {number}, step {step})"


def failed(comm, name, plan, step, problem) -> DistributedError:
    """The error of an exchange that did not end."""
    # A process that dies takes a moment to be gone.
    deadline = time.monotonic() + 0.5
    while "is gone" not in (text := describe_ranks(comm, plan, step)):
        if time.monotonic() > deadline:
            break
        time.sleep(0.05)
    if "is gone" in text:
        fix = "look at what it said last"
    elif "its end" in text:
        fix = "make as many calls on all ranks"
    else:
        fix = "make the same calls on all ranks in the same order, or raise `timeout`"
    return DistributedError(
        f"rank {comm.rank}: {name} (plan {plan}, step {step}): {problem}; {text}: {fix}"
    )


class Deadline:
    """The back-off of a wait, with a limit."""

    __slots__ = ("_end", "_looks", "_next", "_now", "_pause", "_turns", "limit")

    def __init__(self, limit, spins=0):
        self.limit = limit
        self._turns = -spins
        self._end = None
        self._pause = 2e-5
        self._now, self._next, self._looks = 0.0, None, 0

    def wait(self) -> bool:
        """Waits a little; False once the limit has passed."""
        self._turns += 1
        if self._turns < 0:
            return True
        if self._turns < 200:
            os.sched_yield()
            return True
        self._now = now = time.monotonic()
        if self._end is None:
            self._end = now + self.limit
            self._next = now + _LOOK
        time.sleep(self._pause)
        self._pause = min(self._pause * 1.2, 2e-3)
        return now < self._end

    def is_vain(self, comm, peers=None) -> bool:
        """True if a rank of the host that is waited for has been gone for a while.

        Args:
            peers: ranks whose messages are waited for, by default all. One that has come to its end
                may have sent them before.
        """
        if self._next is None or self._now < self._next:
            return False
        self._next = self._now + _LOOK
        processes = [comm.log.last(rank)[0] for rank in range(comm.size)]
        ended = any(processes[rank] < 0 for rank in peers or range(comm.size))
        gone = any(one > 0 and not is_alive(one) for one in processes)
        self._looks = self._looks + 1 if gone or ended else 0
        return self._looks > (2 if gone else 8)


def install_hook(comm) -> None:
    """Lets an exception that nobody catches end all ranks."""
    former = sys.excepthook

    def ended(kind, value, traceback):
        if issubclass(kind, KeyboardInterrupt) and comm.size == 1:
            former(kind, value, traceback)
            return
        print(f"rank {comm.rank} of {comm.size} ends all ranks:", file=sys.stderr)
        former(kind, value, traceback)
        sys.stderr.flush()
        comm.abort(1)

    sys.excepthook = ended
