"""Particles rain on a ring of triangles, bounce off it and slide down; none may get inside.

    python examples/mesh_collision.py [--device cpu] [--particles 20000] [--steps 600]

The closest point of the mesh decides a contact, asked for in the first form of that query.
Writes build/demo/mesh_collision_<device>.png.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from tqdm import tqdm

import warp as wp

OUTPUT = Path(__file__).resolve().parent.parent / "build" / "demo"
# [m], [s]
RING, TUBE, DT = 1.0, 0.4, 1.0 / 600.0
RADIUS = 0.02


@wp.kernel
def step(
    mesh: wp.uint64,
    positions: wp.array[wp.vec3],
    velocities: wp.array[wp.vec3],
    hits: wp.array[int],
    radius: float,
    dt: float,
):
    tid = wp.tid()
    v = velocities[tid] + wp.vec3(0.0, 0.0, -9.81) * dt
    x = positions[tid] + v * dt
    sign = float(0.0)
    face_index = int(0)
    face_u = float(0.0)
    face_v = float(0.0)
    max_dist = 0.2
    if wp.mesh_query_point(mesh, x, max_dist, sign, face_index, face_u, face_v):
        p = wp.mesh_eval_position(mesh, face_index, face_u, face_v)
        distance = sign * wp.length(x - p)
        if distance < radius:
            n = wp.mesh_eval_face_normal(mesh, face_index)
            x = p + n * radius
            approach = wp.dot(v, n)
            if approach < 0.0:
                # Half of the speed comes back; sliding loses a tenth of the push.
                slide = v - approach * n
                speed = wp.length(slide)
                grip = wp.min(0.1 * (1.0 - approach) * 0.1, speed) / wp.max(speed, 1.0e-6)
                v = slide * (1.0 - grip) - 0.5 * approach * n
                wp.atomic_add(hits, 0, 1)
    positions[tid] = x
    velocities[tid] = v


def ring(n=96, m=48):
    """Vertices and faces of a torus around z."""
    i, j = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    a, b = 2 * np.pi * i / n, 2 * np.pi * j / m
    across = RING + TUBE * np.cos(b)
    points = np.stack([across * np.cos(a), across * np.sin(a), TUBE * np.sin(b)], axis=1)

    def at(i, j):
        return i % n * m + j % m

    first = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], axis=1)
    second = np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], axis=1)
    return points.astype(np.float32), np.concatenate([first, second]).astype(np.int32)


def depth_inside(x):
    """How far points are inside of the smooth torus, whose triangles lie within it."""
    across = np.hypot(x[:, 0], x[:, 1]) - RING
    return TUBE - np.hypot(across, x[:, 2])


def main():
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--device", default=None)
    parser.add_argument("--particles", type=int, default=20000)
    parser.add_argument("--steps", type=int, default=600)
    parser.add_argument("--output", type=Path, default=OUTPUT)
    given = parser.parse_args()
    device = wp.get_device(given.device)
    points, faces = ring()
    mesh = wp.Mesh(
        wp.array(points, dtype=wp.vec3, device=device),
        wp.array(faces.ravel(), dtype=int, device=device),
    )
    rng = np.random.default_rng(0)
    start = rng.uniform((-1.5, -1.5, 0.6), (1.5, 1.5, 1.6), (given.particles, 3))
    x = wp.array(start, dtype=wp.vec3, device=device)
    v = wp.zeros(given.particles, dtype=wp.vec3, device=device)
    hits = wp.zeros(1, dtype=int, device=device)
    inputs = [mesh.id, x, v, hits, RADIUS, DT]
    wp.launch(step, 0, inputs=inputs, device=device)
    began = time.perf_counter()
    for _ in tqdm(range(given.steps), desc="rain"):
        wp.launch(step, given.particles, inputs=inputs, device=device)
    end = x.numpy()
    took = time.perf_counter() - began
    # Triangles of this ring are at most 2.2 mm below the smooth surface.
    leaks = int((depth_inside(end) > 0.003).sum())
    print("| particles | steps | contacts | leaks | queries, M/s |")
    print("| --- | --- | --- | --- | --- |")
    rate = given.particles * given.steps / took / 1e6
    print(f"| {given.particles} | {given.steps} | {hits.numpy()[0]} | {leaks} | {rate:.2f} |")
    figure = plt.figure(figsize=(7, 5))
    axes: Any = figure.add_subplot(projection="3d")
    axes.plot_trisurf(*points.T, triangles=faces, color="#8899aa", alpha=0.4)
    some = end[np.abs(end[:, 2]) < 3][:4000]
    axes.scatter(*some.T, s=1, c=some[:, 2], cmap="plasma")
    axes.set(zlim=(-1.5, 1.5), title="particles and a ring of triangles")
    given.output.mkdir(parents=True, exist_ok=True)
    name = f"mesh_collision_{device.alias.replace(':', '')}.png"
    figure.savefig(given.output / name, dpi=120)


if __name__ == "__main__":
    main()
