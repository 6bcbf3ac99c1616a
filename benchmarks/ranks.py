"""Ranks: halos against the bare engine, and many cold processes against one.

    mpirun -n 2 python benchmarks/ranks.py     # halos by MPI, in turn with persistent requests
    python benchmarks/ranks.py [--processes 8]  # CPU seconds of first launches, cold and warm

Halos: microseconds (10th percentile) of an exchange of one row each way, and the ratio to
`Startall` and `Waitall` over the same memory; on a tape, and the adjoint's ratio to that.
Processes: twelve kernels of modules of their own.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = ROOT / "test" / "python" / "support" / "ranks" / "twelve_kernels.py"


def halos():
    """Prints a line for each size."""
    from mpi4py import MPI

    import warp as wp
    import warp.distributed as wd

    wp.config.quiet = True
    comm = wd.init()
    world, byte = MPI.COMM_WORLD, MPI.BYTE
    for size in (1 << 10, 1 << 16, 1 << 18, 1 << 20):
        blocks = wd.Blocks((4 * comm.size, size // 4), ranks=(comm.size, 1), corners=False)
        x = blocks.zeros()
        blocks.halo(x)
        rows = x.numpy()[:, 1:-1]
        ghost, own, peer = (0, 1, 0) if comm.rank else (5, 4, 1)
        requests = [
            world.Recv_init([rows[ghost], byte], peer, 7),
            world.Send_init([rows[own], byte], peer, 7),
        ]

        def bare(requests=requests):
            MPI.Prequest.Startall(requests)
            MPI.Request.Waitall(requests)

        def ours(blocks=blocks, x=x):
            blocks.halo(x)

        y = blocks.zeros(requires_grad=True)
        tape = wp.Tape()
        count = 50 if size < 1 << 20 else 10

        def repeated(work, count=count):
            def run():
                for _ in range(count):
                    work()

            return run

        def taped(blocks=blocks, y=y, tape=tape, count=count):
            tape.reset()
            with tape:
                for _ in range(count):
                    blocks.halo(y)

        times: dict = {repeated(bare): [], repeated(ours): [], taped: [], tape.backward: []}
        for _ in range(150):
            for work, found in times.items():
                world.Barrier()
                begin = time.perf_counter()
                work()
                found.append((time.perf_counter() - begin) / count * 1e6)
            # While a tape has records, each write is told of.
            tape.reset()
        a, b, c, d = (float(np.percentile(found, 10)) for found in times.values())
        if comm.rank == 0:
            print(f"halo of {size >> 10:5} KB: {b:6.2f} us, bare {a:6.2f}, {b / a:.2f} times")
            print(f"    on a tape {c:6.2f} us, its adjoint {d:6.2f}, {d / c:.2f} times")


def together(count, cache):
    """CPU seconds of the first launches of so many processes that start at once."""
    at = time.time() + 2.0 + 0.8 * count
    env = {**os.environ, "WARP_CACHE_PATH": cache, "WARP_NUM_THREADS": "1"}
    command = [sys.executable, str(PROGRAM), str(at)]
    children = [
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True) for _ in range(count)
    ]
    return sum(float(child.communicate()[0].split()[0]) for child in children)


def processes(count):
    """Prints cold and warm CPU seconds, and the ratio to one process."""
    for _ in range(3):
        with tempfile.TemporaryDirectory() as folder:
            alone = together(1, f"{folder}/one")
            cold = together(count, f"{folder}/many")
            warm = together(count, f"{folder}/many")
        ratio = f"{cold / alone:.2f} times"
        print(
            f"1 cold {alone:.2f} s, {count} cold {cold:.2f} s, {ratio}, {count} warm {warm:.2f} s"
        )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--processes", type=int, default=8)
    options = parser.parse_args()
    if int(os.environ.get("OMPI_COMM_WORLD_SIZE", 1)) == 2:
        halos()
    else:
        processes(options.processes)


if __name__ == "__main__":
    main()
