"""`init`: finds the engine that a process was started with."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
import threading

import warp as wp
from warp import _native, config
from warp._src import errors
from warp._src.distributed import failures
from warp._src.distributed.communicator import Communicator, set_current

ENGINES = ("auto", "mpi", "torch", "none")
_MPI_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_NTASKS")


def find_engine() -> str:
    """The engine that the environment speaks of."""
    torch = sys.modules.get("torch.distributed")
    if torch is not None and torch.is_initialized():
        return "torch"
    if "RANK" in os.environ and "WORLD_SIZE" in os.environ:
        return "torch"
    if any(name in os.environ for name in _MPI_SIZES):
        return "mpi"
    return "none"


def init(engine="auto", timeout=300, device=None) -> Communicator:
    """Joins the ranks that a launcher has started; a process alone is rank 0 of 1.

    Chooses the device by the rank's number on its host and makes it the default one, and as many
    threads as the host has CPUs for each rank where nothing else says how many. An exception that
    nobody catches ends all ranks from then on.

    Args:
        engine: "mpi", "torch", "none", or "auto": torch if it has a process group or torchrun has
            started the process, MPI if mpirun or srun has.
        timeout: seconds after which a rank that does not answer is an error.
        device: of this rank, by default the GPU of its number on the host, else the CPU.

    Raises:
        DistributedError: there is no such engine, or a rank has no GPU of its own.
    """
    if engine not in ENGINES:
        raise failures.DistributedValueError(
            f"init expects an engine of {', '.join(map(repr, ENGINES))}, but got {engine!r}"
        )
    if not isinstance(timeout, (int, float)) or not timeout > 0:
        raise failures.DistributedValueError(
            f"init expects a positive number of seconds as timeout, but got {timeout!r}"
        )
    chosen = find_engine() if engine == "auto" else engine
    if chosen == "none":
        comm = Communicator(0, 1, device=device, timeout=timeout)
        set_current(comm)
        return comm
    comm = _mpi(timeout, device) if chosen == "mpi" else _torch(timeout, device)
    set_current(comm)
    _share_cpus(comm)
    if comm.size > 1:
        _check_devices(comm)
        failures.install_hook(comm)
    return comm


def _check_devices(comm) -> None:
    """Rejects ranks of which some have a GPU and some have none, on all of them."""
    found = comm.gather_objects(str(comm.device))
    for rank, one in enumerate(found):
        if (one == "cpu") != (found[0] == "cpu"):
            raise failures.DistributedError(
                f"rank {comm.rank}: init: rank {rank} computes on '{one}', but rank 0 on "
                f"'{found[0]}': let all ranks see a GPU (CUDA_VISIBLE_DEVICES), or pass `device`"
            )


def _check_installed(name) -> None:
    if importlib.util.find_spec(name) is None:
        raise failures.DistributedError(
            f"init: the process was started for {name}, which is not installed: install it, or "
            "call `wd.init('none')`"
        )


def _mpi(timeout, device):
    _check_installed("mpi4py")
    from mpi4py import MPI

    from warp._src.distributed.mpi import MpiCommunicator, ranks_of_host

    local = ranks_of_host(MPI.COMM_WORLD)
    chosen = _device(MPI.COMM_WORLD.rank, *local[:2], device)
    return MpiCommunicator(MPI.COMM_WORLD, chosen, timeout, local)


def _torch(timeout, device):
    _check_installed("torch")
    import datetime

    import torch.distributed as dist

    from warp._src.distributed.torch import TorchCommunicator

    rank = int(os.environ.get("RANK", 0))
    local = int(os.environ.get("LOCAL_RANK", rank))
    count = int(os.environ.get("LOCAL_WORLD_SIZE", os.environ.get("WORLD_SIZE", 1)))
    chosen = _device(rank, local, count, device)
    with _meeting(rank, timeout):
        if not dist.is_initialized():
            backend = "nccl" if chosen.is_cuda else "gloo"
            if chosen.is_cuda:
                import torch

                torch.cuda.set_device(chosen.ordinal)
            dist.init_process_group(backend, timeout=datetime.timedelta(seconds=timeout))
        return TorchCommunicator(None, chosen, timeout)


# Seconds beyond the time limit until ranks that PyTorch lets wait are ended.
_GRACE = 5.0


@contextlib.contextmanager
def _meeting(rank, timeout):
    """Bounds the rendezvous of a rank with the other ranks of PyTorch, which may wait without end.

    Raises:
        DistributedError: PyTorch has given up. If it waits on, the process ends with a message.
    """
    named = os.environ.get
    place = f"{named('MASTER_ADDR', '?')}:{named('MASTER_PORT', '?')}"
    text = f"rank {rank}: init: {named('WORLD_SIZE', '1')} ranks do not meet at {place}"
    fix = "start all of them, on a port that no other program has, or raise `timeout`"

    def end():
        print(f"{text} within {timeout:g} s: {fix}", file=sys.stderr, flush=True)
        os._exit(1)

    timer = threading.Timer(timeout + _GRACE, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    except RuntimeError as problem:
        if isinstance(problem, errors.WarpError):
            raise
        said = " ".join(str(problem).split())[:200]
        raise failures.DistributedError(f"{text}: PyTorch says '{said}': {fix}") from None
    finally:
        timer.cancel()


def _device(rank, local_rank, local_size, device):
    """The device of a rank, made the default one."""
    count = wp.get_cuda_device_count()
    if device is None and count == 0:
        device = "cpu"
    elif device is None:
        # A launcher may show each rank its own GPU alone.
        shown = os.environ.get("CUDA_VISIBLE_DEVICES", "")
        alone = count == 1 and shown.strip().count(",") == 0 and shown.strip() != ""
        if not alone and local_size > count:
            raise failures.DistributedError(
                f"rank {rank}: no GPU is left for it, {local_size} ranks on this host have "
                f"{count}: start as many ranks as GPUs, or pass `device` to `wd.init`"
            )
        device = f"cuda:{0 if alone else local_rank}"
    chosen = wp.get_device(device)
    wp.set_device(chosen)
    return chosen


def _share_cpus(comm) -> None:
    """Threads for each rank of the host, where nothing says how many."""
    if any(os.environ.get(name) for name in ("WARP_NUM_THREADS", "OMP_NUM_THREADS")):
        return
    own = os.sched_getaffinity(0)
    facts = os.uname().nodename, own, _native.cpu_quota(), _control_groups()
    share = _share_of(comm.rank, comm.gather_objects(facts))
    if share < len(own):
        config.num_threads = share


def _control_groups() -> str:
    """The control groups of this process, as the kernel lists them."""
    try:
        with open("/proc/self/cgroup") as file:
            return file.read()
    except OSError:
        return ""


def _share_of(rank, facts) -> int:
    """The CPUs of a rank: its part of those of the host, and of a quota.

    Args:
        facts: of each rank the host, its CPUs, those that its control groups pay for, and these.
    """
    host, own, quota, groups = facts[rank]
    near = [one for one in facts if one[0] == host]
    # A launcher may have bound each rank to CPUs of its own, or given it a group of its own.
    cpus = len(set().union(*(one[1] for one in near))) // len(near)
    paid = quota // sum(one[3] == groups for one in near)
    return max(min(len(own), cpus, paid), 1)
