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
SLOW = ("hang", "skip", "order", "gather")
checking.LIMIT = 4 if how == "stall" else 20 if way else 3 if how in SLOW else 15
comm = checking.joined(way)
blocks = wd.Blocks((8 * comm.size,), ranks=(comm.size,))
x, y = blocks.zeros(), wp.zeros(1, dtype=float)
if way:
    blocks.halo(x)
    wd.all_reduce(y)
    comm.barrier()
    comm.timeout = 2.0
graph = None
if how.startswith("replay"):
    with wp.ScopedCapture(device=comm.device) as capture:
        blocks.halo(x)
        wd.all_reduce(y)
    graph = capture.graph
for step in range(1 if way else 0, 5):
    if step == 3 and comm.rank == 1:
        print(f"fails at {time.time()}", flush=True)
        if how == "raise":
            raise ValueError("broken")
        if how in ("kill", "replay-kill"):
            os.kill(os.getpid(), signal.SIGKILL)
        if how in ("hang", "gather", "replay"):
            time.sleep(60)
        if how == "interrupt":
            os.kill(os.getpid(), signal.SIGINT)
        if how == "twice":
            for _ in wd.progress(range(1000), disable=True):
                # The second time ends all ranks at once.
                os.kill(os.getpid(), signal.SIGINT)
        if how == "leave":
            sys.exit(0)
        if how == "exit":
            sys.exit(3)
        if how == "order":
            wd.all_reduce(y)
        if how == "memory":
            wp.empty((1 << 30, 1 << 12), dtype=wp.float64)
    if step == 3 and how == "gather":
        comm.gather_objects(step)
    if graph is not None:
        wp.capture_launch(graph)
        y.numpy()
        continue
    blocks.halo(x)
    x.numpy()
    if how != "skip" or step != 3 or comm.rank == 0:
        wd.all_reduce(y)
        y.numpy()
print(f"rank {comm.rank} went on", np.pi)
