"""Programs by Taichi or its successor Quadrants, whichever is installed."""

import numpy as np
from packages import Run

try:
    import quadrants as ti
except ModuleNotFoundError:
    import taichi as ti

NAME = ti.__name__
VERSION = f"{NAME} {'.'.join(map(str, ti.__version__))}"


@ti.kernel
def saxpy(x: ti.template(), y: ti.template(), a: ti.f32, out: ti.template()):
    for i in x:
        out[i] = a * x[i] + y[i]


@ti.kernel
def elementary(x: ti.template(), out: ti.template()):
    for i in x:
        a = x[i]
        out[i] = ti.sin(a) * ti.exp(-a * a) + ti.sqrt(a + 4.0) + ti.log(1.0 + a * a)


@ti.kernel
def total(x: ti.template(), out: ti.template()):
    for i in x:
        out[0] += x[i]


@ti.kernel
def nbody(x: ti.template(), softening: ti.f32, out: ti.template()):
    for i in x:
        for j in range(x.shape[0]):
            d = x[j] - x[i]
            r2 = d.dot(d) + softening
            out[i] += d * (1.0 / (r2 * ti.sqrt(r2)))


@ti.kernel
def springs(
    x: ti.template(),
    first: ti.template(),
    second: ti.template(),
    rest: ti.template(),
    stiffness: ti.f32,
    out: ti.template(),
):
    for t in first:
        i = first[t]
        j = second[t]
        d = x[j] - x[i]
        length = d.norm()
        force = d * (stiffness * (length - rest[t]) / length)
        out[i] += force
        out[j] -= force


@ti.kernel
def mandelbrot(cx: ti.template(), cy: ti.template(), most: ti.i32, out: ti.template()):
    for i, j in cx:
        x = 0.0
        y = 0.0
        k = 0
        while k < most and x * x + y * y < 4.0:
            t = x * x - y * y + cx[i, j]
            y = 2.0 * x * y + cy[i, j]
            x = t
            k += 1
        out[i, j] = float(k)


@ti.kernel
def matrices(m: ti.template(), b: ti.template(), out: ti.template()):
    for i in m:
        out[i] = m[i].inverse() @ b[i] + m[i].transpose() @ b[i] * m[i].determinant()


@ti.kernel
def neohooke(f: ti.template(), mu: ti.f32, lam: ti.f32, out: ti.template()):
    for i in f:
        log = ti.log(f[i].determinant())
        out[i] = 0.5 * mu * (f[i].norm_sqr() - 3.0) - mu * log + 0.5 * lam * log * log


@ti.kernel
def heat(u: ti.template(), t: ti.i32, rate: ti.f32):
    for i, j in ti.ndrange(u.shape[1], u.shape[2]):
        n = u.shape[1]
        up = u[t, (i + n - 1) % n, j] + u[t, (i + 1) % n, j]
        around = up + u[t, i, (j + n - 1) % n] + u[t, i, (j + 1) % n]
        u[t + 1, i, j] = u[t, i, j] + rate * (around - 4.0 * u[t, i, j])


@ti.kernel
def product(a: ti.template(), b: ti.template(), out: ti.template()):
    for i, j in out:
        for k in range(a.shape[1]):
            out[i, j] += a[i, k] * b[k, j]


@ti.kernel
def pendulum(
    angle: ti.template(), speed: ti.template(), steps: ti.template(), dt: ti.f32, out: ti.template()
):
    for i in angle:
        a = angle[i]
        s = speed[i]
        for _ in range(steps):
            s -= dt * ti.sin(a)
            a += dt * s
        out[i] = a


@ti.kernel
def neighbours(
    x: ti.template(),
    first: ti.template(),
    side: ti.template(),
    most: ti.template(),
    out: ti.template(),
):
    # Counts of loops are constants, which adjoints need.
    for i in x:
        corner = ti.cast(x[i], ti.i32) - 1
        for ix in range(3):
            for iy in range(3):
                for iz in range(3):
                    at = corner + ti.Vector([ix, iy, iz])
                    if at.min() >= 0 and at.max() < side:
                        cell = (at[0] * side + at[1]) * side + at[2]
                        for k in range(most):
                            j = first[cell] + k
                            if j < first[cell + 1]:
                                d = x[i] - x[j]
                                q = ti.max(1.0 - d.dot(d), 0.0)
                                out[i] += q * q * q


