"""Scaling over the GPUs of one host, or over CPU ranks: times as JSON lines on rank 0.

    mpirun -n 8 python test/device/scale.py [--quick] [--only lattice,cg]
    torchrun --nproc-per-node 8 test/device/scale.py

Cases: messages (beside the engine alone, eager and captured), lattice Boltzmann (weak and strong,
with and without overlap, eager and captured), conjugate gradients (exact and not, fused and plain,
with a checksum of the solution), worlds (rollouts whose gradient is summed over ranks), migration
of discs. On GPUs messages go by NCCL, brought together by the engine that started the ranks.
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


STATE = wp.types.vector(4, float)
STEPS = 256


@wp.kernel
def roll_out(gains: wp.array[wp.mat44], start: wp.array[STATE], cost: wp.array[float]):
    """The mean distance of a linear system from the origin; gains are those of each step."""
    i = wp.tid()
    x = start[i]
    total = float(0.0)
    for step in range(gains.shape[0]):
        x = x + 0.05 * (gains[step] * x)
        total += 0.05 * wp.dot(x, x)
    cost[i] = total


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
    """Halos and sums from bytes to megabytes, and the same by the engine alone, also in graphs."""
    comm = scale.comm
    for columns in (2, 256, 16384) if scale.quick else (2, 256, 16384, 1 << 20, 1 << 24):
        blocks = wd.Blocks((4 * comm.size, columns), ranks=(comm.size, 1), corners=False, comm=comm)
        x, y = blocks.zeros(), wp.zeros(columns, dtype=float, device=comm.device)
        # Rows are in one piece, so that the engine sends what `halo` sends.
        sides = blocks._exchange("halo", (x,), None).sides
        bare = [
            wd.Message(one.peer, one.give[0], one.take[0], one.give_tag, one.take_tag)
            for one in sides
        ]
        works = {
            "halo": lambda blocks=blocks, x=x: blocks.halo(x),
            "all_reduce": lambda y=y: wd.all_reduce(y, comm=comm),
        }
        if comm.size > 1:
            engine = comm.persistent(bare)

            def alone(engine=engine):
                engine.start()
                engine.finish()

            # On a GPU the engine's own order is the stream's.
            queued = comm.device.is_cuda
            works["bare_halo"] = (lambda bare=bare: comm.exchange(bare)) if queued else alone
            works["bare_all_reduce"] = lambda y=y: comm.all_reduce(y)
        count = 20 if scale.quick else 100 if columns < 1 << 24 else 20
        facts = {}
        for name, work in works.items():
            work()
            facts[f"{name}_us"] = scale.seconds(work, count) * 1e6
            if comm.device.is_cuda:
                with wp.ScopedCapture(device=comm.device) as capture:
                    for _ in range(20):
                        work()
                replay = scale.seconds(lambda graph=capture.graph: wp.capture_launch(graph), 3)
                facts[f"{name}_graph_us"] = replay / 20 * 1e6
        scale.say("messages", bytes=4 * columns, **facts)


def lattice(scale):
    """D3Q19: million updates a second, bytes a face, share that waits."""
    import lattice_checks as lbm

    comm, n = scale.comm, 16 if scale.quick else 256
    for kind, shape in (("weak", (n * comm.size, n, n)), ("strong", (n, n, n))):
        blocks = wd.Blocks(shape, periodic=True, ranks=(comm.size, 1, 1), comm=comm)
        f, g = blocks.zeros(items=19), blocks.zeros(items=19)
        for number, weight in enumerate(lbm.W):
            f[number].fill_(float(weight))

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


def worlds(scale):
    """Rollouts of worlds of each rank; the gradient of common parameters is summed over ranks."""
    comm, count = scale.comm, 64 if scale.quick else 1 << 17
    rng = np.random.default_rng(comm.rank)
    gains = 0.1 * np.random.default_rng(7).standard_normal((STEPS, 4, 4)) - np.eye(4)
    gains = wp.array(gains.astype(np.float32), dtype=wp.mat44, requires_grad=True)
    start = wp.array(rng.standard_normal((count, 4)).astype(np.float32), dtype=STATE)
    cost = wp.zeros(count, dtype=float, requires_grad=True)

    def step():
        with wp.Tape() as tape:
            wp.launch(roll_out, count, [wd.replicate(gains, comm=comm), start, cost])
        gains.grad.zero_()
        cost.grad.fill_(1.0 / (count * comm.size))
        tape.backward()

    step()
    eager = scale.seconds(step, 2)
    with wp.ScopedCapture(device=comm.device) as capture:
        step()
    captured = scale.seconds(lambda: wp.capture_launch(capture.graph), 2)
    facts = {"eager_ms": eager * 1e3, "captured_ms": captured * 1e3}
    scale.say("worlds", worlds=count * comm.size, parameters=16 * STEPS, **facts)


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


CASES = {
    **{"messages": messages, "lattice": lattice, "cg": solver},
    **{"worlds": worlds, "discs": discs},
}


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
