"""A cloth falls over a turning knot: springs, friction, and the nearest point of a moving mesh.

    python examples/scenes/cloth_drape.py [--device cpu] [--frames 24] [--scale 1.0]

Position-based dynamics in small steps: one sweep over threads and diagonals each, in colours that
share no point. The error is the stretch that 999 of 1000 threads stay below, over their length.
"""

import numpy as np
from movies import Movie

import warp as wp

# [s], [m]
DT, KEEP, HALF, SPIN = 1.0 / 5760.0, 0.028, 1.4, 0.4
# Threads and diagonals, their lengths over a cell, and how much of an error a step removes.
THREADS = ((1, 1, 2.0**0.5, 0.3), (1, -1, 2.0**0.5, 0.3), (1, 0, 1.0, 1.0), (0, 1, 1.0, 1.0))


@wp.kernel
def predict(x: wp.array2d[wp.vec3], v: wp.array2d[wp.vec3], dt: float, p: wp.array2d[wp.vec3]):
    i, j = wp.tid()
    v[i, j] = (v[i, j] + wp.vec3(0.0, -9.81, 0.0) * dt) * 0.99994
    p[i, j] = x[i, j] + v[i, j] * dt


@wp.kernel
def shorten(p: wp.array2d[wp.vec3], a: int, b: int, parity: int, rest: float, stiff: float):
    """Moves both ends of threads along (a, b); threads of a parity share no point."""
    i, j = wp.tid()
    k = i + a
    n = j + b
    own = wp.where(a != 0, i, j) % 2 == parity
    if own and k < p.shape[0] and n >= 0 and n < p.shape[1]:
        d = p[k, n] - p[i, j]
        length = wp.length(d)
        shift = d * (0.5 * stiff * (length - rest) / wp.max(length, 1.0e-9))
        p[i, j] = p[i, j] + shift
        p[k, n] = p[k, n] - shift


@wp.kernel
def collide(
    mesh: wp.uint64,
    p: wp.array2d[wp.vec3],
    x: wp.array2d[wp.vec3],
    dt: float,
    keep: float,
    deep: wp.array[float],
):
    """Keeps the cloth off the mesh and the floor; it is dragged along by what it touches."""
    i, j = wp.tid()
    q = p[i, j]
    found = wp.mesh_query_point_sign_normal(mesh, q, 0.3)
    if found.result:
        at = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        away = q - at
        distance = wp.length(away) * found.sign
        wp.atomic_max(deep, 0, -distance)
        if distance < keep and wp.abs(distance) > 1.0e-7:
            n = away / distance
            push = keep - distance
            q = q + n * push
            slide = q - x[i, j] - wp.mesh_eval_velocity(mesh, found.face, found.u, found.v) * dt
            slide = slide - n * wp.dot(slide, n)
            q -= slide * wp.min(1.0, 2.5 * push / wp.max(wp.length(slide), 1.0e-7))
    if q[1] < 0.02:
        q = wp.vec3(x[i, j][0], 0.02, x[i, j][2])
    p[i, j] = q


@wp.kernel
def finish(p: wp.array2d[wp.vec3], dt: float, x: wp.array2d[wp.vec3], v: wp.array2d[wp.vec3]):
    i, j = wp.tid()
    v[i, j] = (p[i, j] - x[i, j]) / dt
    x[i, j] = p[i, j]


@wp.kernel
def turn(
    start: wp.array[wp.vec3], angle: float, spin: float, x: wp.array[wp.vec3], v: wp.array[wp.vec3]
):
    """The knot turns about the vertical axis."""
    i = wp.tid()
    s = start[i]
    c = wp.cos(angle)
    d = wp.sin(angle)
    x[i] = wp.vec3(c * s[0] + d * s[2], s[1], c * s[2] - d * s[0])
    v[i] = wp.vec3(x[i][2], 0.0, -x[i][0]) * spin


def knot(around=240, sides=28):
    """A trefoil's tube."""
    t = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    line = np.stack(
        [np.sin(t) + 2 * np.sin(2 * t), -np.sin(3 * t), np.cos(t) - 2 * np.cos(2 * t)], axis=1
    )
    line = line * [0.27, 0.3, 0.27] + [0, 0.62, 0]
    along = np.roll(line, -1, 0) - np.roll(line, 1, 0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 1.0, 0.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(side, along)
    a = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = np.cos(a)[None, :, None] * side[:, None] + np.sin(a)[None, :, None] * other[:, None]
    points = (line[:, None] + 0.17 * ring).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(sides), indexing="ij")
    here, right = i * sides + j, i * sides + (j + 1) % sides
    up, both = (i + 1) % around * sides + j, (i + 1) % around * sides + (j + 1) % sides
    faces = np.stack([here, right, both, here, both, up], axis=-1).reshape(-1, 3)
    a, b, c = (points[faces[:, k]] for k in range(3))
    if np.einsum("ni,ni->", a, np.cross(b, c)) < 0.0:
        faces = faces[:, ::-1]
    return points, np.ascontiguousarray(faces).reshape(-1)


