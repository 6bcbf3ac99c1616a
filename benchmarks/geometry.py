"""Rates of geometry: builds, refits, closest points, rays, neighbours, samples of volumes.

    python benchmarks/geometry.py [--device cpu|cuda:0] [--peer PYTHON]

Runs in this process on what `import warp` finds; with --peer once more in that interpreter, and
prints the ratios. Rates are of the best of several runs. Goals are those for two cores of a server
and for an H200.
"""

import argparse
import json
import subprocess
import sys
import time

import numpy as np

import warp as wp

# Millions per second.
GOALS = {
    "cpu": {
        "mesh build": 6, "mesh refit": 200, "rays": 16, "closest far": 1.1, "closest near": 5.5,
        "hash build": 100, "density": 15, "samples": 80,
    },
    "cuda": {
        "mesh build": 1000, "mesh refit": 3500, "rays": 8000, "closest far": 75,
        "hash build": 12000, "density": 3000,
    },
}  # fmt: skip


@wp.kernel
def raycast(mesh: wp.uint64, w: int, out: wp.array(dtype=float)):
    tid = wp.tid()
    px = float(tid % w) / float(w) * 2.4 - 1.2
    py = float(tid // w) / float(w) * 2.4 - 1.2
    q = wp.mesh_query_ray(mesh, wp.vec3(px, py, 3.0), wp.vec3(0.0, 0.0, -1.0), 1.0e6)
    if q.result:
        out[tid] = q.t


@wp.kernel
def closest(mesh: wp.uint64, x: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    tid = wp.tid()
    q = wp.mesh_query_point_no_sign(mesh, x[tid], 1.0e6)
    if q.result:
        out[tid] = wp.length(wp.mesh_eval_position(mesh, q.face, q.u, q.v) - x[tid])


@wp.kernel
def density(grid: wp.uint64, x: wp.array(dtype=wp.vec3), rho: wp.array(dtype=float), h: float):
    tid = wp.tid()
    i = wp.hash_grid_point_id(grid, tid)
    xi = x[i]
    s = float(0.0)
    for j in wp.hash_grid_query(grid, xi, h):
        d = xi - x[j]
        r2 = wp.dot(d, d)
        if r2 < h * h:
            q = h * h - r2
            s += q * q * q
    rho[i] = s


@wp.kernel
def cast_each(
    mesh: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    d: wp.array(dtype=wp.vec3),
    out: wp.array(dtype=float),
):
    tid = wp.tid()
    q = wp.mesh_query_ray(mesh, x[tid], d[tid], 1.0e6)
    if q.result:
        out[tid] = q.t


@wp.kernel
def sample(volume: wp.uint64, x: wp.array(dtype=wp.vec3), out: wp.array(dtype=float)):
    tid = wp.tid()
    out[tid] = wp.volume_sample_f(volume, x[tid], wp.Volume.LINEAR)


def grid_mesh(n):
    """A closed bumpy sphere of about 2 n^2 triangles."""
    theta = np.linspace(0, np.pi, n + 1)
    phi = 2 * np.pi * np.arange(n) / n
    p = np.stack(
        [
            np.outer(np.sin(theta), np.cos(phi)),
            np.outer(np.sin(theta), np.sin(phi)),
            np.outer(np.cos(theta), np.ones(n)),
        ],
        -1,
    )
    p *= 1 + 0.1 * np.sin(7 * p[..., :1]) * np.cos(5 * p[..., 1:2])
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a, b = i * n + j, i * n + (j + 1) % n
    c, d = a + n, b + n
    faces = np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)]).reshape(-1, 3)
    return p.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)


def rate(run, work, device, repeat=7):
    """Work per second of the best run, after one that compiles."""
    run()
    best = float("inf")
    for _ in range(repeat):
        wp.synchronize_device(device)
        start = time.perf_counter()
        run()
        wp.synchronize_device(device)
        best = min(best, time.perf_counter() - start)
    return work / best


def measure(device):
    """Rates in millions per second, by name."""
    random = np.random.default_rng(0)
    gpu = device != "cpu"
    n = 320 if gpu else 100
    points, faces = grid_mesh(n)
    x, f = (
        wp.array(points, dtype=wp.vec3, device=device),
        wp.array(faces.ravel(), dtype=int, device=device),
    )
    mesh, triangles = wp.Mesh(x, f), len(faces)
    count = 1 << (20 if gpu else 14)
    far = wp.array(
        (random.random((count, 3)) * 3 - 1.5).astype(np.float32), dtype=wp.vec3, device=device
    )
    near = points[random.integers(len(points), size=count)]
    near = near + 0.01 * random.normal(size=near.shape)
    near = wp.array(near.astype(np.float32), dtype=wp.vec3, device=device)
    directions = random.normal(size=(count, 3)).astype(np.float32)
    directions = wp.array(directions, dtype=wp.vec3, device=device)
    out = wp.zeros(1 << 20, dtype=float, device=device)
    w = 1024 if gpu else 256
    cloud = 1 << (20 if gpu else 17)
    size = (cloud / 8.0) ** (1 / 3)
    z = wp.array(
        (random.random((cloud, 3)) * size).astype(np.float32), dtype=wp.vec3, device=device
    )
    grid = wp.HashGrid(128, 128, 128, device=device)
    grid.build(z, 1.0)
    extent = 256 if gpu else 128
    values = random.random((extent, extent, extent)).astype(np.float32)
    volume = wp.Volume.load_from_numpy(values, device=device)
    places = random.random((1 << 20, 3)) * (extent - 2)
    leaf = places.astype(int) // 8
    sorted_places = places[np.lexsort((leaf[:, 2], leaf[:, 1], leaf[:, 0]))]
    places, sorted_places = (
        wp.array(p.astype(np.float32), dtype=wp.vec3, device=device)
        for p in (places, sorted_places)
    )

    def launch(kernel, dim, inputs):
        return lambda: wp.launch(kernel, dim=dim, inputs=inputs, device=device)

    cases = {
        "mesh build": (lambda: wp.Mesh(x, f), triangles),
        "mesh refit": (mesh.refit, triangles),
        "rays": (launch(raycast, w * w, [mesh.id, w, out]), w * w),
        "rays at random": (launch(cast_each, count, [mesh.id, far, directions, out]), count),
        "closest far": (launch(closest, count, [mesh.id, far, out]), count),
        "closest near": (launch(closest, count, [mesh.id, near, out]), count),
        "hash build": (lambda: grid.build(z, 1.0), cloud),
        "density": (launch(density, cloud, [grid.id, z, out, 1.0]), cloud),
        "samples": (launch(sample, 1 << 20, [volume.id, places, out]), 1 << 20),
        "samples sorted": (launch(sample, 1 << 20, [volume.id, sorted_places, out]), 1 << 20),
    }
    return {name: rate(run, work, device) / 1e6 for name, (run, work) in cases.items()}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--peer")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    ours = measure(options.device)
    if options.json:
        print(json.dumps(ours))
        return
    theirs = {}
    if options.peer:
        command = [options.peer, __file__, "--device", options.device, "--json"]
        text = subprocess.run(command, capture_output=True, text=True, check=True, env={}).stdout
        theirs = json.loads(text.strip().splitlines()[-1])
    goals = GOALS["cpu" if options.device == "cpu" else "cuda"]
    for name, value in ours.items():
        other = f"{theirs[name]:10.2f} {value / theirs[name]:8.2f} x" if name in theirs else ""
        goal = f"goal {goals[name]:6g}" if name in goals else ""
        print(f"{name:14} {value:10.2f} M/s {goal:12} {other}", file=sys.stdout)


if __name__ == "__main__":
    main()
