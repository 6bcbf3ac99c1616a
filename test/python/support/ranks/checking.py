"""Runs the checks of a program on all ranks; rank 0 prints what each found as JSON."""

import json
import sys
import traceback
import zlib

import numpy as np

import warp as wp
import warp.distributed as wd

wp.config.quiet = True


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


def run(checks):
    """Calls `check(comm)` for each; a result of None is one that only had to pass.

    With `nccl` on the command line messages go by NCCL, whatever engine started the ranks.
    """
    comm = wd.init(timeout=60)
    if "nccl" in sys.argv[1:]:
        comm = wd.nccl(comm)
    for check in checks:
        try:
            found = check(comm)
        except Exception:
            found = {"error": traceback.format_exc()[-1500:]}
        errors = comm.gather_objects(
            found if isinstance(found, dict) and "error" in found else None
        )
        errors = [one for one in errors if one]
        if comm.rank == 0:
            print(json.dumps({check.__name__: errors[0] if errors else found}), flush=True)
        if errors and comm.size > 1:
            # Ranks may no longer agree on what comes next.
            break
    comm.barrier()
