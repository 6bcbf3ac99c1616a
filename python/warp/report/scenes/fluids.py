"""Fluids: a column of particles (SPH) at rest, and advection on a sparse volume."""

import numpy as np

import warp as wp
import warp.report as report

# [kg/m^3], [m/s], [m/s^2], [m], [s]
DENSITY, SOUND, GRAVITY, HEIGHT, TIME = 1000.0, 30.0, 9.81, 1.0, 0.25


@wp.func
def slope(r: float, h: float):
    """Derivative of the cubic spline in one dimension, whose support is 2 h."""
    q = wp.abs(r) / h
    result = float(0.0)
    if q < 1.0:
        result = -2.0 * q + 1.5 * q * q
    elif q < 2.0:
        result = -0.5 * (2.0 - q) * (2.0 - q)
    return result * wp.sign(r) / (h * h)


@wp.kernel
def compress(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=float),
    density: wp.array(dtype=float),
    mass: float,
    h: float,
    dt: float,
    after: wp.array(dtype=float),
):
    """Densities at the end of a step; below the floor each particle has its mirror image."""
    i = wp.tid()
    z = x[i][2]
    growth = float(0.0)
    for j in wp.hash_grid_query(grid, x[i], 2.0 * h):
        growth += mass / density[j] * (v[i] - v[j]) * slope(z - x[j][2], h)
    for j in wp.hash_grid_query(grid, wp.vec3(0.0, 0.0, -z), 2.0 * h):
        growth += mass / density[j] * (v[i] + v[j]) * slope(z + x[j][2], h)
    after[i] = density[i] * (1.0 + growth * dt)


@wp.func
def pressure(density: float):
    return SOUND * SOUND * (density - DENSITY)


@wp.func
def damping(dv: float, r: float, h: float):
    """Monaghan's viscosity, per density."""
    return 0.3 * h * SOUND * dv * r / (r * r + 0.01 * h * h)


@wp.kernel
def push(
    grid: wp.uint64,
    x: wp.array(dtype=wp.vec3),
    v: wp.array(dtype=float),
    density: wp.array(dtype=float),
    mass: float,
    h: float,
    dt: float,
    after: wp.array(dtype=float),
):
    """Velocities at the end of a step, by pressures there."""
    i = wp.tid()
    z = x[i][2]
    p = pressure(density[i])
    a = -GRAVITY
    for j in wp.hash_grid_query(grid, x[i], 2.0 * h):
        r = z - x[j][2]
        both = (p + pressure(density[j])) / density[i] - damping(v[i] - v[j], r, h)
        a -= mass / density[j] * both * slope(r, h)
    for j in wp.hash_grid_query(grid, wp.vec3(0.0, 0.0, -z), 2.0 * h):
        r = z + x[j][2]
        # The pressure goes on growing downwards.
        below = pressure(density[j]) + 2.0 * DENSITY * GRAVITY * x[j][2]
        both = (p + below) / density[i] - damping(v[i] + v[j], r, h)
        a -= mass / density[j] * both * slope(r, h)
    after[i] = v[i] + a * dt


@wp.kernel
def move(x: wp.array(dtype=wp.vec3), v: wp.array(dtype=float), dt: float):
    i = wp.tid()
    x[i] += wp.vec3(0.0, 0.0, v[i] * dt)


def column(count):
    """Heights and densities of particles of equal mass at rest."""
    gradient = GRAVITY / SOUND**2
    # Mass below z is DENSITY ((1 + gradient HEIGHT) z - gradient z^2 / 2).
    whole = DENSITY * (HEIGHT + gradient * HEIGHT**2 / 2)
    share = whole * (np.arange(count) + 0.5) / count / DENSITY
    top = 1.0 + gradient * HEIGHT
    z = (top - np.sqrt(top**2 - 2 * gradient * share)) / gradient
    return z, DENSITY * (1.0 + gradient * (HEIGHT - z)), whole / count


@report.scene(
    sweep=report.Sweep("particles", values=(16, 32, 64, 128), quick=3),
    curves=(report.Sweep("courant", values=(0.2, 0.4), quick=2),),
    dtypes=("float32",),
    limits=lambda case: {"pressure": 2.0 / case.particles + 0.01},
)
def sph_column(case):
    """A column of water by smoothed particles: pressure over depth, which should stay at rest."""
    count = int(case.particles)
    z, rest, mass = column(count)
    spacing = HEIGHT / count
    h = 1.3 * spacing
    steps = round(TIME * SOUND / (case.courant * spacing))
    start = np.zeros((count, 3))
    start[:, 2] = z
    first = wp.array(start, dtype=wp.vec3, device=case.device)
    still = wp.array(rest, dtype=float, device=case.device)
    x = wp.clone(first)
    density, v = ([wp.zeros_like(still) for _ in range(2)] for _ in range(2))
    grid = wp.HashGrid(4, 4, 256, device=case.device)

    def run():
        dt = TIME / steps
        for _ in range(steps):
            grid.build(x, 2.0 * h)
            around = [grid.id, x, v[0], density[0], mass, h, dt, density[1]]
            wp.launch(compress, count, around, device=case.device)
            density.reverse()
            around = [grid.id, x, v[0], density[0], mass, h, dt, v[1]]
            wp.launch(push, count, around, device=case.device)
            v.reverse()
            wp.launch(move, count, [x, v[0], dt], device=case.device)

    def reset():
        wp.copy(x, first)
        wp.copy(density[0], still)
        v[0].zero_()

    def quantities():
        found = SOUND**2 * (density[0].numpy().astype(float) - DENSITY)
        wanted = DENSITY * GRAVITY * (HEIGHT - x.numpy()[:, 2].astype(float))
        error = np.abs(found - wanted).max() / (DENSITY * GRAVITY * HEIGHT)
        return {"pressure": report.Error(float(error))}

    return report.Program(run, quantities, reset, work=count * steps)


