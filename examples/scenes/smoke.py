"""Smoke that rises from a glowing ring past a ball: the incompressible flow of a gas on a grid.

    python examples/scenes/smoke.py [--device cpu] [--frames 24] [--scale 1.0]

Semi-Lagrangian advection, buoyancy and a projection by conjugate gradients. The error is the
divergence that the projection leaves, over the one that it found.
"""

import numpy as np
from movies import Movie

import warp as wp
import warp.sparse
from warp.optim import linear

# [s]; lengths are in cells, and LIFT is for 56 cells in a unit of length.
DT, LIFT, SUBSTEPS = 0.8, 0.16, 3


@wp.func
def sample(field: wp.array3d[wp.vec4], p: wp.vec3):
    """Trilinear, repeating what is at the border."""
    n = wp.vec3(float(field.shape[0]), float(field.shape[1]), float(field.shape[2]))
    q = wp.vec3(
        wp.clamp(p[0], 0.0, n[0] - 1.001),
        wp.clamp(p[1], 0.0, n[1] - 1.001),
        wp.clamp(p[2], 0.0, n[2] - 1.001),
    )
    i = int(q[0])
    j = int(q[1])
    k = int(q[2])
    total = wp.vec4()
    for a in range(2):
        for b in range(2):
            for c in range(2):
                x = wp.where(a == 1, q[0] - float(i), 1.0 - q[0] + float(i))
                y = wp.where(b == 1, q[1] - float(j), 1.0 - q[1] + float(j))
                z = wp.where(c == 1, q[2] - float(k), 1.0 - q[2] + float(k))
                total += field[i + a, j + b, k + c] * (x * y * z)
    return total


@wp.func
def speed_of(value: wp.vec4):
    return wp.vec3(value[0], value[1], value[2])


@wp.kernel
def advect(
    field: wp.array3d[wp.vec4],
    ball: wp.vec4,
    t: float,
    dt: float,
    lift: float,
    out: wp.array3d[wp.vec4],
):
    """Velocity and smoke, carried along; heat lifts, a ring feeds, a ball stands in the way.

    Smoke thins out in front of the walls.
    """
    i, j, k = wp.tid()
    p = wp.vec3(float(i), float(j), float(k))
    half = p - 0.5 * dt * speed_of(field[i, j, k])
    value = sample(field, p - dt * speed_of(sample(field, half)))
    n = 0.5 * float(field.shape[1])
    x = p - wp.vec3(0.5 * float(field.shape[0]), 0.1 * n, 0.5 * float(field.shape[2]))
    ring = wp.sqrt(x[0] * x[0] + x[2] * x[2]) - 0.15 * n
    near = wp.exp(-(ring * ring + x[1] * x[1]) / (0.0016 * n * n))
    puff = 0.7 + 0.3 * wp.sin(0.35 * t + 3.0 * wp.atan2(x[2], x[0]))
    smoke = wp.max(value[3] * (1.0 - 0.004 * dt), near * puff)
    up = value[1] + dt * lift * value[3] * (1.0 + 0.25 * wp.sin(0.21 * t))
    aside = 0.19 * lift * dt * wp.sin(0.13 * t) * value[3]
    v = wp.vec3(value[0] + aside, up, value[2])
    wall = wp.min(0.5 * float(field.shape[0]) - wp.max(wp.abs(x[0]), wp.abs(x[2])), 2.0 * n - p[1])
    smoke *= 1.0 - 0.25 * wp.clamp(1.0 - wall / (0.15 * n), 0.0, 1.0)
    if wp.length(p - wp.vec3(ball[0], ball[1], ball[2])) < ball[3]:
        v = wp.vec3()
        smoke = 0.0
    out[i, j, k] = wp.vec4(v[0], v[1], v[2], smoke)


@wp.func
def at(field: wp.array3d[wp.vec4], i: int, j: int, k: int, axis: int):
    """A component of the velocity, zero outside."""
    n = field.shape
    found = float(0.0)
    if i >= 0 and j >= 0 and k >= 0 and i < n[0] and j < n[1] and k < n[2]:
        found = field[i, j, k][axis]
    return found


@wp.kernel
def divergence(field: wp.array3d[wp.vec4], out: wp.array[float]):
    i, j, k = wp.tid()
    d = at(field, i + 1, j, k, 0) - at(field, i - 1, j, k, 0)
    d += at(field, i, j + 1, k, 1) - at(field, i, j - 1, k, 1)
    d += at(field, i, j, k + 1, 2) - at(field, i, j, k - 1, 2)
    out[(i * field.shape[1] + j) * field.shape[2] + k] = -0.5 * d


@wp.func
def pressure_at(p: wp.array3d[float], i: int, j: int, k: int):
    found = float(0.0)
    if i >= 0 and j >= 0 and k >= 0 and i < p.shape[0] and j < p.shape[1] and k < p.shape[2]:
        found = p[i, j, k]
    return found


