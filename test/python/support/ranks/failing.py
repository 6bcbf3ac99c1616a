"""A program one of whose ranks fails in the way that its argument says."""

import os
import signal
import sys
import time

import checking
import numpy as np

import warp as wp
import warp.distributed as wd

wp.config.quiet = True
how = sys.argv[1]
way = next((one[6:] for one in sys.argv if one.startswith("--way=")), None)
# NCCL takes seconds to start.
checking.LIMIT = 20 if way else 1.5 if how == "hang" else 15
comm = checking.joined(way)
blocks = wd.Blocks((8 * comm.size,), ranks=(comm.size,))
x = blocks.zeros()
if way:
    blocks.halo(x)
    comm.barrier()
    comm.timeout = 2.0
for step in range(1 if way else 0, 5):
    if step == 3 and comm.rank == 1:
        print(f"fails at {time.time()}", flush=True)
        if how == "raise":
            raise ValueError("broken")
        if how == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if how == "hang":
            time.sleep(60)
        if how == "memory":
            wp.empty((1 << 30, 1 << 12), dtype=wp.float64)
    blocks.halo(x)
    x.numpy()
print(f"rank {comm.rank} went on", np.pi)
