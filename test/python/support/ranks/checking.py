"""Runs the checks of a program on all ranks; rank 0 prints what each found as JSON."""

import datetime
import faulthandler
import json
import os
import sys
import traceback
import zlib

import numpy as np

import warp as wp
import warp.distributed as wd
from warp._src.distributed import communicator

wp.config.quiet = True
# Seconds that a rank waits for another.
LIMIT = int(os.environ.get("WARP_RANKS_LIMIT", 60))


def digest(values):
    """A number for the bits of an array."""
    return zlib.crc32(np.ascontiguousarray(values).tobytes())


def fails(function, *words):
    """The message of the one-line error that a function raises; it has all words."""
    try:
        function()
    except Exception as problem:
        text = str(problem)
        assert "\n" not in text.strip(), text
        for word in words:
            assert word in text, (word, text)
        return text
    raise AssertionError(f"no error with {words}")


def joined(way):
    """The communicator of a run: of what started the ranks, or on GPUs as `way` says.

    `nccl` is NCCL itself, `torch-nccl` that of PyTorch; `gloo` takes arrays of GPUs through the
    host.
    """
    if way == "gloo":
        import torch.distributed

        torch.distributed.init_process_group("gloo", timeout=datetime.timedelta(seconds=LIMIT))
        local = int(os.environ["LOCAL_RANK"]) % wp.get_cuda_device_count()
        return wd.init(timeout=LIMIT, device=f"cuda:{local}")
    comm = wd.init(timeout=LIMIT)
    if way == "nccl":
        comm = wd.nccl(comm)
        communicator.set_current(comm)
    return comm


def run(checks):
    """Calls `check(comm)` for each; a result of None is one that only had to pass.

    Arguments: `--way=nccl` and the like, `--skip=a,b` leaves checks out. With `--sizes=4,2` as many
    of the ranks do them, size after size, and names are `4:a`. A check that takes longer than the
    limit ends the process with the stacks of all threads.
    """
    options = dict(one[2:].split("=") for one in sys.argv[1:] if one.startswith("--"))
    skipped = options.get("skip", "").split(",")
    faulthandler.dump_traceback_later(2 * LIMIT, exit=True)
    world = joined(options.get("way"))
    if "sizes" not in options:
        _check_all(world, checks, skipped)
        world.barrier()
    for size in map(int, filter(None, options.get("sizes", "").split(","))):
        part = world.split(int(world.rank >= size))
        if world.rank < size:
            communicator.set_current(part)
            _check_all(part, checks, skipped, f"{size}:")
        faulthandler.cancel_dump_traceback_later()
        # The others wait for all checks.
        world.timeout = 100.0 * LIMIT
        world.barrier()
        part.close()
    faulthandler.cancel_dump_traceback_later()


def _check_all(comm, checks, skipped, prefix=""):
    """Calls the checks; rank 0 prints their names, with a prefix, and results."""
    for check in checks:
        name = prefix + check.__name__
        if name in skipped:
            continue
        if comm.rank == 0:
            print(json.dumps({"begins": name}), flush=True)
        faulthandler.dump_traceback_later(2 * LIMIT, exit=True)
        try:
            found = check(comm)
        except Exception:
            found = {"error": traceback.format_exc()[-1500:]}
        errors = comm.gather_objects(
            found if isinstance(found, dict) and "error" in found else None
        )
        errors = [one for one in errors if one]
        if comm.rank == 0:
            print(json.dumps({name: errors[0] if errors else found}), flush=True)
        if errors and comm.size > 1:
            # Ranks may no longer agree on what comes next.
            comm.barrier()
            os._exit(3)
