"""A hundred thousand grains in a turning drum: coloured layers are mixed by avalanches.

    python examples/scenes/drum.py [--device cpu] [--frames 24] [--scale 1.0]

The discrete element method, with neighbours by a hash grid. The error is the deepest overlap of a
grain and the drum, over the grain's radius.
"""

import numpy as np
from movies import Movie, revolved

import warp as wp

# [m], [s], [rad/s]; stiffness and damping per mass.
DRUM, LENGTH, DT, SPIN = 1.0, 0.9, 1.0 / 3000.0, 1.1
STIFFNESS, DAMPING, FRICTION = 1.2e6, 340.0, 0.7


@wp.func
def contact_force(n: wp.vec3, v: wp.vec3, gap: float):
    """The force of a contact with normal n, relative velocity v and gap, negative if pressed."""
    normal = wp.dot(n, v)
    pressure = wp.min(gap * STIFFNESS + wp.min(normal, 0.0) * DAMPING, 0.0)
    slide = v - n * normal
    speed = wp.length(slide)
    grip = wp.min(speed * DAMPING, -FRICTION * pressure) / wp.max(speed, 1.0e-6)
    return -n * pressure - slide * grip


@wp.kernel
def forces(
    grid: wp.uint64,
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    f: wp.array[wp.vec3],
    radius: float,
    spin: float,
):
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = x[i]
    total = wp.vec3(0.0, -9.81, 0.0)
    out = wp.vec3(p[0], p[1], 0.0)
    away = wp.length(out)
    gap = DRUM - radius - away
    if gap < 0.0:
        # The drum's wall moves with it.
        wall = wp.vec3(-p[1], p[0], 0.0) * spin
        total += contact_force(-out / away, v[i] - wall, gap)
    back = p[2] - radius
    if back < 0.0:
        total += contact_force(wp.vec3(0.0, 0.0, 1.0), v[i], back)
    front = LENGTH - radius - p[2]
    if front < 0.0:
        total += contact_force(wp.vec3(0.0, 0.0, -1.0), v[i], front)
    query = wp.hash_grid_query(grid, p, radius * 2.0)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if j != i:
            apart = p - x[j]
            distance = wp.length(apart)
            touching = distance - 2.0 * radius
            if touching < 0.0 and distance > 0.0:
                total += contact_force(apart / distance, v[i] - v[j], touching)
    f[i] = total


@wp.kernel
def move(x: wp.array[wp.vec3], v: wp.array[wp.vec3], f: wp.array[wp.vec3], dt: float):
    i = wp.tid()
    v[i] = v[i] + f[i] * dt
    x[i] = x[i] + v[i] * dt


def pile(count):
    """Grains in the drum's lower half, on a lattice, and their radius."""
    radius = (0.5 * np.pi * DRUM**2 * LENGTH * 0.95 * 0.5 / count / (4.0 / 3.0 * np.pi)) ** (1 / 3)
    at = np.arange(-DRUM, DRUM, 2.02 * radius)
    z = np.arange(1.02 * radius, LENGTH - radius, 2.02 * radius)
    grid = np.stack(np.meshgrid(at, at, z, indexing="ij"), axis=-1).reshape(-1, 3)
    grid = grid[np.hypot(grid[:, 0], grid[:, 1]) < DRUM - 1.05 * radius]
    grid = grid[np.argsort(grid[:, 1], kind="stable")][:count]
    return grid + np.random.default_rng(0).uniform(-0.01, 0.01, grid.shape) * radius, radius


def add_drum(scene):
    """A steel tube with rims, and a dark wall behind."""
    rim = [(1.0, 0.0), (1.0, -LENGTH), (1.07, -LENGTH), (1.07, 0.03), (1.0, 0.03), (1.0, 0.0)]
    points, faces = revolved(rim, 160)
    # From about y to about z.
    points = points[:, [0, 2, 1]] * [1, -1, 1] + [0, 0, LENGTH]
    steel = {"color": (0.75, 0.76, 0.8), "metallic": 1.0, "roughness": 0.25}
    drum = scene.add_mesh(points, faces, smooth=False, **steel)
    bolts = np.linspace(0.0, 2.0 * np.pi, 13)[:-1]
    at = np.stack([1.035 * np.cos(bolts), 1.035 * np.sin(bolts), 0 * bolts + LENGTH + 0.035], 1)
    heads = scene.add_spheres(at, 0.022, color=(0.9, 0.5, 0.15), metallic=1.0, roughness=0.2)
    disc, faces = revolved([(0.0, 0.0), (1.02, 0.0)], 96)
    back = {"color": (0.05, 0.06, 0.08), "roughness": 0.4}
    scene.add_mesh(disc[:, [0, 2, 1]], faces, smooth=False, **back)
    floor = {"color": (0.42, 0.4, 0.38), "roughness": 0.35}
    scene.add_height_field(np.full((2, 2), -1.075), (-300, -300), (300, 300), **floor)
    return drum, heads, at


def main():
    movie = Movie("drum", __doc__, frames=30, samples=6, fps=10.0)
    scene, device = movie.scene, movie.device
    start, radius = pile(movie.count(100_000))
    count = len(start)
    x = wp.array(start, dtype=wp.vec3, device=device)
    v, f = (wp.zeros(count, dtype=wp.vec3, device=device) for _ in range(2))
    grid = wp.HashGrid(dim_x=96, dim_y=96, dim_z=64, device=device)

    def advance(steps, spin):
        for _ in range(steps):
            grid.build(points=x, radius=2.0 * radius)
            wp.launch(forces, count, [grid.id, x, v, f, radius, spin], device=device)
            wp.launch(move, count, [x, v, f, DT], device=device)

    advance(800, 0.0)
    wp.synchronize_device(device)
    layer = (x.numpy()[:, 1] - x.numpy()[:, 1].min()) / np.ptp(x.numpy()[:, 1])
    palette = np.array([[0.9, 0.25, 0.1], [0.95, 0.75, 0.2], [0.1, 0.45, 0.6], [0.9, 0.88, 0.8]])
    colors = palette[np.minimum((layer * 4).astype(int), 3)]
    drum, heads, at = add_drum(scene)
    balls = scene.add_spheres(x, radius, colors=colors, roughness=0.35)
    scene.set_sky(sun=(0.35, 0.7, 0.9), power=6.5, size=1.5)
    scene.set_camera((0.85, 0.55, 4.9), (0.0, -0.02, 0.4), fov=33.0)
    scene.exposure = 0.7
    turned, worst, steps = 0.0, 0.0, 220
    for _ in range(movie.frames):
        movie.timed(lambda: advance(steps, SPIN))
        turned += SPIN * steps * DT
        where = x.numpy()
        worst = max(worst, float((np.hypot(where[:, 0], where[:, 1]) + radius - DRUM).max()))
        balls.update(where, np.float32(radius), colors)
        c, s = np.cos(turned), np.sin(turned)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        place = np.eye(4)
        place[:3, :3] = turn
        drum.update(place)
        heads.update(at @ turn.T)
        movie.add()
    rate = steps * movie.frames * count / movie.work / 1e6
    movie.finish(rate, "M grains a second", worst / radius, "deepest overlap over the radius")


if __name__ == "__main__":
    main()
