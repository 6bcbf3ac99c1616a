"""Soft bodies that fall onto each other: tetrahedra of a neo-Hookean material, by finite elements.

    python examples/scenes/soft_bodies.py [--device cpu] [--frames 24] [--scale 1.0]

Explicit steps, forces from the energy's first derivative. The error is that of the forces against
central differences of the energy, both in double precision.
"""

import numpy as np
from movies import Movie

import warp as wp

# [s], [Pa], [Pa], [kg/m^3], [1/s]
DT, SHEAR, BULK, DENSITY, DRAG = 1.0 / 3600.0, 2.2e4, 6.0e4, 1000.0, 1.2
PALETTE = (
    (0.9, 0.12, 0.1),
    (0.98, 0.55, 0.05),
    (0.15, 0.6, 0.2),
    (0.1, 0.35, 0.8),
    (0.6, 0.2, 0.7),
)


@wp.func
def shape_of(x: wp.array[wp.vec3d], t: wp.vec4i):
    """The edges of a tetrahedron as columns."""
    return wp.matrix_from_cols(x[t[1]] - x[t[0]], x[t[2]] - x[t[0]], x[t[3]] - x[t[0]])


@wp.kernel
def rest(
    x: wp.array[wp.vec3d],
    tets: wp.array[wp.vec4i],
    inverse: wp.array[wp.mat33d],
    volume: wp.array[wp.float64],
    mass: wp.array[wp.float64],
    density: wp.float64,
):
    n = wp.tid()
    d = shape_of(x, tets[n])
    inverse[n] = wp.inverse(d)
    volume[n] = wp.determinant(d) / wp.float64(6.0)
    for k in range(4):
        wp.atomic_add(mass, tets[n][k], density * volume[n] / wp.float64(4.0))


@wp.kernel
def elastic(
    x: wp.array[wp.vec3d],
    tets: wp.array[wp.vec4i],
    inverse: wp.array[wp.mat33d],
    volume: wp.array[wp.float64],
    shear: wp.float64,
    bulk: wp.float64,
    force: wp.array[wp.vec3d],
    energy: wp.array[wp.float64],
):
    """Forces of the stable neo-Hookean energy of B. Smith et al., ACM TOG 37(2), 2018."""
    n = wp.tid()
    t = tets[n]
    f = shape_of(x, t) * inverse[n]
    one = wp.float64(1.0)
    squares = wp.ddot(f, f)
    j = wp.determinant(f)
    a = one + wp.float64(0.75) * shear / bulk
    c0 = wp.vec3d(f[0, 0], f[1, 0], f[2, 0])
    c1 = wp.vec3d(f[0, 1], f[1, 1], f[2, 1])
    c2 = wp.vec3d(f[0, 2], f[1, 2], f[2, 2])
    # The derivative of the determinant.
    area = wp.matrix_from_cols(wp.cross(c1, c2), wp.cross(c2, c0), wp.cross(c0, c1))
    stress = f * (shear * (one - one / (squares + one))) + area * (bulk * (j - a))
    h = -volume[n] * (stress * wp.transpose(inverse[n]))
    f1 = wp.vec3d(h[0, 0], h[1, 0], h[2, 0])
    f2 = wp.vec3d(h[0, 1], h[1, 1], h[2, 1])
    f3 = wp.vec3d(h[0, 2], h[1, 2], h[2, 2])
    wp.atomic_add(force, t[1], f1)
    wp.atomic_add(force, t[2], f2)
    wp.atomic_add(force, t[3], f3)
    wp.atomic_add(force, t[0], -(f1 + f2 + f3))
    if energy.shape[0] > 0:
        half = wp.float64(0.5)
        e = half * shear * (squares - wp.float64(3.0)) + half * bulk * (j - a) * (j - a)
        e -= half * shear * wp.log(squares + one)
        wp.atomic_add(energy, 0, volume[n] * e)


