"""A column of water that collapses, by smoothed particles on any number of ranks.

    python examples/distributed/flood.py [--across 30]
    mpirun -n 4 python examples/distributed/flood.py

Weakly compressible SPH with dynamic boundary particles (Crespo et al., 2007) and the density
diffusion of Molteni and Colagrossi (2009). A column of width a and height 2a is released; the
position of its front is compared with the experiment of Martin and Moyce (1952). The picture
colours particles by their rank.
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
# The column's width, gravity and the density of water are 1; speed of sound is ten times that of
# a fall from the top.
SOUND = 10.0 * np.sqrt(2.0 * 2.0)
TANK = 5.0
# Front of the column, in its widths, at times t sqrt(2 g / a) (Martin and Moyce, table 2, n^2 = 2).
TIMES = [0.41, 0.84, 1.19, 1.43, 1.63, 1.83, 1.98, 2.20, 2.32, 2.51, 2.65, 2.83, 2.98, 3.11]
FRONTS = [1.11, 1.22, 1.44, 1.67, 1.89, 2.11, 2.33, 2.56, 2.78, 3.00, 3.22, 3.44, 3.67, 3.89]


@wp.struct
class Fluid:
    h: float
    mass: float
    sound: float
    dt: float


@wp.func
def slope(d: wp.vec3, r: float, h: float) -> wp.vec3:
    """Gradient of Wendland's kernel C2 in the plane, of support 2 h."""
    s = 1.0 - 0.5 * r / h
    return d * (-8.75 / (wp.pi * h * h * h * h) * s * s * s)


@wp.kernel
def accelerate(
    grid: wp.uint64,
    fluid: Fluid,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    density: wp.array[float],
    is_wall: wp.array[int],
    v_out: wp.array[wp.vec3],
):
    i = wp.tid()
    if is_wall[i] == 1:
        v_out[i] = v[i]
        return
    h = fluid.h
    rho = density[i]
    pressure = fluid.sound * fluid.sound * (rho - 1.0) / (rho * rho)
    force = wp.vec3(0.0, -1.0, 0.0)
    for j in wp.hash_grid_query(grid, x[i], 2.0 * h):
        d = x[i] - x[j]
        r = wp.length(d)
        if r > 0.0 and r < 2.0 * h:
            other = density[j]
            closing = wp.min(wp.dot(v[i] - v[j], d), 0.0)
            viscous = 0.04 * fluid.sound * h * closing / ((r * r + 0.01 * h * h) * (rho + other))
            shared = fluid.sound * fluid.sound * (other - 1.0) / (other * other)
            force -= fluid.mass * (pressure + shared - viscous) * slope(d, r, h)
    v_out[i] = v[i] + force * fluid.dt


@wp.kernel
def move(
    grid: wp.uint64,
    fluid: Fluid,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    density: wp.array[float],
    is_wall: wp.array[int],
    x_out: wp.array[wp.vec3],
    density_out: wp.array[float],
):
    i = wp.tid()
    h = fluid.h
    rho = density[i]
    rate = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], 2.0 * h):
        d = x[i] - x[j]
        r = wp.length(d)
        if r > 0.0 and r < 2.0 * h:
            other = density[j]
            along = slope(d, r, h)
            rate += fluid.mass * rho / other * wp.dot(v[i] - v[j], along)
            if is_wall[i] == 0 and is_wall[j] == 0:
                spread = 0.2 * h * fluid.sound * fluid.mass / other * (rho - other)
                rate += spread * wp.dot(d, along) / (r * r)
    new = rho + rate * fluid.dt
    if is_wall[i] == 1:
        # Walls push and do not pull.
        new = wp.max(new, 1.0)
    density_out[i] = new
    x_out[i] = x[i] + v[i] * fluid.dt


