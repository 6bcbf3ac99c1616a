"""A dam breaks: water by smoothed particles runs against a row of pillars.

    python examples/scenes/dam_break.py [--device cpu] [--frames 24] [--scale 1.0]

Position-based fluids; the surface comes from the particles by marching cubes. The error is the
compression that 99 % of the water stays below in every step, over its density at rest.
"""

import numpy as np
from movies import Movie

import warp as wp

# The tank [m], its low corner in the origin; [s].
TANK, DT = (3.2, 1.5, 1.0), 1.0 / 600.0
PILLARS = ((1.9, 0.28), (1.9, 0.72), (2.35, 0.5))
THICK = 0.09


@wp.func
def poly(d2: float, h: float):
    """The kernel of degree six, without its constant."""
    x = wp.max(1.0 - d2 / (h * h), 0.0)
    return x * x * x


@wp.func
def inside(p: wp.vec3, tank: wp.vec3, pillars: wp.array[wp.vec2], radius: float):
    """The nearest place in the tank and outside of the pillars."""
    q = wp.vec3(
        wp.clamp(p[0], radius, tank[0] - radius),
        wp.max(p[1], radius),
        wp.clamp(p[2], radius, tank[2] - radius),
    )
    for k in range(pillars.shape[0]):
        d = wp.vec2(q[0], q[2]) - pillars[k]
        away = wp.length(d)
        if away < THICK + radius:
            d = d * ((THICK + radius) / wp.max(away, 1.0e-6))
            q = wp.vec3(pillars[k][0] + d[0], q[1], pillars[k][1] + d[1])
    return q


@wp.kernel
def predict(
    x: wp.array[wp.vec3],
    v: wp.array[wp.vec3],
    dt: float,
    tank: wp.vec3,
    pillars: wp.array[wp.vec2],
    radius: float,
    q: wp.array[wp.vec3],
):
    i = wp.tid()
    v[i] = v[i] + wp.vec3(0.0, -9.81, 0.0) * dt
    q[i] = inside(x[i] + v[i] * dt, tank, pillars, radius)


@wp.kernel
def measure(
    grid: wp.uint64,
    q: wp.array[wp.vec3],
    h: float,
    rest: float,
    softness: float,
    factor: wp.array[float],
    density: wp.array[float],
):
    """The constraint's multiplier: how far a particle and its neighbours have to move."""
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = q[i]
    total = float(0.0)
    own = wp.vec3()
    squares = float(0.0)
    query = wp.hash_grid_query(grid, p, h)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        d = p - q[j]
        d2 = wp.length_sq(d)
        if d2 < h * h:
            total += poly(d2, h)
            if j != i:
                x = 1.0 - d2 / (h * h)
                slope = d * (-6.0 * x * x / (h * h * rest))
                own += slope
                squares += wp.length_sq(slope)
    off = wp.max(total / rest - 1.0, 0.0)
    density[i] = total / rest
    factor[i] = -off / (squares + wp.length_sq(own) + softness)


@wp.kernel
def correct(
    grid: wp.uint64,
    q: wp.array[wp.vec3],
    factor: wp.array[float],
    h: float,
    rest: float,
    tank: wp.vec3,
    pillars: wp.array[wp.vec2],
    radius: float,
    out: wp.array[wp.vec3],
):
    i = wp.hash_grid_point_id(grid, wp.tid())
    p = q[i]
    shift = wp.vec3()
    query = wp.hash_grid_query(grid, p, h)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        d = p - q[j]
        d2 = wp.length_sq(d)
        if d2 < h * h and j != i:
            x = 1.0 - d2 / (h * h)
            shift += d * (-6.0 * x * x / (h * h * rest) * (factor[i] + factor[j]))
    out[i] = inside(p + shift, tank, pillars, radius)


@wp.kernel
def finish(
    grid: wp.uint64,
    x: wp.array[wp.vec3],
    q: wp.array[wp.vec3],
    h: float,
    dt: float,
    blend: float,
    v: wp.array[wp.vec3],
    out: wp.array[wp.vec3],
):
    """Velocities from positions, a little like those of the neighbours."""
    i = wp.hash_grid_point_id(grid, wp.tid())
    mine = (q[i] - x[i]) / dt
    mean = wp.vec3()
    weights = float(1.0e-6)
    query = wp.hash_grid_query(grid, q[i], h)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        w = poly(wp.length_sq(q[i] - q[j]), h)
        mean += w * (q[j] - x[j]) / dt
        weights += w
    out[i] = mine + blend * (mean / weights - mine)


@wp.kernel
def fill(
    grid: wp.uint64,
    q: wp.array[wp.vec3],
    h: float,
    cell: float,
    low: wp.vec3,
    field: wp.array3d[float],
):
    """How much water is around the points of a grid."""
    i, j, k = wp.tid()
    p = low + cell * wp.vec3(float(i), float(j), float(k))
    total = float(0.0)
    query = wp.hash_grid_query(grid, p, h)
    n = int(0)
    while wp.hash_grid_query_next(query, n):
        total += poly(wp.length_sq(p - q[n]), h)
    field[i, j, k] = total


