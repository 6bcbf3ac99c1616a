"""Programs of the comparison: inputs, formulas over arrays, and the parameter to differentiate by.

A formula takes the operations of an array package (`Arrays`), so that one text gives the float64
reference by NumPy and the programs of packages whose programs are array expressions. Packages with
kernels have programs of their own in `packages`. This file needs NumPy alone, as it is imported by
interpreters in which nothing else of this package is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


class Arrays:
    """Operations of formulas, by NumPy; other packages replace what they spell otherwise."""

    xp = np

    def add_at(self, count, index, values):
        """Zeros of `count` rows, to which `values` are added at `index`."""
        found = self.xp.zeros((count, *values.shape[1:]), dtype=values.dtype)
        self.xp.add.at(found, index, values)
        return found

    def repeat(self, steps, function, state):
        for _ in range(steps):
            state = function(state)
        return state

    def cross(self, a, b):
        return self.xp.cross(a, b)

    def indices(self, values):
        """Whole numbers of floats, rounded down, as indices."""
        return self.xp.floor(values).astype(self.xp.int32)


@dataclass(frozen=True)
class Program:
    """One program.

    Args:
        summary: for the page.
        inputs: of a random generator and a size: arrays (float32, int32) and numbers by name.
        formula: of `Arrays` and the inputs: the result.
        sizes: for quick runs, for CPUs, for GPUs.
        wrt: the input that the gradient is for; none where the result is piecewise constant.
    """

    summary: str
    inputs: Callable
    formula: Callable
    sizes: tuple[int, int, int]
    wrt: str | None = None


def _floats(rng, *shape, low=0.0, high=1.0):
    return rng.uniform(low, high, shape).astype(np.float32)


def _saxpy(arrays, x, y, a):
    return a * x + y


def _elementary(arrays, x):
    xp = arrays.xp
    return xp.sin(x) * xp.exp(-x * x) + xp.sqrt(x + 4.0) + xp.log(1.0 + x * x)


def _total(arrays, x):
    return arrays.xp.sum(x).reshape(1)


def _nbody(arrays, x, softening):
    d = x[None, :, :] - x[:, None, :]
    r2 = (d * d).sum(-1) + softening
    return (d * (1.0 / (r2 * arrays.xp.sqrt(r2)))[..., None]).sum(1)


def _net(rng, n):
    """A square net of springs, stretched and disturbed."""
    at = np.arange(n * n).reshape(n, n)
    pairs = [(at[:, :-1], at[:, 1:]), (at[:-1], at[1:])]
    i, j = (np.concatenate([p[k].ravel() for p in pairs]).astype(np.int32) for k in (0, 1))
    x = np.stack([*np.meshgrid(np.arange(n), np.arange(n)), np.zeros((n, n))], -1).reshape(-1, 3)
    x = (1.1 * x + rng.uniform(-0.1, 0.1, x.shape)).astype(np.float32)
    return {"x": x, "i": i, "j": j, "rest": np.ones(len(i), np.float32), "stiffness": 100.0}


def _springs(arrays, x, i, j, rest, stiffness):
    d = x[j] - x[i]
    length = arrays.xp.sqrt((d * d).sum(-1))
    force = (stiffness * (length - rest) / length)[:, None] * d
    return arrays.add_at(x.shape[0], i, force) - arrays.add_at(x.shape[0], j, force)


def _escape(arrays, cx, cy, most):
    xp = arrays.xp

    def step(state):
        x, y, count = state
        inside = x * x + y * y < 4.0
        u = xp.where(inside, x * x - y * y + cx, x)
        v = xp.where(inside, 2.0 * x * y + cy, y)
        return u, v, count + inside

    return arrays.repeat(most, step, (cx * 0.0, cx * 0.0, cx * 0.0))[2]


def _plane(rng, n):
    x, y = np.meshgrid(np.linspace(-2.0, 1.0, n), np.linspace(-1.0, 1.0, n))
    return {"cx": x.astype(np.float32), "cy": y.astype(np.float32), "most": 256}


def _rows(arrays, m):
    a, b, c = m[:, 0], m[:, 1], m[:, 2]
    bc, ca, ab = arrays.cross(b, c), arrays.cross(c, a), arrays.cross(a, b)
    return bc, ca, ab, (a * bc).sum(-1)


def _matrices(arrays, m, b):
    bc, ca, ab, det = _rows(arrays, m)
    solved = (bc * b[:, 0:1] + ca * b[:, 1:2] + ab * b[:, 2:3]) / det[:, None]
    return solved + (m * b[:, :, None]).sum(1) * det[:, None]


def _energy(arrays, f, mu, lam):
    log = arrays.xp.log(_rows(arrays, f)[3])
    return 0.5 * mu * ((f * f).sum((1, 2)) - 3.0) - mu * log + 0.5 * lam * log * log


def _heat(arrays, u, steps, rate):
    roll = arrays.xp.roll

    def step(u):
        return u + rate * (roll(u, 1, 0) + roll(u, -1, 0) + roll(u, 1, 1) + roll(u, -1, 1) - 4 * u)

    return arrays.repeat(steps, step, u)


def _product(arrays, a, b):
    return a @ b


def _pendulum(arrays, angle, speed, steps, dt):
    def step(state):
        angle, speed = state
        speed = speed - dt * arrays.xp.sin(angle)
        return angle + dt * speed, speed

    return arrays.repeat(steps, step, (angle, speed))[0]


def _cells(rng, n):
    """Points in a box, sorted by cells as large as the radius, with each cell's first point."""
    side = max(round((n / 8.0) ** (1.0 / 3.0)), 3)
    x = rng.uniform(0.0, side, (n, 3)).astype(np.float32)
    x = np.minimum(x, np.nextafter(np.float32(side), np.float32(0)))
    cell = x.astype(np.int32) @ np.array([side * side, side, 1], np.int32)
    order = np.argsort(cell, kind="stable")
    first = np.searchsorted(cell[order], np.arange(side**3 + 1)).astype(np.int32)
    return {"x": x[order], "first": first, "side": side, "most": int(np.diff(first).max())}