@wp.kernel
def advect(
    voxels: wp.array2d(dtype=int),
    now: wp.uint64,
    after: wp.uint64,
    angle: float,
):
    """Takes each voxel's value from where a turn about the z axis has brought it from."""
    row = voxels[wp.tid()]
    i, j, k = row[0], row[1], row[2]
    p = wp.volume_index_to_world(now, wp.vec3(float(i), float(j), float(k)))
    c, s = wp.cos(angle), wp.sin(angle)
    source = wp.volume_world_to_index(now, wp.vec3(c * p[0] + s * p[1], c * p[1] - s * p[0], p[2]))
    wp.volume_store_f(after, i, j, k, wp.volume_sample_f(now, source, wp.Volume.LINEAR))


@wp.kernel
def store(voxels: wp.array2d(dtype=int), values: wp.array(dtype=float), volume: wp.uint64):
    n = wp.tid()
    wp.volume_store_f(volume, voxels[n, 0], voxels[n, 1], voxels[n, 2], values[n])


def blob(points):
    """A smooth ball of radius 0.3 around (0.5, 0, 0); zero outside."""
    distance = np.linalg.norm(points - np.array([0.5, 0.0, 0.0]), axis=-1) / 0.3
    return np.where(distance < 1.0, np.cos(0.5 * np.pi * np.minimum(distance, 1.0)) ** 2, 0.0)


def ring(size):
    """Corners of the leaves of 8 x 8 x 8 voxels that a turn of the ball touches."""
    reach = int(np.ceil(1.0 / size / 8)) + 1
    leaves = np.stack(np.meshgrid(*[np.arange(-reach, reach)] * 3, indexing="ij"), -1)
    leaves = leaves.reshape(-1, 3)
    middle = (leaves + 0.5) * 8 * size
    away = np.hypot(np.hypot(middle[:, 0], middle[:, 1]) - 0.5, middle[:, 2])
    return leaves[away < 0.35 + 7.0 * size] * 8


@report.scene(
    sweep=report.Sweep("voxels", values=(10, 20, 40, 60), quick=3),
    curves=(report.Sweep("steps", values=(12, 36), quick=2),),
    dtypes=("float32",),
    limits=lambda case: {"overshoot": 1e-5},
    diverged=10.0,
)
def sparse_advection(case):
    """A ball carried once around by semi-Lagrangian steps; the volume has a ring of voxels alone.

    `voxels` counts them along an edge of length 1. The result should be the ball of the start.
    """
    size, steps = 1.0 / case.voxels, int(case.steps)
    tiles = wp.array(ring(size), dtype=int, device=case.device)
    volumes = [
        wp.Volume.allocate_by_tiles(tiles, size, bg_value=0.0, device=case.device) for _ in range(2)
    ]
    voxels = volumes[0].get_voxels()
    start = blob(voxels.numpy() * size)
    values = wp.array(start, dtype=float, device=case.device)

    def run():
        now, after = volumes
        for _ in range(steps):
            inputs = [voxels, now.id, after.id, 2.0 * np.pi / steps]
            wp.launch(advect, len(voxels), inputs, device=case.device)
            now, after = after, now

    def reset():
        inputs = [voxels, values, volumes[0].id]
        wp.launch(store, len(voxels), inputs, device=case.device)

    def quantities():
        # After an even number of steps.
        found = wp.zeros(len(voxels), dtype=float, device=case.device)
        wp.launch(load, len(voxels), [voxels, volumes[0].id, found], device=case.device)
        found = found.numpy().astype(float)
        passed = max(found.max() - start.max(), start.min() - found.min(), 0.0)
        error = np.abs(found - start).mean() / start.mean()
        return {"ball": report.Error(float(error)), "overshoot": report.Error(float(passed))}

    return report.Program(run, quantities, reset, work=len(start) * steps)


@wp.kernel
def load(voxels: wp.array2d(dtype=int), volume: wp.uint64, values: wp.array(dtype=float)):
    n = wp.tid()
    values[n] = wp.volume_lookup_f(volume, voxels[n, 0], voxels[n, 1], voxels[n, 2])
