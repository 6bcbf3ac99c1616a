"""NCCL through its C interface: transfers queued on a stream, also in captured graphs.

The library is that of PyTorch, of CuPy or of the package nvidia-nccl, whichever is loaded or found.
Another communicator, of MPI or PyTorch, brings the ranks together and carries Python objects.
"""

from __future__ import annotations

import ctypes
import glob
import os
import sys

import numpy as np

import warp as wp
from warp import _native
from warp._src.devices.allocators import CurrentContext
from warp._src.distributed import communicator as base
from warp._src.distributed.failures import DistributedError
from warp._src.distributed.watch import Watch
from warp._src.types import dtypes

_TYPES = {
    **{wp.int8: 0, wp.uint8: 1, wp.int32: 2, wp.uint32: 3, wp.int64: 4, wp.uint64: 5},
    **{wp.float16: 6, wp.float32: 7, wp.float64: 8, wp.bfloat16: 9},
}
_OPERATIONS = {"sum": 0, "max": 2, "min": 3}
_IN_PROGRESS = 7


class _UniqueId(ctypes.Structure):
    _fields_ = [("bytes", ctypes.c_char * 128)]


def _candidates():
    yield "libnccl.so.2"
    for folder in sys.path:
        yield from glob.glob(os.path.join(folder, "nvidia", "nccl", "lib", "libnccl.so*"))


def _load(rank):
    for name in _candidates():
        try:
            return ctypes.CDLL(name)
        except OSError:
            continue
    raise DistributedError(
        f"rank {rank}: wd.nccl: the library libnccl.so.2 is not found: install "
        "nvidia-nccl-cu12 or PyTorch for CUDA, or add its folder to LD_LIBRARY_PATH"
    )


