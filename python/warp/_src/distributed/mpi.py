"""MPI by mpi4py: arrays of the CPU go as they are, those of GPUs through pinned memory.

Waits test and back off, so that a rank that does not answer is an error after a time limit.
"""

from __future__ import annotations

import ctypes
import functools
import os
import pickle

import numpy as np
from mpi4py import MPI

import warp as wp
from warp import _native
from warp._src import errors
from warp._src.distributed import failures
from warp._src.distributed.communicator import Communicator, Message

_OPERATIONS = {"sum": MPI.SUM, "min": MPI.MIN, "max": MPI.MAX}
# Numbers that MPI calculates with.
_NUMBERS = {
    *(wp.float32, wp.float64, wp.int8, wp.int16, wp.int32, wp.int64),
    *(wp.uint8, wp.uint16, wp.uint32, wp.uint64),
}


# Looks at a request before a wait tests the clock: half a millisecond.
_QUICK = range(4000)


def ranks_of_host(comm) -> tuple[int, int, int]:
    """Number of this rank on its host, how many there are, and CPUs that any of them may use."""
    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    # A launcher may have bound each rank to a CPU of its own.
    cpus = set().union(*node.allgather(os.sched_getaffinity(0)))
    found = node.rank, node.size, len(cpus)
    node.Free()
    return found


