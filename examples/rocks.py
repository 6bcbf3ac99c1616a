"""Rocks in a NanoVDB file: a picture by rays that walk, particles that run down between them.

    python examples/rocks.py [--device cpu] [--size 96] [--particles 20000] [--steps 400]

Writes the level set of some rocks to build/demo/rocks.nvdb, loads it again, and writes the picture
build/demo/rocks_<device>.png and the surface's triangles, counted in the table.
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
PIXELS, DT, RADIUS = 240, 1.0 / 400.0, 0.01


def rocks(x):
    """Signed distance to seven balls, in a box of edge 2."""
    rng = np.random.default_rng(3)
    centers, sizes = rng.uniform(-0.6, 0.6, (7, 3)), rng.uniform(0.18, 0.4, 7)
    apart = np.linalg.norm(x[..., None, :] - centers, axis=-1)
    return (apart - sizes).min(axis=-1)


@wp.func
def slope(vol: wp.uint64, xyz: wp.vec3):
    """The direction in which the distance grows most."""
    along = wp.vec3()
    uvw = wp.volume_transform_inv(vol, xyz)
    wp.volume_sample_grad_f(vol, uvw, wp.Volume.LINEAR, along)
    return wp.normalize(wp.volume_index_to_world_dir(vol, along))


@wp.kernel
def trace(vol: wp.uint64, shade: wp.array2d[float]):
    i, j = wp.tid()
    n = float(shade.shape[0])
    dir = wp.normalize(wp.vec3((float(j) - n / 2.0) / n, 1.0, (n / 2.0 - float(i)) / n))
    x = wp.vec3(0.0, -2.4, 0.0)
    shade[i, j] = 0.0
    for _ in range(160):
        distance = wp.volume_sample_world(vol, x, wp.Volume.LINEAR)
        if distance < 1.0e-3:
            lit = wp.dot(slope(vol, x), wp.normalize(wp.vec3(1.0, -1.0, 1.5)))
            shade[i, j] = 0.2 + 0.8 * wp.max(lit, 0.0)
            break
        x += dir * wp.min(distance, 0.1)
        if x[1] > 1.2:
            break


@wp.kernel
def run(
    vol: wp.uint64,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    hits: wp.array[int],
    radius: float,
    dt: float,
):
    i = wp.tid()
    speed = v[i] + wp.vec3(0.0, 0.0, -9.81) * dt
    p = x[i] + speed * dt
    distance = wp.volume_sample_world(vol, p, wp.Volume.LINEAR)
    if distance < radius:
        n = slope(vol, p)
        p += n * (radius - distance)
        approach = wp.dot(speed, n)
        if approach < 0.0:
            speed -= 1.3 * approach * n
            wp.atomic_add(hits, 0, 1)
    x[i] = p
    v[i] = speed


def write_file(path, size):
    """The rocks as a file; gives also the grid's values."""
    axis = np.linspace(-1.0, 1.0, size)
    values = rocks(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1))
    values = values.astype(np.float32)
    volume = wp.Volume.load_from_numpy(
        values, min_world=(-1.0, -1.0, -1.0), voxel_size=2.0 / (size - 1), bg_value=0.1
    )
    volume.save_to_nvdb(path, codec="zip")
    return values


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default=None)
    parser.add_argument("--size", type=int, default=96)
    parser.add_argument("--particles", type=int, default=20000)
    parser.add_argument("--steps", type=int, default=400)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    given = parser.parse_args()
    device = wp.get_device(given.device)
    given.output.mkdir(parents=True, exist_ok=True)
    values = write_file(given.output / "rocks.nvdb", given.size)
    with open(given.output / "rocks.nvdb", "rb") as file:
        volume = wp.Volume.load_from_nvdb(file, device=device)
    shade = wp.zeros((PIXELS, PIXELS), dtype=float, device=device)
    wp.launch(trace, shade.shape, inputs=[volume.id, shade], device=device)
    rng = np.random.default_rng(0)
    start = rng.uniform((-0.8, -0.8, 0.9), (0.8, 0.8, 1.6), (given.particles, 3))
    start = start[rocks(start) > 0.05]
    x = wp.array(start, dtype=wp.vec3, device=device)
    v = wp.zeros(len(start), dtype=wp.vec3, device=device)
    hits = wp.zeros(1, dtype=int, device=device)
    began = time.perf_counter()
    worst = 0.0
    for turn in tqdm(range(given.steps), desc="run"):
        inputs = [volume.id, x, v, hits, RADIUS, DT]
        wp.launch(run, len(start), inputs=inputs, device=device)
        if turn % 20 == 0:
            worst = max(worst, float(-rocks(x.numpy().astype(np.float64)).min()))
    wp.synchronize_device(device)
    rate = len(start) * given.steps / (time.perf_counter() - began) / 1e6
    nx, ny, nz = values.shape
    surface = wp.MarchingCubes(nx, ny, nz, lower=(-1.0, -1.0, -1.0), upper=(1.0, 1.0, 1.0))
    surface.surface(wp.array(values, dtype=float, device=device), 0.0)
    off = np.abs(rocks(surface.verts.numpy().astype(np.float64))).max()
    print("| voxels | contacts | deepest, m | queries, M/s | triangles | off the rocks, m |")
    print("| --- | --- | --- | --- | --- | --- |")
    print(
        f"| {values.size} | {hits.numpy()[0]} | {worst:.4f} | {rate:.2f} | "
        f"{len(surface.indices) // 3} | {off:.5f} |"
    )
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 5))
    left.imshow(shade.numpy(), cmap="gray")
    end = x.numpy()
    right.scatter(end[:, 0], end[:, 2], s=1)
    right.set(xlim=(-1.2, 1.2), ylim=(-3, 1.6), title="particles")
    left.set(title="rays through the volume")
    figure.savefig(given.output / f"rocks_{device.alias.replace(':', '')}.png", dpi=120)


if __name__ == "__main__":
    main()
