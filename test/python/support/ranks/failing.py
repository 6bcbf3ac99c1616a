"""A program one of whose ranks fails in the way that its argument says."""

import os
import signal
import sys
import time

import numpy as np

import warp as wp
import warp.distributed as wd

wp.config.quiet = True
how = sys.argv[1]
comm = wd.init(timeout=1.5 if how == "hang" else 15)
blocks = wd.Blocks((8 * comm.size,), ranks=(comm.size,))
x = blocks.zeros()
for step in range(5):
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
print(f"rank {comm.rank} went on", np.pi)