class MpiCommunicator(Communicator):
    """Ranks of an MPI communicator."""

    engine = "MPI"

    def __init__(self, comm=None, device=None, timeout=300.0, local=None):
        if comm is None:
            comm = MPI.COMM_WORLD
        if not isinstance(comm, MPI.Comm):
            raise errors.WarpTypeError(
                f"wd.mpi expects a communicator of mpi4py, but got '{type(comm).__name__}'"
            )
        # Messages of others do not mix with these, and errors are exceptions.
        self.comm = comm.Dup()
        self.comm.Set_errhandler(MPI.ERRORS_RETURN)
        local_rank, local_size, cpus = local or ranks_of_host(comm)
        super().__init__(
            comm.rank, comm.size, local_rank, local_size, device=device, timeout=timeout
        )
        self.checks = comm.Dup()
        self.is_direct = False
        # Ranks that share CPUs give them up at once.
        shared = self.local_size > cpus
        self.quick, self.spins = (range(1), 0) if shared else (_QUICK, 400)
        if self.size > 1:
            self.log = failures.RankLog.shared(self)
        if self.device.is_cuda and self.size > 1:
            self.is_direct = self._takes_gpu_memory()
        self.shares_memory = self.device.is_cpu

    def _takes_gpu_memory(self) -> bool:
        """Sends one message to oneself, of memory on the GPU."""
        probe = wp.full(4, 7, dtype=wp.int32, device=self.device)
        out = wp.zeros_like(probe)
        try:
            wp.synchronize_device(self.device)
            self.comm.Sendrecv(probe, self.rank, 0, out, self.rank, 0)
            works = bool((out.numpy() == 7).all())
        except Exception:
            works = False
        works = all(self.comm.allgather(works))
        if not works and self.rank == 0 and not wp.config.quiet:
            print("warp.distributed: MPI takes no GPU memory, messages go through the host")
        return works

    # Buffers.

    def view(self, array, copied=None):
        """The buffer that MPI is given for an array; `copied` collects (staging, array)."""
        if array is None:
            return None
        if array.device.is_cpu:
            return array._host_view().reshape(-1)
        if self.is_direct:
            return array
        staging = wp.empty(array.shape, dtype=array.dtype, device="cpu", pinned=True)
        if copied is not None:
            copied.append((staging, array))
        return staging._host_view().reshape(-1)

    def settle(self) -> None:
        """Waits for work that MPI does not know of."""
        if self.device.is_cuda:
            wp.synchronize_stream(wp.get_stream(self.device))

    def wait(self, requests, what, peers=None) -> None:
        """Waits for requests, up to the time limit; `peers` are the ranks that are waited for."""
        test = MPI.Request.Testall
        try:
            if test(requests):
                return
            deadline = failures.Deadline(self.timeout, self.spins)
            while not test(requests):
                if not deadline.wait():
                    problem = f"no answer within {self.timeout:g} s"
                    break
                if deadline.is_vain(self, peers):
                    problem = "it waits in vain"
                    break
            else:
                return
        except MPI.Exception as problem:
            raise self.failed(what, f"MPI says '{problem.Get_error_string()}'") from None
        raise self.failed(what, problem)

    def failed(self, what, problem):
        """The error of an exchange that failed."""
        plan, step = self.log.last(self.rank)[1:]
        return failures.failed(self, what, plan, step, problem)

    def _collective(self, begin, what) -> None:
        try:
            request = begin()
            test = request.Test
            for _ in self.quick:
                if test():
                    return
        except MPI.Exception as problem:
            raise self.failed(what, f"MPI says '{problem.Get_error_string()}'") from None
        self.wait([request], what)

    # Operations.

    def exchange(self, messages) -> None:
        work = Persistent(self, messages)
        work.start()
        work.finish()
        work.free()

    def persistent(self, messages):
        return Persistent(self, messages)

    def all_reduce(self, array, op="sum") -> None:
        copied: list = []
        self.settle()
        view = self.view(array, copied)
        for staging, source in copied:
            wp.copy(staging, source)
            self.settle()
        send = MPI.IN_PLACE
        self._collective(lambda: self.comm.Iallreduce(send, view, _OPERATIONS[op]), "all_reduce")
        for staging, source in copied:
            wp.copy(source, staging)

    def _on_host(self, *arrays):
        """Arrays on the host, and whether they are copies."""
        self.settle()
        return [one if one.device.is_cpu else one.to("cpu") for one in arrays]

    def reduce_scatter(self, out, array, counts) -> None:
        here, source = self._on_host(out, array)
        views = here._host_view().reshape(-1), source._host_view().reshape(-1)
        begin = self.comm.Ireduce_scatter
        self._collective(lambda: begin(views[1], views[0], counts, MPI.SUM), "reduce_scatter")
        if here is not out:
            wp.copy(out, here)

    def all_gather(self, out, array, counts) -> None:
        here, source = self._on_host(out, array)
        views = here._host_view().reshape(-1), source._host_view().reshape(-1)
        begin = self.comm.Iallgatherv
        self._collective(lambda: begin(views[1], (views[0], counts)), "all_gather")
        if here is not out:
            wp.copy(out, here)

    def all_to_all(self, out, array, out_counts, counts) -> None:
        here, source = self._on_host(out, array)
        views = here._host_view().reshape(-1), source._host_view().reshape(-1)
        begin = self.comm.Ialltoallv
        self._collective(lambda: begin((views[1], counts), (views[0], out_counts)), "all_to_all")
        if here is not out:
            wp.copy(out, here)

    def broadcast(self, array, root=0) -> None:
        (here,) = self._on_host(array)
        view = here._host_view().reshape(-1)
        self._collective(lambda: self.comm.Ibcast(view, root), "broadcast")
        if here is not array:
            wp.copy(array, here)

    def check_sum(self, numbers) -> np.ndarray:
        """Sums of a few integers over all ranks, apart from other messages."""
        out = np.array(numbers, np.int64)
        begin = self.checks.Iallreduce
        self._collective(lambda: begin(MPI.IN_PLACE, out, MPI.SUM), "check of a plan")
        return out

    def barrier(self) -> None:
        self._collective(self.comm.Ibarrier, "barrier")

    def gather_objects(self, value) -> list:
        data = np.frombuffer(pickle.dumps(value), np.uint8)
        counts = np.empty(self.size, np.int64)
        own, begin = np.array([len(data)], np.int64), self.checks.Iallgather
        self._collective(lambda: begin(own, counts), "gather")
        found, every = np.empty(counts.sum(), np.uint8), self.checks.Iallgatherv
        self._collective(lambda: every(data, (found, counts)), "gather")
        parts = np.split(found, np.cumsum(counts)[:-1])
        return [pickle.loads(part.tobytes()) for part in parts]

    def broadcast_object(self, value, root=0):
        data = np.frombuffer(pickle.dumps(value if self.rank == root else None), np.uint8).copy()
        count, begin = np.array([len(data)], np.int64), self.checks.Ibcast
        self._collective(lambda: begin(count, root), "broadcast")
        if self.rank != root:
            data = np.empty(count[0], np.uint8)
        self._collective(lambda: begin(data, root), "broadcast")
        return pickle.loads(data.tobytes())

    def split(self, color, key=0) -> MpiCommunicator:
        part = self.comm.Split(color, key)
        return MpiCommunicator(part, self.device, self.timeout)

    def abort(self, code=1) -> None:
        self.comm.Abort(code)

    def supports(self, dtype, op="sum", device=None, capture=False) -> bool:
        on_gpu = wp.get_device(device or self.device).is_cuda
        if capture and on_gpu:
            return False
        return op in _OPERATIONS and getattr(dtype, "_wp_scalar_type_", dtype) in _NUMBERS

    def close(self) -> None:
        if not self.closed and not MPI.Is_finalized():
            self.comm.Free()
            self.checks.Free()
        super().close()