@ti.kernel
def histogram(x: ti.template(), bins: ti.i32, out: ti.template()):
    for i in x:
        out[ti.cast(ti.floor(x[i] * bins), ti.i32)] += 1.0


# Shape and components of results, by program: those of an input, or numbers.
RESULTS = {
    "saxpy": "x",
    "elementary": "x",
    "total": (1, 0),
    "nbody": "x",
    "springs": "x",
    "mandelbrot": "cx",
    "matrices": "b",
    "neohooke": "f",
    "heat": "u",
    "product": "a",
    "pendulum": "angle",
    "neighbours": "x",
    "histogram": (256, 0),
}
SCALAR = ("neohooke", "neighbours")
PROGRAMS = {name: globals()[name] for name in RESULTS}
WRT = {"matrices": "m", "neohooke": "f", "heat": "u", "product": "a", "pendulum": "angle"}


def field_of(values, gradient):
    """A field with values: of vectors where there are three to a row, of matrices of 3x3."""
    if values.dtype == np.int32:
        found = ti.field(ti.i32, values.shape)
    elif values.ndim == 3 and values.shape[1:] == (3, 3):
        found = ti.Matrix.field(3, 3, ti.f32, values.shape[:1], needs_grad=gradient)
    elif values.ndim == 2 and values.shape[1] == 3:
        found = ti.Vector.field(3, ti.f32, values.shape[:1], needs_grad=gradient)
    else:
        found = ti.field(ti.f32, values.shape, needs_grad=gradient)
    found.from_numpy(values)
    return found


class Layers:
    """The first or last layer of a field of all steps in time."""

    def __init__(self, field, layer):
        self.field, self.layer = field, layer

    def to_numpy(self):
        return self.field.to_numpy()[self.layer]


def heat_stages(given):
    """The launches of all steps, and what holds the result, its adjoint and the gradient."""
    u, steps = given["u"], given["steps"]
    kept = ti.field(ti.f32, (steps + 1, *u.shape), needs_grad=True)
    values = np.zeros(kept.shape, np.float32)
    values[0] = u.to_numpy()
    kept.from_numpy(values)
    return [(kept, t, given["rate"]) for t in range(steps)], kept


def build(name, inputs, weights, device):
    arch = ti.cpu if device == "cpu" else ti.cuda
    # Loops inside of threads have adjoints in Quadrants alone, on request.
    stack = {"ad_stack_experimental_enabled": True} if NAME == "quadrants" else {}
    ti.init(arch=arch, offline_cache=False, log_level=ti.ERROR, **stack)
    wrt = WRT.get(name, "x") if weights is not None else None
    given = {
        key: field_of(value, wrt is not None) if isinstance(value, np.ndarray) else value
        for key, value in inputs.items()
    }
    kernel = PROGRAMS[name]
    if name == "heat":
        stages, out = heat_stages(given)
        source, result, gradient = out, Layers(out, -1), Layers(out.grad, 0)
        seeds = np.zeros(out.shape, np.float32)
        seeds[-1] = weights
    else:
        shape = RESULTS[name]
        numbers = isinstance(shape, tuple)
        like = np.zeros(shape[0], np.float32) if numbers else np.zeros_like(inputs[shape])
        like = like.reshape(len(like), -1)[:, 0].copy() if name in SCALAR else like
        out, source, seeds = field_of(like, wrt is not None), given.get(wrt), weights
        stages, result = [(*given.values(), out)], out
        gradient = source.grad if wrt else None
    adds = name in ("total", "nbody", "springs", "product", "neighbours", "histogram")

    def forward():
        if adds:
            out.fill(0.0)
        for stage in stages:
            kernel(*stage)
        ti.sync()

    if weights is None:
        return Run(forward, result.to_numpy)
    seed = field_of(seeds, False)

    def backward():
        forward()
        source.grad.fill(0.0)
        out.grad.copy_from(seed)
        for stage in reversed(stages):
            kernel.grad(*stage)
        ti.sync()

    return Run(forward, result.to_numpy, backward, gradient.to_numpy)