class NcclCommunicator(base.Communicator):
    """GPUs of the ranks of another communicator."""

    engine = "NCCL"

    def __init__(self, comm=None, device=None, timeout=None):
        self.bootstrap = base.resolve(comm)
        other = self.bootstrap
        device = wp.get_device(device or other.device)
        if not device.is_cuda:
            raise DistributedError(
                f"rank {other.rank}: wd.nccl needs a GPU for each rank, but this one computes on "
                f"'{device}': use `wd.mpi` or `wd.torch`"
            )
        super().__init__(
            *(other.rank, other.size, other.local_rank, other.local_size, device),
            timeout=other.timeout if timeout is None else timeout,
        )
        self.log, self.plan_names = other.log, other.plan_names
        self.graph_names = other.graph_names
        self._check_devices()
        # NCCL uses streams behind the runtime's back.
        _native.share_with_others()
        self.stream = wp.Stream(device, priority=-1)
        self.library = _load(self.rank)
        identity = _UniqueId()
        if self.rank == 0:
            self._call("ncclGetUniqueId", ctypes.byref(identity))
        data = other.broadcast_object(bytes(identity), 0)
        ctypes.memmove(ctypes.byref(identity), data, len(data))
        self.handle = ctypes.c_void_p()
        self.watch = Watch(self) if self.size > 1 else None
        # NCCL takes the device whose context is current.
        with CurrentContext(device.index):
            self._watched(
                "ncclCommInitRank", ctypes.byref(self.handle), self.size, identity, self.rank
            )

    def _check_devices(self) -> None:
        """Rejects ranks of one host that have the same GPU, which NCCL does not take."""
        found = self.bootstrap.gather_objects((os.uname().nodename, self.device.uuid))
        for rank, one in enumerate(found):
            if rank != self.rank and one == found[self.rank]:
                raise DistributedError(
                    f"rank {self.rank}: wd.nccl needs a GPU for each rank, but rank {rank} has "
                    f"'{self.device}', too: start as many ranks as GPUs, or use `wd.torch` with "
                    "gloo"
                )

    def _call(self, name, *arguments) -> None:
        function = getattr(self.library, name)
        status = function(*arguments)
        if status not in (0, _IN_PROGRESS):
            text = self.library.ncclGetErrorString
            text.restype = ctypes.c_char_p
            raise DistributedError(f"rank {self.rank}: {name}: NCCL says '{text(status).decode()}'")

    def _watched(self, name, *arguments) -> None:
        """A call that may wait for other ranks, and that queues work which may."""
        if self.watch is None:
            self._call(name, *arguments)
            return
        self.watch.begin(name)
        try:
            self._call(name, *arguments)
        finally:
            self.watch.end()

    def _arguments(self, array):
        kind = _TYPES[array.dtype]
        return ctypes.c_void_p(array.ptr), ctypes.c_size_t(array.size), kind

    @property
    def _queue(self):
        """The stream that NCCL's work goes to: a captured one, or the current one."""
        return ctypes.c_void_p(wp.get_stream(self.device).cuda_stream)

    def exchange(self, messages) -> None:
        """Queues messages; those between two ranks are matched in the order of their tags."""
        self._call("ncclGroupStart")
        try:
            for one in sorted(messages, key=lambda one: one.give_tag):
                if one.give is not None:
                    parts = self._arguments(one.give)
                    self._call("ncclSend", *parts, one.peer, self.handle, self._queue)
            for one in sorted(messages, key=lambda one: one.take_tag):
                if one.take is not None:
                    parts = self._arguments(one.take)
                    self._call("ncclRecv", *parts, one.peer, self.handle, self._queue)
        finally:
            self._watched("ncclGroupEnd")

    def persistent(self, messages):
        return _Queued(self, messages)

    def all_reduce(self, array, op="sum") -> None:
        pointer, count, kind = self._arguments(array)
        operation = _OPERATIONS[op]
        self._watched(
            "ncclAllReduce", pointer, pointer, count, kind, operation, self.handle, self._queue
        )

    def broadcast(self, array, root=0) -> None:
        pointer, count, kind = self._arguments(array)
        self._watched(
            "ncclBroadcast", pointer, pointer, count, kind, root, self.handle, self._queue
        )

    def check_sum(self, numbers) -> np.ndarray:
        return self.bootstrap.check_sum(numbers)

    def barrier(self) -> None:
        wp.synchronize_device(self.device)
        self.bootstrap.barrier()

    def gather_objects(self, value) -> list:
        return self.bootstrap.gather_objects(value)

    def broadcast_object(self, value, root=0):
        return self.bootstrap.broadcast_object(value, root)

    def split(self, color, key=0) -> NcclCommunicator:
        part = self.bootstrap.split(color, key)
        return NcclCommunicator(part, self.device, self.timeout)

    def abort(self, code=1) -> None:
        self.bootstrap.abort(code)

    def supports(self, dtype, op="sum", device=None, capture=False) -> bool:
        on_gpu = wp.get_device(device or self.device).is_cuda
        scalar = dtypes.canonical(getattr(dtype, "_wp_scalar_type_", dtype))
        return on_gpu and op in _OPERATIONS and scalar in _TYPES

    def failure(self) -> str | None:
        """NCCL's asynchronous error, if there is one."""
        if not self.handle:
            # The ranks are still coming together.
            return None
        found = ctypes.c_int()
        status = self.library.ncclCommGetAsyncError(self.handle, ctypes.byref(found))
        error = status or found.value
        return None if error in (0, _IN_PROGRESS) else f"NCCL error {error}"

    def close(self) -> None:
        if not self.closed:
            wp.synchronize_device(self.device)
            if self.watch is not None:
                self.watch.close()
            self._call("ncclCommDestroy", self.handle)
        super().close()


class _Queued:
    """Messages on the communicator's stream, ordered by events with the current one."""

    what = "exchange"

    def __init__(self, comm, messages):
        self.comm, self.messages = comm, messages
        self.ready = wp.Event(comm.device)
        self.done = wp.Event(comm.device)

    def start(self) -> None:
        """Queues the transfer behind what is queued already."""
        comm = self.comm
        current = wp.get_stream(comm.device)
        current.record_event(self.ready)
        comm.stream.wait_event(self.ready)
        with wp.ScopedStream(comm.stream, sync_enter=False):
            comm.exchange(self.messages)
            comm.stream.record_event(self.done)

    def finish(self) -> None:
        """Lets what is queued from now on wait for the transfer."""
        wp.get_stream(self.comm.device).wait_event(self.done)

    def quick(self, plan) -> None:
        """No function does all of an exchange."""

    def free(self) -> None:
        """Nothing is held."""