def weave(size):
    """A picture of stripes for the cloth."""
    x, y = np.meshgrid(np.arange(size) / size, np.arange(size) / size)
    red, cream, navy = np.array([[0.55, 0.03, 0.05], [0.9, 0.82, 0.66], [0.03, 0.06, 0.2]])
    stripes = lambda t: (np.floor(t * 14) % 2)[..., None]  # noqa: E731
    cloth = red * (1 - 0.55 * stripes(x)) + 0.35 * navy * stripes(y)
    thin = (np.abs((x * 7) % 1 - 0.5) < 0.02) | (np.abs((y * 7) % 1 - 0.5) < 0.02)
    return np.where(thin[..., None], cream, cloth).astype(np.float32)


def main():
    movie = Movie("cloth_drape", __doc__, frames=30, samples=6, fps=10.0)
    scene, device = movie.scene, movie.device
    size = max(16, int(104 * movie.options.scale**0.5))
    at, rest = np.linspace(-HALF, HALF, size, retstep=True)
    start = np.stack(np.meshgrid(at, [1.32], at, indexing="ij"), axis=-1)[:, 0]
    x, p = (wp.array(start, dtype=wp.vec3, device=device) for _ in range(2))
    v = wp.zeros((size, size), dtype=wp.vec3, device=device)
    points, faces = knot()
    begin = wp.array(points, dtype=wp.vec3, device=device)
    body = wp.Mesh(wp.clone(begin), wp.array(faces, dtype=int, device=device), wp.zeros_like(begin))
    deep = wp.zeros(1, dtype=float, device=device)
    cells, time = (size, size), 0.0

    def step():
        nonlocal time
        time += DT
        inputs = [begin, SPIN * time, SPIN]
        wp.launch(turn, len(begin), inputs, [body.points, body.velocities], device=device)
        body.refit()
        wp.launch(predict, cells, [x, v, DT], [p], device=device)
        for a, b, length, stiff in THREADS:
            for parity in (0, 1):
                inputs = [p, a, b, parity, float(rest) * length, stiff]
                wp.launch(shorten, cells, inputs, device=device)
        wp.launch(collide, cells, [body.id, p, x, DT, KEEP, deep], device=device)
        wp.launch(finish, cells, [p, DT], [x, v], device=device)

    floor = {"color": (0.62, 0.6, 0.57), "roughness": 0.3, "checker": 0.5}
    scene.add_height_field(np.zeros((2, 2)), (-300, -300), (300, 300), **floor)
    gold = {"color": (0.98, 0.68, 0.3), "metallic": 1.0, "roughness": 0.16}
    shown = scene.add_mesh(points, faces, **gold)
    i, j = np.meshgrid(np.arange(size - 1), np.arange(size - 1), indexing="ij")
    a = i * size + j
    sheet = np.stack([a, a + 1, a + size + 1, a, a + size + 1, a + size], axis=-1).reshape(-1)
    uvs = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1).reshape(-1, 2) / (2 * HALF)
    silk = {"texture": weave(560), "color": (1, 1, 1), "roughness": 0.5, "specular": 0.03}
    cloth = scene.add_mesh(start.reshape(-1, 3), sheet, uvs=uvs, **silk)
    scene.set_sky(sun=(0.6, 0.7, 0.5), power=5.0, size=2.5)
    scene.set_camera((1.2, 1.9, 4.3), (0.0, 0.52, 0.0), fov=34.0)
    worst, steps = 0.0, 336
    for _ in range(1100):
        step()
    for _ in range(movie.frames):
        movie.timed(lambda: [step() for _ in range(steps)])
        assert deep.numpy()[0] < KEEP, "the cloth passes through the knot"
        shown.mesh.update(body.points)
        cloth.mesh.update(x.flatten())
        now = x.numpy().astype(float)
        threads = [np.linalg.norm(np.diff(now, axis=axis), axis=-1) for axis in (0, 1)]
        worst = max(worst, *(float(np.quantile(each, 0.999)) / rest - 1.0 for each in threads))
        movie.add()
    rate = steps * movie.frames * size * size / movie.work / 1e6
    movie.finish(rate, "M points a second", worst, "stretch of 999 in 1000 threads")


if __name__ == "__main__":
    main()
