"""Shared memory of the ranks of a host, from which adjoints of ghosts are added.

A message is copied from process to process, and what came is read once more to be added. In shared
memory it is read once: the sender moves adjoints there, a message of one byte says so, and the
receiver adds them to its own.
"""

from __future__ import annotations

import numpy as np

import warp as wp
from warp._src.distributed.buffers import Buffer, aligned, size_of
from warp._src.distributed.failures import memory_of_host

# Bytes of a message from which on a plan has shared memory.
SMALLEST = 1 << 15


class SharedMemory:
    """The shared memory of a plan.

    It has two halves, taken in turn. A rank that is told of a half has had its neighbour's last
    adjoints, and so has the neighbour: the half of the step before is free when this one is read.

    Args:
        memory: of the ranks of a host.
        ranks: of this host.
        offsets: of messages, by (rank that sends, rank that gets, tag).
        size: of a half.
    """

    def __init__(self, memory, ranks, offsets, size):
        self.ranks = ranks
        self._offsets, self._size = offsets, size
        lent = np.frombuffer(memory, np.uint8)
        self._bytes = wp.array(lent, dtype=wp.uint8, device="cpu", copy=False)
        self._half = 0

    def turn(self) -> int:
        """The half of the next step."""
        self._half = 1 - self._half
        return self._half

    def buffer(self, half, sender, receiver, tag, likes) -> Buffer:
        """The memory of a message."""
        offset = self._offsets[sender, receiver, tag] + half * self._size
        size = size_of(likes)
        return Buffer(likes, None, self._bytes._view(offset, (size,), (1,), wp.uint8))


def share_memory(comm, messages) -> SharedMemory | None:
    """The shared memory of a plan, None if its messages are small or there is no room.

    All ranks call this.

    Args:
        messages: bytes of adjoints that this rank sends, by (rank that gets, tag).
    """
    if comm.size == 1 or not comm.shares_memory:
        return None
    found = comm.gather_objects(messages)
    if max((size for one in found for size in one.values()), default=0) < SMALLEST:
        return None
    ranks = [rank for rank in range(comm.size) if comm.log.last(rank)[0]]
    offsets, end = {}, 0
    for rank in ranks:
        for (receiver, tag), size in found[rank].items():
            offsets[rank, receiver, tag] = end
            end += aligned(size)
    memory = memory_of_host(comm, max(2 * end, 1))
    return None if memory is None else SharedMemory(memory, ranks, offsets, end)