def _density(arrays, x, first, side, most):
    xp = arrays.xp
    offsets = np.stack(np.meshgrid(*[[-1, 0, 1]] * 3, indexing="ij"), -1).reshape(-1, 3)
    own = arrays.indices(x)
    total = 0.0
    for offset in offsets.tolist():
        at = [own[:, k] + offset[k] for k in range(3)]
        inside = (at[0] >= 0) & (at[0] < side) & (at[1] >= 0) & (at[1] < side)
        inside = inside & (at[2] >= 0) & (at[2] < side)
        cell = xp.where(inside, (at[0] * side + at[1]) * side + at[2], 0)
        begin, end = first[cell], first[cell + 1]

        def step(state, begin=begin, end=end, inside=inside):
            k, total = state
            other = begin + k
            there = inside & (other < end)
            d = x - x[xp.where(there, other, 0)]
            q = 1.0 - (d * d).sum(-1)
            return k + 1, total + xp.where(there & (q > 0.0), q * q * q, 0.0 * q)

        total = total + arrays.repeat(most, step, (0, x[:, 0] * 0.0))[1]
    return total


def _bins(arrays, x, bins):
    ones = arrays.xp.ones_like(x)
    return arrays.add_at(bins, arrays.indices(x * bins), ones)


def _stretch(rng, n):
    return {"f": np.eye(3, dtype=np.float32) + 0.2 * _floats(rng, n, 3, 3), "mu": 1.0, "lam": 10.0}


def _square(rng, n):
    return {"a": _floats(rng, n, n, low=-1.0), "b": _floats(rng, n, n, low=-1.0)}


