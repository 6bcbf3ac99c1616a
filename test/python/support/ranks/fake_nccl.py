"""Stands in for NCCL between ranks of MPI whose GPUs are the driver of the unit tests.

    mpirun -n 2 python fake_nccl.py [--queued] [--stall] PROGRAM ARGUMENTS

Memory of that driver is the host's, so a worker thread sends it by MPI. With `--queued` calls
return at once, and `numpy()` and events wait as they do on a GPU; else calls wait themselves. With
`--stall` rank 1 never comes back from `ncclCommInitRank`. Kernels do not run on that driver, copies
and fills do, and do not wait for what is queued. Messages on a stream that is captured wait for
replays of the graph.
"""

import ctypes
import os
import queue
import runpy
import sys
import threading
import time

import numpy as np
from mpi4py import MPI

import warp as wp
from warp._src.distributed import nccl, watch

# The types and operations by NCCL's numbers.
TYPES = ("i1", "u1", "i4", "u4", "i8", "u8", "f2", "f4", "f8")
OPERATIONS = (MPI.SUM, MPI.PROD, MPI.MAX, MPI.MIN)
INVALID_ARGUMENT = 4


def _memory(pointer, count, kind):
    type_ = np.dtype(TYPES[kind])
    size = count.value * type_.itemsize
    if not size:
        return np.empty(0, type_)
    return np.frombuffer((ctypes.c_char * size).from_address(pointer.value), type_)


class Library:
    """The functions of libnccl that `nccl.py` calls; each gives a status."""

    def __init__(self, queued, stalls):
        self.queued, self.stalls = queued, stalls
        self.work: queue.Queue = queue.Queue()
        self.group: list = []
        self.added = self.done = 0
        self.captured: list = []
        # A function whose result has a type, as those of a library.
        self.ncclGetErrorString = lambda status: f"status {status}".encode()
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while True:
            self.work.get()()
            self.done += 1

    def _add(self, work):
        if wp.get_stream().is_capturing:
            self.captured.append(work)
            return 0
        self.added += 1
        self.work.put(work)
        if not self.queued:
            self.wait()
        return 0

    def wait(self):
        """Waits as the host waits for a stream."""
        while self.done < self.added:
            time.sleep(1e-4)

    def ncclGetUniqueId(self, identity):
        return 0

    def ncclCommInitRank(self, handle, size, identity, rank):
        if self.stalls and rank == 1:
            time.sleep(100)
        self.comm = MPI.COMM_WORLD.Dup()
        handle._obj.value = 1
        return 0

    def ncclCommGetAsyncError(self, handle, status):
        if not handle.value:
            return INVALID_ARGUMENT
        status._obj.value = 0
        return 0

    def ncclCommDestroy(self, handle):
        return 0

    def ncclGroupStart(self):
        self.group = []
        return 0

    def ncclSend(self, pointer, count, kind, peer, handle, stream):
        self.group.append((self.comm.Isend, _memory(pointer, count, kind), peer))
        return 0

    def ncclRecv(self, pointer, count, kind, peer, handle, stream):
        self.group.append((self.comm.Irecv, _memory(pointer, count, kind), peer))
        return 0

    def ncclGroupEnd(self):
        group = self.group
        return self._add(lambda: MPI.Request.Waitall([begin(*rest) for begin, *rest in group]))

    def ncclAllReduce(self, source, dest, count, kind, operation, handle, stream):
        parts = _memory(source, count, kind).copy(), _memory(dest, count, kind)
        return self._add(lambda: self.comm.Allreduce(*parts, OPERATIONS[operation]))

    def ncclBroadcast(self, source, dest, count, kind, root, handle, stream):
        part = _memory(dest, count, kind)
        return self._add(lambda: self.comm.Bcast(part, root))


def install(queued, stalls):
    """Lets `wd.nccl` find this library."""
    library = Library(queued, stalls)
    nccl._load = lambda rank: library
    numpy, record_event = wp.array.numpy, wp.Stream.record_event
    marks: dict = {}

    def read(self):
        library.wait()
        return numpy(self)

    def record(self, event=None):
        event = record_event(self, event)
        marks[event] = library.added
        return event

    make, launch = watch.WatchedGraph.__init__, watch.WatchedGraph.launch

    def made(self, *arguments):
        make(self, *arguments)
        self.messages, library.captured = library.captured, []

    def replay(self, stream, run):
        def run_all(graph, stream):
            run(graph, stream)
            for work in self.messages:
                library._add(work)

        launch(self, stream, run_all)

    watch.WatchedGraph.__init__, watch.WatchedGraph.launch = made, replay
    wp.array.numpy, wp.Stream.record_event = read, record
    wp.Event.is_complete = property(lambda self: library.done >= marks.get(self, 0))


if __name__ == "__main__":
    flags = [one for one in sys.argv[1:3] if one in ("--queued", "--stall")]
    install("--queued" in flags, "--stall" in flags)
    sys.argv = sys.argv[1 + len(flags) :]
    # As programs do whose errors the hook of the ranks tells.
    sys.path.insert(0, os.path.dirname(sys.argv[0]))
    runpy.run_path(sys.argv[0], run_name="__main__")
