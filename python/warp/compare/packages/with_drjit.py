"""Programs by Dr.Jit: wide expressions that are traced and compiled as one kernel."""

import drjit as dr
import numpy as np
from packages import Run

VERSION = f"drjit {dr.__version__}"


def saxpy(p, x, y, a):
    return a * x + y


def elementary(p, x):
    return dr.sin(x) * dr.exp(-x * x) + dr.sqrt(x + 4.0) + dr.log(1.0 + x * x)


def total(p, x):
    return dr.sum(x)


def gather3(p, x, index):
    return p.Array3f(*(dr.gather(p.Float, x[k], index) for k in range(3)))


@dr.syntax
def nbody(p, x, softening):
    n = dr.width(x)
    j = p.UInt(0)
    force = p.Array3f(dr.zeros(p.Float, n))
    while dr.hint(j < n, max_iterations=-1):
        d = gather3(p, x, j) - x
        r2 = dr.squared_norm(d) + softening
        force += d / (r2 * dr.sqrt(r2))
        j += 1
    return force


def springs(p, x, i, j, rest, stiffness):
    d = gather3(p, x, j) - gather3(p, x, i)
    length = dr.norm(d)
    force = d * (stiffness * (length - rest) / length)
    out = []
    for k in range(3):
        one = dr.zeros(p.Float, dr.width(x))
        dr.scatter_add(one, force[k], i)
        dr.scatter_add(one, -force[k], j)
        out.append(one)
    return p.Array3f(*out)


@dr.syntax
def mandelbrot(p, cx, cy, most):
    x, y, k = cx * 0.0, cx * 0.0, cx * 0.0
    while (k < most) & (x * x + y * y < 4.0):
        x, y = x * x - y * y + cx, 2.0 * x * y + cy
        k += 1.0
    return k


def rows(p, m):
    a, b, c = m
    bc, ca, ab = dr.cross(b, c), dr.cross(c, a), dr.cross(a, b)
    return bc, ca, ab, dr.dot(a, bc)


def matrices(p, m, b):
    bc, ca, ab, det = rows(p, m)
    solved = (bc * b.x + ca * b.y + ab * b.z) / det
    return solved + (m[0] * b.x + m[1] * b.y + m[2] * b.z) * det


def neohooke(p, f, mu, lam):
    log = dr.log(rows(p, f)[3])
    squares = sum(dr.squared_norm(row) for row in f)
    return 0.5 * mu * (squares - 3.0) - mu * log + 0.5 * lam * log * log


def heat(p, u, steps, rate, columns):
    n = dr.width(u)
    at = dr.arange(p.UInt, n)
    i, j = at // columns, at % columns
    last = columns - 1
    up = dr.select(i == 0, last, i - 1) * columns + j
    down = dr.select(i == last, 0, i + 1) * columns + j
    left = i * columns + dr.select(j == 0, last, j - 1)
    right = i * columns + dr.select(j == last, 0, j + 1)
    dr.eval(up, down, left, right)
    for _ in range(steps):
        around = sum(dr.gather(p.Float, u, k) for k in (up, down, left, right))
        u = u + rate * (around - 4.0 * u)
        # Neighbours are read from memory.
        dr.eval(u)
    return u


@dr.syntax
def pendulum(p, angle, speed, steps, dt):
    a, s, k = p.Float(angle), p.Float(speed), p.UInt(0)
    while dr.hint(k < steps, max_iterations=steps):
        s = s - dt * dr.sin(a)
        a = a + dt * s
        k += 1
    return a