PROGRAMS = {
    "saxpy": Program(
        "a x + y: bound by memory",
        lambda rng, n: {"x": _floats(rng, n), "y": _floats(rng, n), "a": 2.0},
        _saxpy,
        (1 << 14, 1 << 22, 1 << 26),
        "x",
    ),
    "elementary": Program(
        "sine, exponential, root and logarithm of each element",
        lambda rng, n: {"x": _floats(rng, n, low=-3.0, high=3.0)},
        _elementary,
        (1 << 14, 1 << 21, 1 << 25),
        "x",
    ),
    "total": Program(
        "sum of an array",
        lambda rng, n: {"x": _floats(rng, n)},
        _total,
        (1 << 14, 1 << 22, 1 << 26),
        "x",
    ),
    "nbody": Program(
        "softened gravity between all pairs",
        lambda rng, n: {"x": _floats(rng, n, 3), "softening": 0.01},
        _nbody,
        (256, 2048, 8192),
        "x",
    ),
    "springs": Program(
        "forces of a net of springs, added to both ends", _net, _springs, (32, 256, 1024), "x"
    ),
    "mandelbrot": Program(
        "steps until escape, at most 256: threads that diverge", _plane, _escape, (64, 256, 2048)
    ),
    "matrices": Program(
        "3x3 systems solved, transposed products and determinants",
        lambda rng, n: {
            "m": _floats(rng, n, 3, 3) + 2.0 * np.eye(3, dtype=np.float32),
            "b": _floats(rng, n, 3),
        },
        _matrices,
        (1 << 10, 1 << 17, 1 << 21),
        "m",
    ),
    "neohooke": Program(
        "energy of a neo-Hookean solid by element",
        _stretch,
        _energy,
        (1 << 10, 1 << 17, 1 << 21),
        "f",
    ),
    "heat": Program(
        "50 steps of a five-point stencil on a torus",
        lambda rng, n: {"u": _floats(rng, n, n), "steps": 50, "rate": 0.2},
        _heat,
        (64, 256, 2048),
        "u",
    ),
    "product": Program("product of two square matrices", _square, _product, (128, 512, 4096), "a"),
    "pendulum": Program(
        "200 steps in time of each of many pendulums: a loop inside of a thread",
        lambda rng, n: {
            "angle": _floats(rng, n, low=-2.0, high=2.0),
            "speed": _floats(rng, n, low=-1.0),
            "steps": 200,
            "dt": 0.01,
        },
        _pendulum,
        (1 << 8, 1 << 14, 1 << 20),
        "angle",
    ),
    "neighbours": Program(
        "densities from the neighbours in 27 cells of a grid",
        _cells,
        _density,
        (1 << 9, 1 << 14, 1 << 18),
        "x",
    ),
    "histogram": Program(
        "counts in 256 bins",
        lambda rng, n: {"x": _floats(rng, n), "bins": 256},
        _bins,
        (1 << 12, 1 << 20, 1 << 24),
    ),
}


def make_inputs(name, size):
    """The inputs of a program, the same ones in every process."""
    return PROGRAMS[name].inputs(np.random.default_rng(7), size)


def reference(name, inputs):
    """The figures by which a package is judged.

    Returns:
        A dictionary: `result` in float64; where the program has a gradient, `weights` (the
        adjoint of the result), `direction` (of the input `wrt`) and `slope`, the derivative of
        the weighted sum of the result along that direction by central differences in float64.
    """
    program = PROGRAMS[name]
    exact = {
        key: value.astype(np.float64)
        if isinstance(value, np.ndarray) and value.dtype == np.float32
        else value
        for key, value in inputs.items()
    }
    found = {"result": np.asarray(program.formula(Arrays(), **exact), np.float64)}
    if program.wrt:
        rng = np.random.default_rng(11)
        weights = rng.normal(size=found["result"].shape).astype(np.float32)
        direction = rng.normal(size=inputs[program.wrt].shape)
        # Cells are those of the points that were given: a step moves none to another one.
        step = 1e-6
        ends = [
            program.formula(
                Arrays(), **{**exact, program.wrt: exact[program.wrt] + sign * step * direction}
            )
            for sign in (1.0, -1.0)
        ]
        slope = float(np.sum(weights * (ends[0] - ends[1]))) / (2.0 * step)
        found |= {"weights": weights, "direction": direction, "slope": np.float64(slope)}
    return found
