"""A column of sticky grains collapses: forces between neighbours that a hash grid finds.

    python examples/grains.py [--device cpu] [--grains 100000] [--steps 200]

Prints how many steps a second are computed; writes build/demo/grains_<device>.png.
"""

import argparse
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import warp as wp

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# [m], [s]; stiffness and damping per mass.
RADIUS, DT = 0.1, 1.0 / 1200.0
STIFFNESS, DAMPING, FRICTION, COHESION = 8.0e4, 60.0, 0.6, 0.02


@wp.func
def contact_force(n: wp.vec3, v: wp.vec3, gap: float):
    """The force of a contact with normal n, relative speed v and gap, negative if pressed."""
    normal = wp.dot(n, v)
    pressure = gap * STIFFNESS + wp.min(normal, 0.0) * DAMPING
    slide = v - n * normal
    speed = wp.length(slide)
    grip = wp.min(speed * DAMPING, FRICTION * wp.abs(pressure)) / wp.max(speed, 1.0e-6)
    return -n * pressure - slide * grip


@wp.kernel
def forces(
    grid: wp.uint64,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    f: wp.array[wp.vec3],
    radius: float,
):
    # Neighbours in the grid are neighbours in memory and in time.
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = x[i]
    total = wp.vec3(0.0, 0.0, -9.81)
    floor = p[2] - radius
    if floor < COHESION * radius:
        total += contact_force(wp.vec3(0.0, 0.0, 1.0), v[i], floor)
    query = wp.hash_grid_query(grid, p, radius * 2.0 * (1.0 + COHESION))
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i:
            apart = p - x[j]
            distance = wp.length(apart)
            gap = distance - 2.0 * radius
            if gap <= COHESION * radius and distance > 0.0:
                total += contact_force(apart / distance, v[i] - v[j], gap)
    f[i] = total


@wp.kernel
def move(x: wp.array[wp.vec3], v: wp.array[wp.vec3], f: wp.array[wp.vec3], dt: float):
    i = wp.tid()
    v[i] = v[i] + f[i] * dt
    x[i] = x[i] + v[i] * dt


def column(count):
    """Grains side by side, half as wide as high, slightly off their places."""
    side = max(1, round((count / 2) ** (1 / 3)))
    n = np.arange(count)
    places = np.stack([n % side, n // side % side, n // side**2], axis=1).astype(np.float64)
    places += np.random.default_rng(0).uniform(-0.02, 0.02, places.shape)
    return 2.02 * RADIUS * (places + [0, 0, 0.52])


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default=None)
    parser.add_argument("--grains", type=int, default=100000)
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    given = parser.parse_args()
    device = wp.get_device(given.device)
    x = wp.array(column(given.grains), dtype=wp.vec3, device=device)
    v, f = (wp.zeros(given.grains, dtype=wp.vec3, device=device) for _ in range(2))
    grid = wp.HashGrid(dim_x=128, dim_y=128, dim_z=128, device=device)

    def advance():
        grid.build(points=x, radius=2.0 * RADIUS * (1.0 + COHESION))
        wp.launch(forces, given.grains, inputs=[grid.id, x, v, f, RADIUS], device=device)
        wp.launch(move, given.grains, inputs=[x, v, f, DT], device=device)

    advance()
    wp.synchronize_device(device)
    began = time.perf_counter()
    for _ in tqdm(range(given.steps), desc="fall"):
        advance()
    wp.synchronize_device(device)
    rate = given.steps / (time.perf_counter() - began)
    end = x.numpy()
    lost = int((~np.isfinite(end).all(axis=1) | (end[:, 2] < 0.0)).sum())
    print("| grains | steps per second | below the floor |")
    print("| --- | --- | --- |")
    print(f"| {given.grains} | {rate:.1f} | {lost} |")
    figure, axes = plt.subplots(figsize=(6, 6))
    front = end[np.argsort(-end[:, 1])]
    axes.scatter(front[:, 0], front[:, 2], s=2, c=front[:, 1], cmap="copper")
    axes.set(aspect="equal", title=f"{given.grains} grains, {rate:.0f} steps per second")
    given.output.mkdir(parents=True, exist_ok=True)
    figure.savefig(given.output / f"grains_{device.alias.replace(':', '')}.png", dpi=120)


if __name__ == "__main__":
    main()