@dr.syntax
def neighbours(p, x, first, side, most):
    own = [p.Int(dr.detach(x[k])) for k in range(3)]
    density, step = dr.zeros(p.Float, dr.width(x)), p.Int(0)
    # One loop over cells and their points, since each loop is compiled with its adjoint.
    while dr.hint(step < 27 * most, max_iterations=-1):
        offset = step // most
        at = [own[0] + offset // 9 - 1, own[1] + offset // 3 % 3 - 1, own[2] + offset % 3 - 1]
        inside = (at[0] >= 0) & (at[0] < side) & (at[1] >= 0) & (at[1] < side)
        inside &= (at[2] >= 0) & (at[2] < side)
        cell = (at[0] * side + at[1]) * side + at[2]
        j = dr.gather(p.Int, first, cell, inside) + step % most
        there = inside & (j < dr.gather(p.Int, first, cell + 1, inside))
        d = gather3(p, x, p.UInt(dr.select(there, j, 0))) - x
        q = dr.maximum(1.0 - dr.squared_norm(d), 0.0)
        density += dr.select(there, q * q * q, 0.0)
        step += 1
    return density


def histogram(p, x, bins):
    out = dr.zeros(p.Float, bins)
    dr.scatter_add(out, p.Float(1.0), p.UInt(dr.floor(x * bins)))
    return out


WRT = {
    "matrices": "m",
    "neohooke": "f",
    "heat": "u",
    "pendulum": "angle",
    "mandelbrot": None,
    "histogram": None,
}
# Products of matrices are left to other libraries.
PROGRAMS = {
    each.__name__: each
    for each in (saxpy, elementary, total, nbody, springs, mandelbrot, matrices, neohooke)
}
PROGRAMS |= {each.__name__: each for each in (heat, pendulum, neighbours, histogram)}


def wide(p, value):
    """An array by components: three vectors, rows of matrices, or one wide scalar."""
    if value.ndim == 3 and value.shape[1:] == (3, 3):
        return [wide(p, np.ascontiguousarray(value[:, k])) for k in range(3)]
    if value.ndim == 2 and value.shape[1] == 3:
        return p.Array3f(*(p.Float(np.ascontiguousarray(value[:, k])) for k in range(3)))
    if value.dtype == np.int32:
        return p.Int(value.ravel())
    return p.Float(np.ascontiguousarray(value.ravel()))


def narrow(value):
    """The array of a result."""
    if isinstance(value, list):
        return np.stack([narrow(row) for row in value], 1)
    found = np.array(value)
    return found.T if found.ndim == 2 else found


def build(name, inputs, weights, device):
    p = dr.llvm.ad if device == "cpu" else dr.cuda.ad
    given = {k: wide(p, v) if isinstance(v, np.ndarray) else v for k, v in inputs.items()}
    if name == "springs":
        given |= {key: p.UInt(given[key]) for key in "ij"}
    if name == "heat":
        given["columns"] = inputs["u"].shape[1]
    wrt, held = WRT.get(name, "x"), {}
    function = PROGRAMS[name]
    shape = [None]
    dr.eval(*(one for one in given.values() if not isinstance(one, (int, float))))

    def forward():
        held["result"] = function(p, **given)
        dr.eval(held["result"])
        dr.sync_thread()

    def result():
        found = narrow(held["result"])
        return found.reshape(shape[0]) if shape[0] else found

    if name in ("mandelbrot", "heat"):
        shape[0] = inputs["cx" if name == "mandelbrot" else "u"].shape
    if weights is None:
        return Run(forward, result)
    seed = wide(p, weights)

    def backward():
        # A leaf of its own in each run.
        source = (
            p.Float(given[wrt])
            if isinstance(given[wrt], p.Float)
            else (
                [p.Array3f(row) for row in given[wrt]]
                if isinstance(given[wrt], list)
                else p.Array3f(given[wrt])
            )
        )
        dr.enable_grad(source)
        found = function(p, **{**given, wrt: source})
        dr.backward(dr.sum(dr.sum(found * seed)) if dr.depth_v(found) > 1 else dr.sum(found * seed))
        rows_of = source if isinstance(source, list) else [source]
        gradient = [dr.grad(row) for row in rows_of]
        held["gradient"] = gradient if isinstance(source, list) else gradient[0]
        held["result"] = dr.detach(found)
        dr.eval(held["result"], held["gradient"])
        dr.sync_thread()

    def gradient():
        found = narrow(held["gradient"])
        return found.reshape(inputs[wrt].shape)

    return Run(forward, result, backward, gradient)
