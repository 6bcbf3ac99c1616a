"""torch.distributed: gloo on CPUs, NCCL on GPUs."""

from __future__ import annotations

import atexit
import contextlib
import datetime
import os

import numpy as np
import torch
import torch.distributed as dist

import warp as wp
from warp import _native
from warp._src import errors
from warp._src.distributed import failures
from warp._src.distributed.communicator import Communicator, alive

_OPERATIONS = {"sum": dist.ReduceOp.SUM, "min": dist.ReduceOp.MIN, "max": dist.ReduceOp.MAX}
# Numbers that gloo calculates with.
_NUMBERS = {wp.float32, wp.float64, wp.int8, wp.int32, wp.int64, wp.uint8}


def _group(ranks, backend, limit):
    """A group that its members alone have to make."""
    local = ranks is not None
    return dist.new_group(ranks, limit, backend, use_local_synchronization=local)


@atexit.register
def _join_gloo() -> None:
    """Ends groups of gloo while Python is still there, in the process that has made them.

    Their threads give memory of NumPy back, which ends a process in an abort where Python is gone.
    """
    found = [one for one in alive if isinstance(one, TorchCommunicator)]
    found = [one for one in found if one.process == os.getpid()]
    if not found or not dist.is_initialized():
        return
    for one in found:
        # The last reference to a group waits for its threads.
        checks, one.checks = one.checks, None
        with contextlib.suppress(ValueError):
            dist.destroy_process_group(checks)
        if one.backend == "gloo":
            one.group = None
    if dist.get_backend() == "gloo":
        dist.destroy_process_group()


class TorchCommunicator(Communicator):
    """Ranks of a process group of PyTorch."""

    engine = "torch"

    def __init__(self, group=None, device=None, timeout=300.0):
        if not dist.is_initialized():
            raise failures.DistributedError(
                "wd.torch: PyTorch has no process group: call "
                "`torch.distributed.init_process_group`, or `wd.init('torch')` under torchrun"
            )
        if group is not None and not isinstance(group, dist.ProcessGroup):
            raise errors.WarpTypeError(
                f"wd.torch expects a process group, but got '{type(group).__name__}'"
            )
        self.group = group
        rank, size = dist.get_rank(group), dist.get_world_size(group)
        local = (
            int(os.environ.get("LOCAL_RANK", rank)),
            int(os.environ.get("LOCAL_WORLD_SIZE", size)),
        )
        super().__init__(rank, size, *local, device=device, timeout=timeout)
        self.backend = dist.get_backend(group)
        ranks = [dist.get_global_rank(group, k) for k in range(size)] if group else None
        limit = datetime.timedelta(seconds=self.timeout)
        self.checks = _group(ranks, "gloo", limit)
        self.limit = limit
        if size > 1:
            self.log = failures.RankLog.shared(self)
        self.is_queued = self.device.is_cuda and self.backend != "gloo"
        if self.is_queued:
            # PyTorch uses streams behind the runtime's back.
            _native.share_with_others()
            # The first call of a group has to be one of all ranks.
            self.all_reduce(wp.zeros(1, dtype=wp.int32, device=self.device))

    def _global(self, rank) -> int:
        return dist.get_global_rank(self.group, rank) if self.group else rank

    def in_order(self):
        """A block in which PyTorch queues behind what the current stream has."""
        if not self.is_queued:
            return contextlib.nullcontext()
        return torch.cuda.stream(wp.stream_to_torch(self.device))

    def tensor(self, array, copied=None):
        """The tensor that PyTorch is given for an array; `copied` collects (staging, array)."""
        if self.is_queued:
            return wp.to_torch(array, requires_grad=False)
        if array.device.is_cuda:
            staging = wp.empty(array.shape, dtype=array.dtype, device="cpu", pinned=True)
            copied.append((staging, array))
            array = staging
        view = array._host_view().reshape(-1)
        if view.dtype.kind == "u" and view.dtype.itemsize > 1:
            view = view.view(f"i{view.dtype.itemsize}")
        return torch.from_numpy(view)

    def failed(self, what, problem):
        """The error of an exchange that failed."""
        plan, step = self.log.last(self.rank)[1:]
        text = " ".join(str(problem).split())[:200]
        return failures.failed(self, what, plan, step, f"PyTorch says '{text}'")

    def _run(self, what, arrays, function, written) -> None:
        """Calls a function with tensors of arrays, some of which it writes."""
        copied: list = []
        with self.in_order():
            tensors = [self.tensor(one, copied) for one in arrays]
        for staging, array in copied:
            wp.copy(staging, array)
        if copied:
            wp.synchronize_device(self.device)
        try:
            with self.in_order():
                function(*tensors)
        except RuntimeError as problem:
            raise self.failed(what, problem) from None
        for staging, array in copied:
            if any(array is one for one in written):
                wp.copy(array, staging)

    def exchange(self, messages) -> None:
        work = Repeated(self, messages)
        work.start()
        work.finish()

    def persistent(self, messages):
        return Repeated(self, messages)

    def all_reduce(self, array, op="sum") -> None:
        def run(tensor):
            dist.all_reduce(tensor, _OPERATIONS[op], self.group)

        self._run("all_reduce", [array], run, [array])

    def broadcast(self, array, root=0) -> None:
        def run(tensor):
            dist.broadcast(tensor, self._global(root), self.group)

        self._run("broadcast", [array], run, [array])

    def check_sum(self, numbers) -> np.ndarray:
        """Sums of a few integers over all ranks, apart from other messages."""
        tensor = torch.tensor(numbers, dtype=torch.int64)
        try:
            dist.all_reduce(tensor, group=self.checks)
        except RuntimeError as problem:
            raise self.failed("check of a plan", problem) from None
        return tensor.numpy()

    def barrier(self) -> None:
        try:
            dist.monitored_barrier(self.checks, timeout=self.limit)
        except RuntimeError as problem:
            raise self.failed("barrier", problem) from None

    def gather_objects(self, value) -> list:
        parts = [None] * self.size
        try:
            dist.all_gather_object(parts, value, self.checks)
        except RuntimeError as problem:
            raise self.failed("gather", problem) from None
        return parts

    def split(self, color, key=0) -> TorchCommunicator:
        colors = self.gather_objects((color, key, self.rank))
        ranks = [self._global(rank) for one, _, rank in sorted(colors) if one == color]
        mine = _group(ranks, self.backend, self.limit)
        return TorchCommunicator(mine, self.device, self.timeout)

    def abort(self, code=1) -> None:
        os._exit(code)

    def supports(self, dtype, op="sum", device=None, capture=False) -> bool:
        on_gpu = wp.get_device(device or self.device).is_cuda
        if capture and on_gpu:
            return self.backend == "nccl"
        return op in _OPERATIONS and getattr(dtype, "_wp_scalar_type_", dtype) in _NUMBERS