@wp.kernel
def touch(
    grid: wp.uint64,
    near: wp.array[wp.vec3],
    x: wp.array[wp.vec3d],
    v: wp.array[wp.vec3d],
    body: wp.array[int],
    mass: wp.array[wp.float64],
    reach: float,
    force: wp.array[wp.vec3d],
):
    """Points of different bodies push each other away; all rest on the floor."""
    i = wp.hash_grid_point_id(grid, wp.tid())
    push = wp.vec3d(wp.float64(0.0), wp.float64(-9.81), wp.float64(0.0))
    deep = -x[i][1]
    if deep > wp.float64(0.0):
        up = wp.float64(4.0e4) * deep - wp.float64(40.0) * wp.min(v[i][1], wp.float64(0.0))
        slide = wp.vec3d(v[i][0], wp.float64(0.0), v[i][2])
        grip = wp.min(
            wp.float64(0.6) * up / (wp.length(slide) + wp.float64(1.0e-4)), wp.float64(400.0)
        )
        push += wp.vec3d(wp.float64(0.0), up, wp.float64(0.0)) - grip * slide
    query = wp.hash_grid_query(grid, near[i], reach)
    j = int(0)
    while wp.hash_grid_query_next(query, j):
        if body[j] != body[i]:
            apart = x[i] - x[j]
            d = wp.length(apart)
            gap = wp.float64(reach) - d
            if gap > wp.float64(0.0) and d > wp.float64(0.0):
                n = apart / d
                closing = wp.min(wp.dot(v[i] - v[j], n), wp.float64(0.0))
                push += n * (wp.float64(3.0e4) * gap - wp.float64(20.0) * closing)
    force[i] = force[i] + mass[i] * push


@wp.kernel
def move(
    x: wp.array[wp.vec3d],
    v: wp.array[wp.vec3d],
    force: wp.array[wp.vec3d],
    mass: wp.array[wp.float64],
    dt: wp.float64,
    keep: wp.float64,
    near: wp.array[wp.vec3],
):
    i = wp.tid()
    v[i] = keep * (v[i] + force[i] * (dt / mass[i]))
    x[i] = x[i] + v[i] * dt
    near[i] = wp.vec3(x[i])
    force[i] = wp.vec3d()


def ball(cells):
    """Tetrahedra of a ball: a cube's, of which each cell has six, drawn to a sphere."""
    n = cells + 1
    index = np.arange(n**3).reshape(n, n, n)
    at = np.linspace(-1.0, 1.0, n)
    p = np.stack(np.meshgrid(at, at, at, indexing="ij"), axis=-1).reshape(-1, 3)
    most = np.abs(p).max(axis=1, keepdims=True)
    p = p * np.where(
        most > 0.0, most / np.maximum(np.linalg.norm(p, axis=1, keepdims=True), 1e-9), 1
    )
    # From corner to corner, by all orders of the axes.
    parts = []
    for order in ((0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)):
        corner, path = np.zeros(3, int), []
        for axis in (*order, None):
            i, j, k = corner
            path.append(index[i : i + cells, j : j + cells, k : k + cells].reshape(-1))
            if axis is not None:
                corner[axis] = 1
        parts.append(np.stack(path, axis=1))
    tets = np.concatenate(parts)
    d = p[tets[:, 1:]] - p[tets[:, :1]]
    flip = np.linalg.det(d) < 0.0
    tets[flip] = tets[flip][:, [0, 2, 1, 3]]
    return p, tets


def skin(tets):
    """The faces that one tetrahedron has alone, seen from outside."""
    faces = np.concatenate([tets[:, f] for f in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))])
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return faces[first[count == 1]]


