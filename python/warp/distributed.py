"""Several processes on MPI, NCCL or torch.distributed, differentiable: docs/distributed.md.

    import warp as wp
    import warp.distributed as wd

    comm = wd.init()
    blocks = wd.Blocks((512, 512), width=1)
    x = blocks.zeros(float)
    blocks.halo(x)

The same program runs alone, under `mpirun -n 4 python` and under `torchrun`.
"""

import contextlib
import typing

if typing.TYPE_CHECKING:
    from warp._src.distributed.blocks import Blocks as Blocks
    from warp._src.distributed.blocks import Box as Box
    from warp._src.distributed.checkpoints import load as load
    from warp._src.distributed.checkpoints import save as save
    from warp._src.distributed.communicator import Communicator as Communicator
    from warp._src.distributed.communicator import Message as Message
    from warp._src.distributed.communicator import current as current
    from warp._src.distributed.failures import DistributedError as DistributedError
    from warp._src.distributed.failures import DistributedValueError as DistributedValueError
    from warp._src.distributed.graphs import Graph as Graph
    from warp._src.distributed.operations import all_gather as all_gather
    from warp._src.distributed.operations import all_reduce as all_reduce
    from warp._src.distributed.operations import all_to_all as all_to_all
    from warp._src.distributed.operations import barrier as barrier
    from warp._src.distributed.operations import broadcast as broadcast
    from warp._src.distributed.operations import reduce_scatter as reduce_scatter
    from warp._src.distributed.operations import replicate as replicate
    from warp._src.distributed.operations import rows_of as rows_of
    from warp._src.distributed.particles import Particles as Particles
    from warp._src.distributed.processes import Shared as Shared
    from warp._src.distributed.processes import progress as progress
    from warp._src.distributed.processes import share as share
    from warp._src.distributed.processes import warm as warm
    from warp._src.distributed.reductions import dot as dot
    from warp._src.distributed.reductions import sum as sum
    from warp._src.distributed.solvers import LinearOperator as LinearOperator
    from warp._src.distributed.solvers import Matrix as Matrix
    from warp._src.distributed.solvers import bsr_mv as bsr_mv
    from warp._src.distributed.start import init as init

# The module of each name, imported when the name is first used.
_MODULES = {
    "Blocks": "blocks",
    "Box": "blocks",
    "load": "checkpoints",
    "save": "checkpoints",
    "Communicator": "communicator",
    "Message": "communicator",
    "current": "communicator",
    "DistributedError": "failures",
    "DistributedValueError": "failures",
    "Graph": "graphs",
    "all_gather": "operations",
    "all_reduce": "operations",
    "all_to_all": "operations",
    "barrier": "operations",
    "broadcast": "operations",
    "reduce_scatter": "operations",
    "replicate": "operations",
    "rows_of": "operations",
    "Particles": "particles",
    "Shared": "processes",
    "progress": "processes",
    "share": "processes",
    "warm": "processes",
    "dot": "reductions",
    "sum": "reductions",
    "LinearOperator": "solvers",
    "Matrix": "solvers",
    "bsr_mv": "solvers",
    "init": "start",
}


def __getattr__(name):
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    import importlib

    found = importlib.import_module(f"warp._src.distributed.{_MODULES[name]}")
    globals()[name] = getattr(found, name)
    return globals()[name]


def __dir__():
    return sorted({*globals(), *_MODULES})


@contextlib.contextmanager
def _needing(package, name):
    """A block whose import of a package that is absent is an error with the command to run."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != package:
            raise
        from warp._src import errors

        raise errors.absent(package, f"`{name}`") from None


def mpi(comm=None, device=None, timeout=300):
    """The ranks of an mpi4py communicator, by default all."""
    with _needing("mpi4py", "wd.mpi"):
        from warp._src.distributed.mpi import MpiCommunicator

    return MpiCommunicator(comm, device, timeout)


def torch(group=None, device=None, timeout=300):
    """The ranks of a process group of PyTorch, by default all."""
    with _needing("torch", "wd.torch"):
        from warp._src.distributed.torch import TorchCommunicator

    return TorchCommunicator(group, device, timeout)


def nccl(comm=None, device=None, timeout=None):
    """NCCL between the ranks of another communicator, by default that of `init` and its limit."""
    from warp._src.distributed.nccl import NcclCommunicator

    return NcclCommunicator(comm, device, timeout)
