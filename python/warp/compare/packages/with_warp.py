"""Programs by Warp's interface: of this package and of the one whose interface it has."""

import functools

import numpy as np
from packages import Run

import warp as wp

wp.config.quiet = True
VERSION = f"warp {wp.__version__}"
TILE = 32
# A module for each kernel, so that a process compiles the one that it runs.
kernel = functools.partial(wp.kernel, module="unique")


@kernel
def saxpy(x: wp.array(dtype=float), y: wp.array(dtype=float), a: float, out: wp.array(dtype=float)):
    i = wp.tid()
    out[i] = a * x[i] + y[i]


@kernel
def elementary(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    i = wp.tid()
    a = x[i]
    out[i] = wp.sin(a) * wp.exp(-a * a) + wp.sqrt(a + 4.0) + wp.log(1.0 + a * a)


@kernel
def total(x: wp.array(dtype=float), out: wp.array(dtype=float)):
    wp.atomic_add(out, 0, x[wp.tid()])


@kernel
def nbody(x: wp.array(dtype=wp.vec3), softening: float, out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    here = x[i]
    force = wp.vec3()
    for j in range(x.shape[0]):
        d = x[j] - here
        r2 = wp.dot(d, d) + softening
        force += d * (1.0 / (r2 * wp.sqrt(r2)))
    out[i] = force


@kernel
def springs(
    x: wp.array(dtype=wp.vec3),
    first: wp.array(dtype=int),
    second: wp.array(dtype=int),
    rest: wp.array(dtype=float),
    stiffness: float,
    out: wp.array(dtype=wp.vec3),
):
    t = wp.tid()
    i = first[t]
    j = second[t]
    d = x[j] - x[i]
    length = wp.length(d)
    force = d * (stiffness * (length - rest[t]) / length)
    wp.atomic_add(out, i, force)
    wp.atomic_sub(out, j, force)


@kernel
def mandelbrot(
    cx: wp.array2d(dtype=float),
    cy: wp.array2d(dtype=float),
    most: int,
    out: wp.array2d(dtype=float),
):
    i, j = wp.tid()
    u = cx[i, j]
    v = cy[i, j]
    x = float(0.0)
    y = float(0.0)
    k = int(0)
    while k < most and x * x + y * y < 4.0:
        t = x * x - y * y + u
        y = 2.0 * x * y + v
        x = t
        k = k + 1
    out[i, j] = float(k)


@kernel
def matrices(m: wp.array(dtype=wp.mat33), b: wp.array(dtype=wp.vec3), out: wp.array(dtype=wp.vec3)):
    i = wp.tid()
    a = m[i]
    out[i] = wp.inverse(a) * b[i] + wp.transpose(a) * b[i] * wp.determinant(a)


@kernel
def neohooke(f: wp.array(dtype=wp.mat33), mu: float, lam: float, out: wp.array(dtype=float)):
    i = wp.tid()
    a = f[i]
    log = wp.log(wp.determinant(a))
    out[i] = 0.5 * mu * (wp.ddot(a, a) - 3.0) - mu * log + 0.5 * lam * log * log


@kernel
def heat(u: wp.array2d(dtype=float), rate: float, out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    n = u.shape[0]
    up = wp.where(i == 0, n - 1, i - 1)
    down = wp.where(i == n - 1, 0, i + 1)
    left = wp.where(j == 0, n - 1, j - 1)
    right = wp.where(j == n - 1, 0, j + 1)
    around = u[up, j] + u[down, j] + u[i, left] + u[i, right]
    out[i, j] = u[i, j] + rate * (around - 4.0 * u[i, j])


@kernel
def product(a: wp.array2d(dtype=float), b: wp.array2d(dtype=float), out: wp.array2d(dtype=float)):
    i, j = wp.tid()
    s = wp.tile_zeros(shape=(TILE, TILE), dtype=float)
    for k in range(a.shape[1] // TILE):
        p = wp.tile_load(a, shape=(TILE, TILE), offset=(i * TILE, k * TILE))
        q = wp.tile_load(b, shape=(TILE, TILE), offset=(k * TILE, j * TILE))
        wp.tile_matmul(p, q, s)
    wp.tile_store(out, s, offset=(i * TILE, j * TILE))


@kernel
def pendulum(
    angle: wp.array(dtype=float),
    speed: wp.array(dtype=float),
    steps: int,
    dt: float,
    out: wp.array(dtype=float),
):
    i = wp.tid()
    a = angle[i]
    s = speed[i]
    for _ in range(steps):
        s = s - dt * wp.sin(a)
        a = a + dt * s
    out[i] = a


@kernel
def neighbours(
    x: wp.array(dtype=wp.vec3), first: wp.array(dtype=int), side: int, out: wp.array(dtype=float)
):
    i = wp.tid()
    here = x[i]
    cx = int(here[0])
    cy = int(here[1])
    cz = int(here[2])
    s = float(0.0)
    for ix in range(wp.max(cx - 1, 0), wp.min(cx + 2, side)):
        for iy in range(wp.max(cy - 1, 0), wp.min(cy + 2, side)):
            for iz in range(wp.max(cz - 1, 0), wp.min(cz + 2, side)):
                cell = (ix * side + iy) * side + iz
                for j in range(first[cell], first[cell + 1]):
                    d = here - x[j]
                    q = 1.0 - wp.dot(d, d)
                    if q > 0.0:
                        s += q * q * q
    out[i] = s


@kernel
def histogram(x: wp.array(dtype=float), bins: int, out: wp.array(dtype=float)):
    wp.atomic_add(out, int(wp.floor(x[wp.tid()] * float(bins))), 1.0)


class Made:
    """Arrays of a program: inputs on the device, the result, and how it is launched."""

    def __init__(self, inputs, wrt, device):
        self.device, self.inputs = device, {}
        for name, value in inputs.items():
            if isinstance(value, np.ndarray):
                dtype = float if value.dtype == np.float32 else int
                if value.ndim == 2 and value.shape[1] == 3:
                    dtype = wp.vec3
                if value.ndim == 3:
                    dtype = wp.mat33
                value = wp.array(value, dtype=dtype, device=device, requires_grad=name == wrt)
            self.inputs[name] = value

    def result(self, shape, dtype=float):
        return wp.zeros(shape, dtype=dtype, device=self.device, requires_grad=True)


def one_launch(function, key, dtype=float, shape=None, zero=False):
    """A program of one launch, with a thread for each element of the input `key`."""

    def build(made):
        inputs = made.inputs
        dim = inputs[key].shape
        out = made.result(shape(inputs) if shape else dim, dtype)

        def launch(recorded):
            if zero:
                out.zero_()
            wp.launch(
                function, dim, inputs=list(inputs.values()), outputs=[out], device=made.device
            )

        return launch, lambda: out

    return build


def heat_steps(made):
    u, steps, rate = made.inputs.values()
    kept = [u, *(made.result(u.shape) for _ in range(steps))]
    pair = [wp.empty_like(u, requires_grad=False) for _ in range(2)]

    def launch(recorded):
        for k in range(steps):
            source, target = (
                (kept[k], kept[k + 1]) if recorded else (pair[(k + 1) % 2], pair[k % 2])
            )
            source = u if k == 0 else source
            wp.launch(heat, u.shape, [source, rate], [target], device=made.device)
        last[0] = kept[-1] if recorded else pair[(steps - 1) % 2]

    last = [kept[-1]]
    return launch, lambda: last[0]


def tiles(made):
    a, b = made.inputs.values()
    out = made.result(a.shape)
    dim = (a.shape[0] // TILE, b.shape[1] // TILE)

    def launch(recorded):
        wp.launch_tiled(
            product, dim=dim, inputs=[a, b], outputs=[out], block_dim=128, device=a.device
        )

    return launch, lambda: out


PROGRAMS = {
    "saxpy": (one_launch(saxpy, "x"), "x"),
    "elementary": (one_launch(elementary, "x"), "x"),
    "total": (one_launch(total, "x", shape=lambda inputs: 1, zero=True), "x"),
    "nbody": (one_launch(nbody, "x", wp.vec3), "x"),
    "springs": (
        one_launch(springs, "i", wp.vec3, shape=lambda inputs: inputs["x"].shape, zero=True),
        "x",
    ),
    "mandelbrot": (one_launch(mandelbrot, "cx"), None),
    "matrices": (one_launch(matrices, "m", wp.vec3), "m"),
    "neohooke": (one_launch(neohooke, "f"), "f"),
    "heat": (heat_steps, "u"),
    "product": (tiles, "a"),
    "pendulum": (one_launch(pendulum, "angle"), "angle"),
    "neighbours": (one_launch(neighbours, "x"), "x"),
    "histogram": (one_launch(histogram, "x", shape=lambda inputs: inputs["bins"], zero=True), None),
}


def build(name, inputs, weights, device):
    maker, wrt = PROGRAMS[name]
    inputs = {key: value for key, value in inputs.items() if (name, key) != ("neighbours", "most")}
    made = Made(inputs, wrt, device)
    launch, out = maker(made)

    def forward():
        launch(False)
        wp.synchronize_device(device)

    if wrt is None:
        return Run(forward, lambda: out().numpy())
    source = made.inputs[wrt]
    seed = wp.array(weights, dtype=out().dtype, device=device)

    def backward():
        tape = wp.Tape()
        with tape:
            launch(True)
        source.grad.zero_()
        tape.backward(grads={out(): seed})
        gradient[0] = source.grad
        wp.synchronize_device(device)

    gradient = [None]
    return Run(forward, lambda: out().numpy(), backward, lambda: gradient[0].numpy())
