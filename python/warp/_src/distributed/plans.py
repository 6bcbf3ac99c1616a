"""Plans: work of all ranks that is checked once over them, and done again and again."""

from __future__ import annotations

import threading
from _blake2 import blake2b

import warp as wp
from warp._src.arrays.hooks import captures
from warp._src.arrays.observers import Observers, Observing
from warp._src.distributed import forward
from warp._src.distributed.failures import DistributedError


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
                    # The graph needs the memory of messages as long as it lives.
                    capture.hold(function)
    function()


def record(tape, backward, arrays) -> None:
    """Records an adjoint that tangents have one of their own of."""
    tape.add_function(lambda: forward.values_only(backward), arrays)


def without_tape(function):
    """Calls a function whose work no tape records."""
    with Observing(tape=None):
        return function()