def initial(across, comm):
    """This rank's part of the water and of two layers of wall."""
    dx = 1.0 / across
    side = (np.arange(across) + 0.5) * dx
    water = np.stack(np.meshgrid(side, np.r_[side, side + 1.0], indexing="ij"), -1).reshape(-1, 2)
    below = np.arange(-1.5, TANK * across + 2) * dx
    up = np.arange(0.5, 3.0 * across) * dx
    floor = [np.stack([below, np.full_like(below, -(k + 0.5) * dx)], -1) for k in range(2)]
    sides = [
        np.stack([np.full_like(up, place), up], -1)
        for k in range(2)
        for place in (-(k + 0.5) * dx, TANK + (k + 0.5) * dx)
    ]
    places = np.concatenate([water, *floor, *sides])
    own = slice(*wd.rows_of(len(places), comm.rank, comm.size))
    x = np.zeros((len(places), 3), np.float32)
    x[:, :2] = places
    density = np.ones(len(places), np.float32)
    # Water at rest under its own weight.
    density[: len(water)] += (2.0 - water[:, 1]) / SOUND**2
    is_wall = np.arange(len(places)) >= len(water)
    return x[own], density[own], is_wall[own].astype(np.int32), dx


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--across", type=int, default=30, help="particles across the column")
    parser.add_argument("--output", type=Path, default=OUTPUT)
    options = parser.parse_args()
    comm = wd.init()
    places, density, is_wall, dx = initial(options.across, comm)
    fluid = Fluid()
    fluid.h, fluid.mass, fluid.sound = 1.4 * dx, dx * dx, SOUND
    fluid.dt = 0.25 * fluid.h / SOUND
    x = wp.array(places, dtype=wp.vec3)
    v = wp.zeros_like(x)
    density, is_wall = wp.array(density, dtype=float), wp.array(is_wall, dtype=int)
    particles = wd.Particles(((-2 * dx, -2 * dx), (TANK + 2 * dx, 3.0)), 2.02 * fluid.h)
    grid = wp.HashGrid(256, 256, 1)
    fronts = []
    for step in wd.progress(range(int(TIMES[-1] / np.sqrt(2.0) / fluid.dt)), desc="flood"):
        if step % 100 == 0:
            particles.balance(x)
            mine = x.numpy()[is_wall.numpy() == 0, 0]
            far = comm.gather_objects(float(mine.max(initial=0.0)))
            fronts.append((step * fluid.dt * np.sqrt(2.0), max(far) + dx / 2))
        x, v, density, is_wall = particles.migrate(x, v, density, is_wall)
        particles.ghosts(x)
        count = particles.count
        near = particles.halo(x, v, density, is_wall)
        x, v = (wp.empty(count, dtype=wp.vec3) for _ in range(2))
        density = wp.empty(count, dtype=float)
        grid.build(near[0], 2 * fluid.h)
        wp.launch(accelerate, count, [grid.id, fluid, *near], [v])
        # Densities change by the new velocities, of ghosts as well.
        near[1] = particles.halo(v)
        wp.launch(move, count, [grid.id, fluid, *near], [x, density])
    parts = comm.gather_objects((x.numpy(), is_wall.numpy(), density.numpy()))
    if comm.rank:
        return
    options.output.mkdir(parents=True, exist_ok=True)
    water = [part[0][part[1] == 0] for part in parts]
    spread = max(np.abs(part[2][part[1] == 0] - 1.0).max(initial=0.0) for part in parts)
    times, reached = np.array(fronts).T
    error = np.abs(np.interp(times, TIMES, FRONTS) - reached)[times > 1.0].max()
    figure, (scene, graph) = plt.subplots(2, figsize=(8, 7), height_ratios=(3, 2))
    for rank, part in enumerate(water):
        scene.scatter(part[:, 0], part[:, 1], s=4, label=f"rank {rank}: {len(part)}")
    scene.set(xlim=(0, TANK), ylim=(0, 2), aspect="equal")
    scene.legend(loc="upper right")
    graph.plot(times, reached, label="front")
    graph.plot(TIMES, FRONTS, "o", label="Martin and Moyce")
    graph.set(xlabel="t sqrt(2 g / a)", ylabel="front / a")
    graph.legend()
    figure.savefig(options.output / "flood.png", dpi=110, bbox_inches="tight")
    print(
        f"{comm.size} rank(s): {sum(map(len, water))} particles, front within {error:.2f} a of the "
        f"experiment, density within {100 * spread:.1f} %"
    )


if __name__ == "__main__":
    main()