class Repeated:
    """Messages between the same arrays; views of them are made once."""

    def __init__(self, comm, messages):
        self.comm = comm
        self.given: list = []
        self.taken: list = []
        self.work: list = []
        with comm.in_order():
            self._find(messages)
        self.what = "exchange"

    def _find(self, messages) -> None:
        """Tensors over the arrays of messages."""
        comm, group = self.comm, self.comm.group
        self.receives = [
            (comm.tensor(one.take, self.taken), comm._global(one.peer), group, one.take_tag)
            for one in sorted(messages, key=lambda one: one.take_tag)
            if one.take is not None
        ]
        self.sends = [
            (comm.tensor(one.give, self.given), comm._global(one.peer), group, one.give_tag)
            for one in sorted(messages, key=lambda one: one.give_tag)
            if one.give is not None
        ]

    def start(self) -> None:
        """Begins to send and receive."""
        for staging, array in self.given:
            wp.copy(staging, array)
        if self.given or self.taken:
            # The last messages have left the host's memory, too.
            wp.synchronize_device(self.comm.device)
        try:
            if self.comm.backend == "gloo":
                self.work = [dist.irecv(*one) for one in self.receives]
                self.work += [dist.isend(*one) for one in self.sends]
            else:
                batch = [dist.P2POp(dist.irecv, *one) for one in self.receives]
                batch += [dist.P2POp(dist.isend, *one) for one in self.sends]
                with self.comm.in_order():
                    self.work = dist.batch_isend_irecv(batch) if batch else []
        except RuntimeError as problem:
            raise self.comm.failed(self.what, problem) from None

    def finish(self) -> None:
        """Waits until all is sent and received."""
        try:
            if self.comm.is_queued:
                # The stream waits, and the host with a time limit alone.
                with self.comm.in_order():
                    for one in self.work:
                        one.wait()
            else:
                for one in self.work:
                    one.wait(self.comm.limit)
        except RuntimeError as problem:
            raise self.comm.failed(self.what, problem) from None
        for staging, array in self.taken:
            wp.copy(array, staging)

    def quick(self, plan) -> None:
        """No function does all of an exchange."""

    def free(self) -> None:
        """Nothing is held."""