class Water:
    """The particles and their steps."""

    def __init__(self, count, device):
        # Half a gap from the walls on all sides.
        self.gap = 1.0 / round(count ** (1.0 / 3.0))
        axes = [np.arange(0.5 * self.gap, side, self.gap) for side in (1.0, 1.05, TANK[2])]
        start = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        start += np.random.default_rng(0).uniform(-0.001, 0.001, start.shape) * self.gap
        self.h, self.radius, self.device = 2.0 * self.gap, 0.4 * self.gap, device
        steps = np.arange(-2, 3)
        near = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3) * self.gap
        self.rest = float(np.sum(np.maximum(1.0 - (near**2).sum(1) / self.h**2, 0.0) ** 3))
        self.x, self.v, self.q, self.next = (
            wp.array(values, dtype=wp.vec3, device=device)
            for values in (start, 0.0 * start, start, start)
        )
        self.factor, self.density = (
            wp.zeros(len(start), dtype=float, device=device) for _ in range(2)
        )
        self.pillars = wp.array(PILLARS, dtype=wp.vec2, device=device)
        self.grid = wp.HashGrid(96, 64, 48, device=device)
        self.worst = 0.0

    def step(self):
        n, walls = len(self.x), [wp.vec3(*TANK), self.pillars, self.radius]
        wp.launch(predict, n, [self.x, self.v, DT, *walls, self.q], device=self.device)
        self.grid.build(self.q, self.h)
        softness = 0.5 / self.h**2
        for _ in range(4):
            inputs = [self.grid.id, self.q, self.h, self.rest, softness]
            wp.launch(measure, n, inputs, [self.factor, self.density], device=self.device)
            inputs = [self.grid.id, self.q, self.factor, self.h, self.rest, *walls]
            wp.launch(correct, n, inputs, [self.next], device=self.device)
            self.q, self.next = self.next, self.q
        inputs = [self.grid.id, self.x, self.q, self.h, DT, 0.015, self.v]
        wp.launch(finish, n, inputs, [self.next], device=self.device)
        self.v, self.next = self.next, self.v
        wp.copy(self.x, self.q)
        dense = np.quantile(self.density.numpy(), 0.99) - 1.0
        self.worst = max(self.worst, float(dense))

    def surface(self):
        """Points and faces of the water's surface."""
        cell = 0.55 * self.gap
        size = [int(side / cell) + 5 for side in (TANK[0], 1.45, TANK[2])]
        low = wp.vec3(-2.0 * cell, -2.0 * cell, -2.0 * cell)
        field = wp.zeros(size, dtype=float, device=self.device)
        self.grid.build(self.x, self.h)
        inputs = [self.grid.id, self.x, self.h, cell, low]
        wp.launch(fill, size, inputs, [field], device=self.device)
        first = np.array([low.x, low.y, low.z])
        corners = [first, first + cell * (np.array(size) - 1)]
        cubes = wp.MarchingCubes(*size, *(wp.vec3(*map(float, corner)) for corner in corners))
        cubes.surface(field, 0.32 * self.rest)
        return cubes.verts.numpy(), cubes.indices.numpy()


def add_tank(scene):
    """Floor, a low frame and pillars."""
    floor = {"color": (0.82, 0.78, 0.72), "roughness": 0.5}
    scene.add_height_field(np.full((2, 2), -0.012), (-300, -300), (300, 300), **floor)
    x, _, z = TANK
    frame = np.array([[0, 0, 0], [x, 0, 0], [x, 0, z], [0, 0, z], [0, 0, 0]], float)
    steel = {"color": (0.2, 0.22, 0.25), "roughness": 0.3}
    scene.add_tubes([frame], 0.014, **steel)
    from movies import revolved

    points, faces = revolved([(0, 0.62), (THICK * 0.9, 0.62), (THICK * 0.9, 0.0)], 40)
    poses = np.tile(np.eye(4), (len(PILLARS), 1, 1))
    poses[:, [0, 2], 3] = PILLARS
    paint = {"color": (0.85, 0.28, 0.06), "roughness": 0.3}
    scene.add_mesh(points, faces[::1], transforms=poses, smooth=False, **paint)


def main():
    movie = Movie("dam_break", __doc__, frames=32, samples=6, fps=12.0)
    water = Water(movie.count(30_000), movie.device)
    options = movie.options
    for _ in range(movie.frames):
        for _ in range(32):
            movie.timed(water.step)
        # The surface's triangles are other ones in each frame.
        scene = movie.scene = type(movie.scene)(options.width, options.height, device=movie.device)
        scene.limit, scene.depth = 4.0, 10
        add_tank(scene)
        scene.set_sky(sun=(-0.35, 0.75, 0.6), power=5.0, size=2.5)
        scene.set_camera((2.75, 2.15, 3.9), (1.58, 0.26, 0.5), fov=36.0)
        clear = {"transmission": 0.72, "ior": 1.33, "absorption": (0.9, 0.2, 0.1)}
        scene.add_mesh(*water.surface(), color=(0.5, 0.86, 0.95), roughness=0.05, **clear)
        movie.add()
    rate = movie.frames * 32 * len(water.x) / movie.work / 1e6
    movie.finish(rate, "M particles a second", water.worst, "compression")


if __name__ == "__main__":
    main()
