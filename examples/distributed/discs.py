"""Discs that fall and collide, on any number of ranks: migration, ghosts, balance, restart.

    python examples/distributed/discs.py [--count 2000 --steps 400]
    mpirun -n 4 python examples/distributed/discs.py
    mpirun -n 2 python examples/distributed/discs.py --restart build/demo/discs

A run writes its state to a folder at the end; `--restart` goes on from there, on any number of
ranks. The picture colours discs by their rank.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import warp as wp
import warp.distributed as wd

OUTPUT = Path(__file__).resolve().parents[2] / "build" / "demo"
RADIUS = 0.008


@wp.kernel
def advance(
    grid: wp.uint64,
    radius: float,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    dt: float,
    x_out: wp.array[wp.vec3],
    v_out: wp.array[wp.vec3],
):
    i = wp.tid()
    force = wp.vec3(0.0, -2.0, 0.0)
    for j in wp.hash_grid_query(grid, x[i], 2.0 * radius):
        d = x[i] - x[j]
        r = wp.length(d)
        if j != i and r > 0.0 and r < 2.0 * radius:
            force += d / r * (2.0 * radius - r) * 4.0e4 - (v[i] - v[j]) * 8.0
    w = v[i] + force * dt
    p = x[i] + w * dt
    for c in range(2):
        if p[c] < radius:
            p[c] = radius
            w[c] = -0.3 * w[c]
        if p[c] > 1.0 - radius:
            p[c] = 1.0 - radius
            w[c] = -0.3 * w[c]
    x_out[i] = p
    v_out[i] = w


def initial(count, comm):
    """A column of discs at the left, of which each rank makes a part."""
    side = int(np.ceil(np.sqrt(count * 2)))
    index = np.arange(*wd.rows_of(count, comm.rank, comm.size))
    rng = np.random.default_rng(1)
    noise = 0.2 * RADIUS * rng.random((count, 2))[index]
    x = np.zeros((len(index), 3), np.float32)
    x[:, 0] = (index % (side // 2) + 0.5) * 2.05 * RADIUS
    x[:, 1] = (index // (side // 2) + 0.5) * 2.05 * RADIUS
    x[:, :2] += noise
    return x, np.zeros_like(x)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--restart", type=Path)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    first = 0
    if options.restart:
        state = wd.load(options.restart)
        x, v, first = state["x"], state["v"], state["step"]
    else:
        x, v = initial(options.count, comm)
    x, v = wp.array(x, dtype=wp.vec3), wp.array(v, dtype=wp.vec3)
    particles = wd.Particles(((0, 0), (1, 1)), 2.02 * RADIUS)
    cells = int(1 / (2 * RADIUS))
    grid = wp.HashGrid(cells, cells, 1)
    moved = 0
    for step in wd.progress(range(options.steps), desc="discs", disable=None):
        if step % 50 == 0:
            particles.balance(x)
        before = particles.count
        x, v = particles.migrate(x, v)
        moved += abs(particles.count - before) if step else 0
        particles.ghosts(x)
        near, speeds = particles.halo(x, v)
        x, v = (wp.empty(particles.count, dtype=wp.vec3) for _ in range(2))
        if particles.count:
            grid.build(near, 2 * RADIUS)
            wp.launch(advance, particles.count, [grid.id, RADIUS, near, speeds, 5e-4, x, v])
    if comm.rank == 0:
        options.output.mkdir(parents=True, exist_ok=True)
    comm.barrier()
    wd.save(options.output / "discs", x=x, v=v, step=first + options.steps)
    parts = comm.gather_objects(x.numpy())
    if comm.rank:
        return
    figure, axis = plt.subplots(figsize=(6, 6))
    for rank, part in enumerate(parts):
        axis.scatter(part[:, 0], part[:, 1], s=7, label=f"rank {rank}: {len(part)}")
    axis.set(xlim=(0, 1), ylim=(0, 1), aspect="equal", title=f"step {first + options.steps}")
    axis.legend(loc="upper right")
    figure.savefig(options.output / "discs.png", dpi=110, bbox_inches="tight")
    loads = [len(part) for part in parts]
    print(f"{comm.size} rank(s): {sum(loads)} discs, {min(loads)} to {max(loads)} a rank")


if __name__ == "__main__":
    main()