@functools.cache
def _functions():
    """Addresses of `MPI_Startall` and `MPI_Testall` in the library that mpi4py has loaded.

    Zeros if its symbols are out of reach.
    """
    for file in (MPI.__file__, None):
        try:
            library = ctypes.CDLL(file)
            found = library.MPI_Startall, library.MPI_Testall
        except (OSError, AttributeError):
            continue
        return tuple(ctypes.cast(one, ctypes.c_void_p).value for one in found)
    return 0, 0


def _native_requests(requests, looks):
    """The same requests for the runtime to start and to test, or None."""
    functions = _functions()
    if not all(functions) or not requests:
        return None
    size = MPI._sizeof(MPI.Request)
    handles = b"".join(ctypes.string_at(MPI._addressof(one), size) for one in requests)
    return _native.Requests(*functions, handles, len(requests), looks)


class Persistent:
    """Persistent requests between the same arrays.

    Attributes:
        native: the requests for the runtime, or None.
    """

    what = "exchange"

    def __init__(self, comm, messages: list[Message]):
        self.comm = comm
        self.given: list = []
        self.taken: list = []
        self.requests: list = []
        self.peers = [one.peer for one in messages if one.take is not None]
        for one in messages:
            if one.take is not None:
                view = comm.view(one.take, self.taken)
                request = comm.comm.Recv_init(_bytes(view), one.peer, one.take_tag)
                self.requests.append(request)
        for one in messages:
            if one.give is not None:
                view = comm.view(one.give, self.given)
                request = comm.comm.Send_init(_bytes(view), one.peer, one.give_tag)
                self.requests.append(request)
        self.native = _native_requests(self.requests, len(comm.quick))

    def quick(self, plan):
        """A function that exchanges, counts a step of a plan and notes it for other ranks, or None.

        It gives what `settle` takes if that is not 0.
        """
        if self.native is None or self.comm.device.is_cuda:
            return None
        self.noted = plan, self.comm.log.own
        words = [np.frombuffer(one, np.int64).ctypes.data for one in self.noted]
        self.native.note(words[0], words[1] + 8 * failures.PLAN)
        return self.native.run

    def start(self) -> None:
        """Begins to send and receive."""
        if self.comm.device.is_cuda:
            for staging, array in self.given:
                wp.copy(staging, array)
            self.comm.settle()
        if self.native is None:
            MPI.Prequest.Startall(self.requests)
        else:
            self.settle(self.native.start())

    def finish(self) -> None:
        """Waits until all is sent and received."""
        self.settle(-1 if self.native is None else self.native.wait())
        for staging, array in self.taken:
            wp.copy(array, staging)

    def settle(self, found) -> None:
        """Goes on from what `native` gives: 0 at the end, -1 before, or the error of MPI."""
        if found > 0:
            text = f"MPI says '{MPI.Exception(found).Get_error_string()}'"
            raise self.comm.failed(self.what, text)
        if found < 0:
            self.comm.wait(self.requests, self.what, self.peers)

    def free(self) -> None:
        """Gives the requests back."""
        for one in self.requests:
            one.Free()
        self.requests, self.native = [], None

    def __del__(self):
        # An exchange lives as long as a tape that has recorded it.
        if self.requests and os.getpid() == self.comm.process and not MPI.Is_finalized():
            self.free()


def _bytes(view):
    """Memory as bytes: types are checked by the plan."""
    return [view, MPI.BYTE] if isinstance(view, np.ndarray) else view
