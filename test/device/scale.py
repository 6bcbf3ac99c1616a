"""Scaling over the GPUs of one host, or over CPU ranks: times as JSON lines on rank 0.

    mpirun -n 8 python test/device/scale.py [--quick] [--only lattice,cg]
    torchrun --nproc-per-node 8 test/device/scale.py

Cases: messages, lattice Boltzmann (weak and strong, with and without overlap, eager and captured),
conjugate gradients (exact and not, fused and plain, with a checksum of the solution), migration of
discs. On GPUs messages go by NCCL, brought together by the engine that started the ranks.
"""

import argparse
import json
import sys
import time
import zlib
from pathlib import Path

import numpy as np

import warp as wp
import warp.distributed as wd
from warp.optim.linear import cg

sys.path.insert(0, str(Path(__file__).parents[1] / "python" / "support" / "ranks"))


class Scale:
    """The ranks, and how long work takes on them."""

    def __init__(self, quick):
        self.launched = wd.init(timeout=60)
        on_gpu = self.launched.device.is_cuda and self.launched.size > 1
        self.comm = wd.nccl(self.launched) if on_gpu else self.launched
        self.quick = quick

    def say(self, case, **facts):
        if self.comm.rank == 0:
            about = {"case": case, "ranks": self.comm.size, "engine": self.comm.engine}
            print(json.dumps({**about, **facts}), flush=True)

    def seconds(self, work, count):
        """The best of three times of a piece of work, the slowest rank's."""
        best = float("inf")
        for _ in range(3):
            wp.synchronize_device(self.comm.device)
            self.comm.barrier()
            begin = time.perf_counter()
            for _ in range(count):
                work()
            wp.synchronize_device(self.comm.device)
            took = (time.perf_counter() - begin) / count
            best = min(best, max(self.comm.gather_objects(took)))
        return best


def messages(scale):
    """Halos and sums from bytes to megabytes."""
    comm = scale.comm
    for columns in (2, 256, 16384) if scale.quick else (2, 256, 16384, 1 << 20, 1 << 24):
        blocks = wd.Blocks((4 * comm.size, columns), ranks=(comm.size, 1), corners=False, comm=comm)
        x = blocks.zeros()
        count = 20 if scale.quick else 200
        halo = scale.seconds(lambda blocks=blocks, x=x: blocks.halo(x), count)
        y = wp.zeros(columns, dtype=float, device=comm.device)
        total = scale.seconds(lambda y=y: wd.all_reduce(y, comm=comm), count)
        scale.say("messages", bytes=4 * columns, halo_us=halo * 1e6, all_reduce_us=total * 1e6)


def lattice(scale):
    """D3Q19: million updates a second, bytes a face, share that waits."""
    import lattice_checks as lbm

    comm, n = scale.comm, 16 if scale.quick else 256
    for kind, shape in (("weak", (n * comm.size, n, n)), ("strong", (n, n, n))):
        blocks = wd.Blocks(shape, periodic=True, ranks=(comm.size, 1, 1), comm=comm)
        f, g = blocks.zeros(items=19), blocks.zeros(items=19)
        start = np.broadcast_to(lbm.W[:, None, None, None], f.shape)
        f.assign(np.ascontiguousarray(start))

        def run(box, f, g):
            if box.size:
                wp.launch(lbm.stream_collide, box.shape, [f, wp.vec3i(*box.start), 1.6, g])

        def overlapped(f=f, g=g, blocks=blocks, run=run):
            for a, b in ((f, g), (g, f)):
                with blocks.overlap(a, items=lbm.C):
                    run(blocks.interior, a, b)
                for box in blocks.shell:
                    run(box, a, b)

        def serial(f=f, g=g, blocks=blocks, run=run):
            whole = wd.Box(blocks.width, blocks.owned)
            for a, b in ((f, g), (g, f)):
                blocks.halo(a, items=lbm.C)
                run(whole, a, b)

        cells, count = np.prod(shape), 2 if scale.quick else 20
        face = 5 * 4 * shape[1] * shape[2]
        for name, work in (("overlap", overlapped), ("serial", serial)):
            work()
            eager = scale.seconds(work, count) / 2
            with wp.ScopedCapture(device=comm.device) as capture:
                work()
            graph = capture.graph
            captured = scale.seconds(lambda graph=graph: wp.capture_launch(graph), count) / 2
            rates = {"eager_mlups": cells / eager / 1e6, "captured_mlups": cells / captured / 1e6}
            scale.say("lattice", kind=kind, shape=shape, way=name, face_bytes=face, **rates)


def solver(scale):
    """CG on a 5-point operator, rows split: time of an iteration, exact and plain."""
    import solver_checks

    comm = scale.comm
    solver_checks.ROWS = (8 if scale.quick else 1024) * comm.size
    solver_checks.COLUMNS = 16 if scale.quick else 1024
    rows, columns, values, right = solver_checks.poisson()
    graph = wd.Graph(rows, columns, by="rows", comm=comm)
    A = wd.Matrix(graph, rows, columns, values)
    b = wp.array(graph.scatter(right)[graph.first :][: graph.owned], dtype=float)
    for exact, fused in ((False, False), (False, True), (True, False), (True, True)):
        wp.config.deterministic = "run_to_run" if exact else False
        operator = wd.LinearOperator(A)
        done = 20
        x = wp.zeros_like(b)

        def solve(x=x, operator=operator, fused=fused):
            x.zero_()
            cg(operator, b, x, tol=0.0, atol=1e-30, maxiter=20, check_every=20, fused=fused)

        solve()
        took = scale.seconds(solve, 2) / done
        bits = zlib.crc32(b"".join(comm.gather_objects(x.numpy().tobytes())))
        facts = {"exact": exact, "fused": fused, "iteration_us": took * 1e6, "bits": bits}
        scale.say("cg", rows=len(right), **facts)
    wp.config.deterministic = False


def discs(scale):
    """Migration and ghosts of many points."""
    comm, n = scale.comm, 2000 if scale.quick else 1_000_000
    rng = np.random.default_rng(comm.rank)
    x = wp.array(rng.random((n, 3), np.float32), dtype=wp.vec3)
    particles = wd.Particles(((0, 0, 0), (1, 1, 1)), 0.05, comm)
    (x,) = particles.migrate(x)
    step = wp.array(0.02 * rng.standard_normal((len(x), 3)).astype(np.float32), dtype=wp.vec3)
    (moved,) = (wp.map(wp.add, x, step),)

    def work():
        (y,) = particles.migrate(moved)
        particles.ghosts(y)
        particles.halo(y)
        particles.numbers = numbers

    numbers = particles.numbers
    took = scale.seconds(work, 2)
    scale.say("discs", points=n * comm.size, step_ms=took * 1e3)


CASES = {"messages": messages, "lattice": lattice, "cg": solver, "discs": discs}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--quick", action="store_true", help="sizes that CPU ranks take seconds for"
    )
    parser.add_argument("--only", default=",".join(CASES))
    options = parser.parse_args()
    wp.config.quiet = True
    scale = Scale(options.quick)
    for name in options.only.split(","):
        CASES[name](scale)


if __name__ == "__main__":
    main()
