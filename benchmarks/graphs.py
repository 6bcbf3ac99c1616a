"""Captured steps as recorded, by dependencies, and fused: times, bits, what is left in order.

    python graphs.py [--device cuda:0] [--seconds 0.5] [--scenes lattice19,wave3,rollout]
                     [--worlds 1024,8192] [--schedule]

Each row: microseconds of a step launch by launch, as a chain, by dependencies, and with launches
fused, the ratio of the chain to the last, operations before and after, the longest path, branches,
milliseconds of the first capture and of the next, and whether the arrays have the eager step's
bits. The scene `humanoid` needs mujoco_warp; `--schedule` prints the schedule of each. With the
peer there are the first two times alone.
"""

import argparse
import pathlib
import statistics
import sys
import time

import numpy as np

import warp as wp

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from _graph_scenes import lattice3, rollout, wave3

wp.config.quiet = True
# The peer's graphs have the order of their recording alone.
ORDERS = hasattr(wp.config, "fuse_graphs")


@wp.kernel
def smooth(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    n = x.shape[0]
    y[i] = 0.5 * x[i] + 0.25 * (x[wp.max(i - 1, 0)] + x[wp.min(i + 1, n - 1)])


@wp.kernel
def gather(x: wp.array2d(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    s = float(0.0)
    for j in range(x.shape[0]):
        s += x[j, i]
    y[i] = s


def fields(count, size):
    """`count` small fields that know nothing of each other, each smoothed a few times."""
    rng = np.random.default_rng(1)
    x = wp.array(rng.random((count, size), dtype=np.float32))
    y, total = wp.zeros_like(x), wp.zeros(size)

    def step():
        for i in range(count):
            for _ in range(3):
                wp.launch(smooth, size, [x[i], y[i]])
                wp.launch(smooth, size, [y[i], x[i]])
        wp.launch(gather, size, [x, total])

    return step, [x, y, total]


DIRECTIONS = wp.constant(
    wp.types.matrix((9, 2), wp.int32)(0, 0, 1, 0, 0, 1, -1, 0, 0, -1, 1, 1, -1, 1, -1, -1, 1, -1)
)
WEIGHTS = wp.constant(
    wp.types.vector(9, float)(4 / 9, 1 / 9, 1 / 9, 1 / 9, 1 / 9, 1 / 36, 1 / 36, 1 / 36, 1 / 36)
)


@wp.kernel
def collide(f: wp.array3d(dtype=float), g: wp.array3d(dtype=float)):
    i, j = wp.tid()
    nx, ny = f.shape[1], f.shape[2]
    density = float(0.0)
    u, v = float(0.0), float(0.0)
    for k in range(9):
        value = f[k, (i - DIRECTIONS[k, 0] + nx) % nx, (j - DIRECTIONS[k, 1] + ny) % ny]
        density += value
        u += value * float(DIRECTIONS[k, 0])
        v += value * float(DIRECTIONS[k, 1])
    u = u / density
    v = v / density
    for k in range(9):
        value = f[k, (i - DIRECTIONS[k, 0] + nx) % nx, (j - DIRECTIONS[k, 1] + ny) % ny]
        along = float(DIRECTIONS[k, 0]) * u + float(DIRECTIONS[k, 1]) * v
        rest = (
            density * WEIGHTS[k] * (1.0 + 3.0 * along + 4.5 * along * along - 1.5 * (u * u + v * v))
        )
        g[k, i, j] = value + (rest - value) * 0.6


@wp.kernel
def drive(f: wp.array3d(dtype=float), column: int):
    j = wp.tid()
    for k in range(9):
        f[k, column, j] = WEIGHTS[k] * (1.0 + 0.1 * float(DIRECTIONS[k, 0]))


def lattice(size):
    """A D2Q9 lattice Boltzmann step with two driven columns."""
    f = wp.array(
        np.broadcast_to(np.array(WEIGHTS, dtype=np.float32)[:, None, None], (9, size, size)).copy()
    )
    g = wp.zeros_like(f)

    def step():
        for a, b in ((f, g), (g, f)):
            wp.launch(collide, (size, size), [a, b])
            wp.launch(drive, size, [b, 0])
            wp.launch(drive, size, [b, size - 1])

    return step, [f, g]


@wp.kernel
def displace(h: wp.array2d(dtype=float), at: wp.array(dtype=wp.vec2), time: wp.array(dtype=float)):
    i, j = wp.tid()
    t = time[0]
    for k in range(at.shape[0]):
        d = wp.vec2(float(i), float(j)) - at[k]
        if wp.length_sq(d) < 9.0:
            h[i, j] = wp.sin(t * (1.0 + float(k)))


@wp.kernel
def propagate(
    h: wp.array2d(dtype=float), last: wp.array2d(dtype=float), next: wp.array2d(dtype=float)
):
    i, j = wp.tid()
    nx, ny = h.shape[0], h.shape[1]
    if i == 0 or j == 0 or i == nx - 1 or j == ny - 1:
        return
    laplacian = h[i + 1, j] + h[i - 1, j] + h[i, j + 1] + h[i, j - 1] - 4.0 * h[i, j]
    next[i, j] = 2.0 * h[i, j] - last[i, j] + 0.2 * laplacian


@wp.kernel
def advance(time: wp.array(dtype=float), at: wp.array(dtype=wp.vec2)):
    k = wp.tid()
    if k == 0:
        time[0] = time[0] + 0.05
    at[k] = at[k] + wp.vec2(0.01, 0.0)


@wp.kernel
def heights(h: wp.array2d(dtype=float), points: wp.array2d(dtype=wp.vec3)):
    i, j = wp.tid()
    points[i, j] = wp.vec3(float(i), h[i, j], float(j))


def wave(size):
    """Three turns of a wave equation with moving sources, and vertices for a picture."""
    grids = [wp.zeros((size, size), dtype=float) for _ in range(3)]
    at = wp.array(np.array([[20, 20], [40, 50]], dtype=np.float32), dtype=wp.vec2)
    now, points = wp.zeros(1, dtype=float), wp.zeros((size, size), dtype=wp.vec3)

    def step():
        for turn in range(3):
            a, b, c = (grids[(turn + k) % 3] for k in range(3))
            wp.launch(displace, (size, size), [b, at, now])
            wp.launch(propagate, (size, size), [b, a, c])
            wp.launch(advance, 2, [now, at])
            wp.launch(heights, (size, size), [c, points])

    return step, [*grids, at, now, points]


@wp.kernel
def density(grid: wp.uint64, x: wp.array(dtype=wp.vec3), rho: wp.array(dtype=float), radius: float):
    i = wp.hash_grid_point_id(grid, wp.tid())
    s = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], radius):
        d2 = wp.length_sq(x[i] - x[j])
        s += wp.max(radius * radius - d2, 0.0) ** 3.0
    rho[i] = s


@wp.kernel
def push(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    rho: wp.array(dtype=float),
    a: wp.array(dtype=wp.vec3),
    radius: float,
):
    i = wp.hash_grid_point_id(grid, wp.tid())
    s = wp.vec3()
    for j in wp.hash_grid_query(grid, x[i], radius):
        d = x[i] - x[j]
        r = wp.length(d)
        if j != i and r < radius and r > 0.0:
            s += d / r * (radius - r) * (rho[i] + rho[j])
    a[i] = 1.0e-4 * s - wp.vec3(0.0, 0.01, 0.0)


@wp.kernel
def move(x: wp.array(dtype=wp.vec3), v: wp.array(dtype=wp.vec3), a: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    v[i] = v[i] + 0.01 * a[i]
    x[i] = x[i] + 0.01 * v[i]


@wp.kernel
def energy(v: wp.array(dtype=wp.vec3), e: wp.array(dtype=float)):
    i = wp.tid()
    e[i] = 0.5 * wp.length_sq(v[i])


def particles(count):
    """A smoothed particle step: grid, densities, forces, motion and energies."""
    rng = np.random.default_rng(2)
    side = count ** (1 / 3)
    x = wp.array(rng.random((count, 3), dtype=np.float32) * np.float32(side), dtype=wp.vec3)
    v, a, rho, e = wp.zeros_like(x), wp.zeros_like(x), wp.zeros(count), wp.zeros(count)
    grid = wp.HashGrid(64, 64, 64)
    grid.build(x, 1.5)

    def step():
        grid.build(x, 1.5)
        wp.launch(density, count, [grid.id, x, rho, 1.5])
        wp.launch(push, count, [grid.id, x, rho, a, 1.5])
        wp.launch(move, count, [x, v, a])
        wp.launch(energy, count, [v, e])

    step.grid = grid
    return step, [x, v, a, rho, e]


def humanoid(worlds):
    """A step of mujoco_warp's humanoid."""
    import pathlib

    import mujoco
    import mujoco_warp

    folder = pathlib.Path(mujoco_warp.__file__).parent / "test_data"
    model = mujoco.MjModel.from_xml_path(str(folder / "humanoid/humanoid.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    m = mujoco_warp.put_model(model)
    d = mujoco_warp.put_data(model, data, nworld=worlds)
    rng = np.random.default_rng(0)
    d.ctrl.assign(rng.uniform(-0.3, 0.3, d.ctrl.shape).astype(np.float32))
    return lambda: mujoco_warp.step(m, d), [d.qpos, d.qvel, d.qacc_warmstart, d.time]


def scenes(options):
    gpu = wp.get_device().is_cuda
    yield "fields", lambda: fields(12, 20_000 if gpu else 2_000)
    yield "lattice", lambda: lattice(512 if gpu else 64)
    yield "wave", lambda: wave(256 if gpu else 64)
    yield "particles", lambda: particles(20_000 if gpu else 2_000)
    for speeds in (19, 27):
        yield f"lattice{speeds}", lambda speeds=speeds: lattice3(speeds, 96 if gpu else 16)
        yield f"lattice{speeds}s", lambda speeds=speeds: lattice3(speeds, 32 if gpu else 8)
    yield "wave3", lambda: wave3(128 if gpu else 24)
    yield "wave3s", lambda: wave3(32 if gpu else 8)
    yield "rollout", lambda: rollout(4096 if gpu else 256)
    yield "rollouts", lambda: rollout(512 if gpu else 32)
    for worlds in options.worlds.split(","):
        yield f"humanoid {worlds}", lambda worlds=worlds: humanoid(int(worlds))


def restore(arrays, start):
    for array, values in zip(arrays, start):
        array.assign(values)


def seconds_per_step(ways, arrays, start, seconds):
    """Median times of several ways to make a step, in turn and each from the same state."""
    times, count = [[] for _ in ways], 1
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or len(times[-1]) < 3:
        for way, mine in zip(ways, times):
            restore(arrays, start)
            way()
            wp.synchronize_device()
            begin = time.perf_counter()
            for _ in range(count):
                way()
            wp.synchronize_device()
            mine.append((time.perf_counter() - begin) / count)
        # The first round shows how many steps are worth a look at the clock.
        if count == 1:
            count = max(10, min(100, int(0.02 / times[-1].pop())))
            times = [[] for _ in ways]
    return [statistics.median(mine) for mine in times]


def captured(step, optimize, fuse=True):
    """A graph of a step, and the milliseconds of its capture."""
    options = {}
    if ORDERS:
        options["optimize"], wp.config.fuse_graphs = optimize, fuse
    begin = time.perf_counter()
    with wp.ScopedCapture(**options) as capture:
        step()
    return capture.graph, 1e3 * (time.perf_counter() - begin)


def run(step, arrays, start, steps=5):
    restore(arrays, start)
    for _ in range(steps):
        step()
    return [array.numpy() for array in arrays]


def same(a, b):
    return all(x.tobytes() == y.tobytes() for x, y in zip(a, b))


def measure(name, make, options):
    step, arrays = make()
    start = [array.numpy().copy() for array in arrays]
    step()
    graphs = [captured(step, False)[0]]
    if ORDERS:
        graphs.append(captured(step, True, False)[0])
        graph, first = captured(step, True)
        graph, later = captured(step, True)
        graphs.append(graph)
    ways = [step, *(lambda graph=graph: wp.capture_launch(graph) for graph in graphs)]
    found = [run(way, arrays, start) for way in ways]
    repeats = same(run(step, arrays, start), found[0])
    bits = "same" if all(same(one, found[0]) for one in found) else "DIFFERENT"
    if not repeats:
        gaps = [max(float(np.abs(x - y).max()) for x, y in zip(one, found[0])) for one in found[1:]]
        bits = "eager runs differ; " + ", ".join(f"{gap:.1e}" for gap in gaps)
    times = seconds_per_step(ways, arrays, start, options.seconds)
    row = f"{name:14}" + "".join(f"{1e6 * one:9.1f}" for one in times)
    if ORDERS:
        before, after = graphs[1].schedule(), graph.schedule()
        row += (
            f" {times[1] / times[3]:6.2f}x {len(before.nodes):5} {len(after.nodes):5} "
            f"{after.depth:5} {after.branches:5} {first:8.1f} {later:8.1f}"
        )
    print(f"{row}  {bits}", flush=True)
    if ORDERS and (options.schedule or after.kept):
        print(after)


SCENES = (
    "fields,lattice,wave,particles,lattice19,lattice19s,lattice27,lattice27s,wave3,wave3s,rollout,"
    "rollouts,humanoid"
)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--seconds", type=float, default=0.5)
    parser.add_argument("--scenes", default=SCENES)
    parser.add_argument("--worlds", default="1024,8192")
    parser.add_argument("--schedule", action="store_true")
    options = parser.parse_args()
    print(
        f"{'scene':14}{'eager us':>9}{'chain us':>9}{'graph us':>9}{'fused us':>9} {'ratio':>7} "
        f"{'nodes':>5} {'fused':>5} {'path':>5} {'lines':>5} {'first ms':>8} {'next ms':>8}  bits"
    )
    with wp.ScopedDevice(options.device):
        for name, make in scenes(options):
            if name.split()[0] not in options.scenes.split(","):
                continue
            try:
                measure(name, make, options)
            except ImportError as error:
                print(f"{name:16} {error}")


if __name__ == "__main__":
    main()