@wp.kernel
def laplacian(
    p: wp.array3d[float],
    y: wp.array3d[float],
    alpha: float,
    beta: float,
    out: wp.array3d[float],
):
    """alpha A p + beta y: what the divergence of the gradient, both central, does to p."""
    i, j, k = wp.tid()
    total = 6.0 * p[i, j, k]
    total -= pressure_at(p, i - 2, j, k) + pressure_at(p, i + 2, j, k)
    total -= pressure_at(p, i, j - 2, k) + pressure_at(p, i, j + 2, k)
    total -= pressure_at(p, i, j, k - 2) + pressure_at(p, i, j, k + 2)
    # Beyond the border the gradient counts one-sidedly.
    ends = int(0)
    ends += wp.where(i < 1 or i > p.shape[0] - 2, 1, 0)
    ends += wp.where(j < 1 or j > p.shape[1] - 2, 1, 0)
    ends += wp.where(k < 1 or k > p.shape[2] - 2, 1, 0)
    total -= float(ends) * p[i, j, k]
    value = 0.25 * alpha * total
    if beta != 0.0:
        value += beta * y[i, j, k]
    out[i, j, k] = value


@wp.kernel
def project(p: wp.array3d[float], field: wp.array3d[wp.vec4]):
    i, j, k = wp.tid()
    v = field[i, j, k]
    x = 0.5 * (pressure_at(p, i + 1, j, k) - pressure_at(p, i - 1, j, k))
    y = 0.5 * (pressure_at(p, i, j + 1, k) - pressure_at(p, i, j - 1, k))
    z = 0.5 * (pressure_at(p, i, j, k + 1) - pressure_at(p, i, j, k - 1))
    field[i, j, k] = wp.vec4(v[0] - x, v[1] - y, v[2] - z, v[3])


class Gas:
    """Velocity and smoke on a grid of height 2 n and width 1.5 n."""

    def __init__(self, n, device):
        self.width = 3 * n // 2
        self.shape, self.device, self.time = (self.width, 2 * n, self.width), device, 0.0
        middle = 0.5 * self.width
        self.ball = wp.vec4(middle + 0.02 * n, 0.75 * n, middle, 0.13 * n)
        self.field = [wp.zeros(self.shape, dtype=wp.vec4, device=device) for _ in range(2)]
        size = int(np.prod(self.shape))
        self.wrong = wp.zeros(size, dtype=float, device=device)
        self.pressure = wp.zeros(size, dtype=float, device=device)
        self.operator = linear.LinearOperator((size, size), float, device, self._apply)
        self.left = 0.0

    def _apply(self, x, y, z, alpha, beta):
        inputs = [x.reshape(self.shape), y.reshape(self.shape), alpha, beta]
        wp.launch(laplacian, self.shape, inputs, [z.reshape(self.shape)], device=self.device)

    def step(self):
        now, then = self.field
        # The same flow on any grid.
        lift = LIFT * self.shape[1] / 112.0
        inputs = [now, self.ball, self.time, DT, lift]
        wp.launch(advect, self.shape, inputs, [then], device=self.device)
        wp.launch(divergence, self.shape, [then], [self.wrong], device=self.device)
        before = np.abs(self.wrong.numpy()).max()
        linear.cg(self.operator, self.wrong, self.pressure, tol=1e-4, maxiter=150)
        grid = self.pressure.reshape(self.shape)
        wp.launch(project, self.shape, [grid], [then], device=self.device)
        wp.launch(divergence, self.shape, [then], [self.wrong], device=self.device)
        self.left = max(self.left, np.abs(self.wrong.numpy()).max() / max(before, 1e-12))
        self.field = [then, now]
        self.time += DT


def main():
    movie = Movie("smoke", __doc__, frames=30, samples=6, fps=10.0)
    scene, device = movie.scene, movie.device
    n = max(12, int(56 * movie.options.scale ** (1 / 3)))
    gas, cell = Gas(n, device), 1.0 / n
    for _ in range(110):
        gas.step()
    gas.left = 0.0

    def grid():
        smoke = np.ascontiguousarray(gas.field[0].numpy()[..., 3])
        smoke[smoke < 0.01] = 0.0
        low = (-0.5 * cell * gas.width, 0.0, -0.5 * cell * gas.width)
        return wp.Volume.load_from_numpy(smoke, low, cell, bg_value=0.0, device=device)

    floor = {"color": (0.3, 0.27, 0.25), "roughness": 0.45}
    scene.add_height_field(np.zeros((2, 2)), (-300, -300), (300, 300), **floor)
    ball = [cell * (gas.ball[k] - (0.0 if k == 1 else 0.5 * gas.width)) for k in range(3)]
    gold = {"color": (0.95, 0.62, 0.25), "metallic": 1.0, "roughness": 0.12}
    scene.add_spheres([ball], cell * gas.ball[3] * 0.94, **gold)
    turn = np.linspace(0.0, 2.0 * np.pi, 97)
    ring = np.stack([0.15 * np.cos(turn), 0 * turn + 0.03, 0.15 * np.sin(turn)], axis=1)
    scene.add_tubes([ring], 0.02, emission=(9.0, 3.0, 0.7))
    medium = scene.add_volume(grid(), 34.0, albedo=(0.93, 0.94, 0.96), asymmetry=0.3, most=1.0)
    scene.set_sky(sun=(0.85, 0.3, -0.35), power=8.0, size=2.0, haze=2.0)
    scene.set_camera((0.35, 0.55, 3.1), (0.0, 0.88, 0.0), fov=36.0)
    scene.depth = 6
    steps = 0
    for _ in range(movie.frames):
        for _ in range(SUBSTEPS):
            movie.timed(gas.step)
            steps += 1
        scene.replace_volume(medium, grid(), most=1.0)
        movie.add()
    rate = steps * np.prod(gas.shape) / movie.work / 1e6
    movie.finish(rate, "M cells a second", gas.left, "divergence left")


if __name__ == "__main__":
    main()