class Bodies:
    """All bodies in one set of arrays."""

    def __init__(self, count, cells, device):
        points, tets = ball(cells)
        rng, self.count, self.each = np.random.default_rng(4), count, len(points)
        starts, every = [], []
        for number in range(count):
            place = [0.62 * np.cos(2.4 * number), 0.75 + 0.62 * number, 0.62 * np.sin(2.4 * number)]
            turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
            turn *= np.sign(np.linalg.det(turn))
            starts.append(points @ turn.T * rng.uniform(0.38, 0.5) + place)
            every.append(tets + number * len(points))
        options = {"device": device}
        self.device, self.faces = device, skin(tets)
        self.x = wp.array(np.concatenate(starts), dtype=wp.vec3d, **options)
        self.tets = wp.array(np.concatenate(every).astype(np.int32), dtype=wp.vec4i, **options)
        n, m = len(self.x), len(self.tets)
        self.v, self.force = (wp.zeros(n, dtype=wp.vec3d, **options) for _ in range(2))
        self.near = wp.array(self.x.numpy(), dtype=wp.vec3, **options)
        self.body = wp.array(np.repeat(np.arange(count), len(points)), dtype=int, **options)
        self.mass = wp.zeros(n, dtype=wp.float64, **options)
        self.inverse = wp.zeros(m, dtype=wp.mat33d, **options)
        self.volume = wp.zeros(m, dtype=wp.float64, **options)
        self.none = wp.zeros(0, dtype=wp.float64, **options)
        self.grid = wp.HashGrid(48, 48, 48, device=device)
        self.reach = 1.15 * 0.5 * 2.0 / cells * 0.8
        outputs = [self.inverse, self.volume, self.mass, DENSITY]
        wp.launch(rest, m, [self.x, self.tets], outputs, **options)

    def stretch(self, energy):
        inputs = [self.x, self.tets, self.inverse, self.volume, SHEAR, BULK, self.force, energy]
        wp.launch(elastic, len(self.tets), inputs, device=self.device)

    def advance(self, steps):
        keep = float(np.exp(-DRAG * DT))
        for step in range(steps):
            if step % 8 == 0:
                self.grid.build(self.near, self.reach)
            self.stretch(self.none)
            inputs = [self.grid.id, self.near, self.x, self.v, self.body, self.mass, self.reach]
            wp.launch(touch, len(self.x), [*inputs, self.force], device=self.device)
            inputs = [self.x, self.v, self.force, self.mass, DT, keep, self.near]
            wp.launch(move, len(self.x), inputs, device=self.device)

    def force_error(self, step=1e-6):
        """The relative error of the forces along a direction against differences of the energy."""
        begin, rng = self.x.numpy().copy(), np.random.default_rng(0)
        along, bent = rng.normal(size=begin.shape), begin + 0.02 * rng.normal(size=begin.shape)
        energy = wp.zeros(1, dtype=wp.float64, device=self.device)
        values = []
        for sign in (1.0, -1.0):
            self.x.assign(bent + sign * step * along)
            energy.zero_()
            self.stretch(energy)
            values.append(energy.numpy()[0])
        self.x.assign(bent)
        self.force.zero_()
        self.stretch(self.none)
        slope = -(self.force.numpy() * along).sum()
        self.x.assign(begin)
        self.force.zero_()
        return abs(slope - (values[0] - values[1]) / (2.0 * step)) / abs(slope)


def main():
    movie = Movie("soft_bodies", __doc__, frames=36, samples=6, fps=12.0, still=11)
    scene, device = movie.scene, movie.device
    bodies = Bodies(movie.count(10), 6, device)
    error = bodies.force_error()
    floor = {"color": (0.82, 0.8, 0.78), "roughness": 0.35, "checker": 0.6}
    scene.add_height_field(np.full((2, 2), -0.01), (-300, -300), (300, 300), **floor)
    meshes = []
    for number in range(bodies.count):
        rows = bodies.x.numpy()[number * bodies.each : (number + 1) * bodies.each]
        color = PALETTE[number % len(PALETTE)]
        meshes.append(scene.add_mesh(rows, bodies.faces, color=color, roughness=0.18))
    scene.set_sky(sun=(0.5, 0.8, 0.6), power=5.0, size=2.5)
    scene.set_camera((0.6, 1.7, 5.2), (0.0, 0.75, 0.0), fov=36.0)
    steps = 220
    bodies.advance(movie.count(300))
    for _ in range(movie.frames):
        movie.timed(lambda: bodies.advance(steps))
        rows = bodies.x.numpy()
        for number, mesh in enumerate(meshes):
            mesh.mesh.update(rows[number * bodies.each : (number + 1) * bodies.each])
        movie.add()
    rate = steps * movie.frames * len(bodies.tets) / movie.work / 1e6
    movie.finish(rate, "M tetrahedra a second", error, "error of forces")


if __name__ == "__main__":
    main()
