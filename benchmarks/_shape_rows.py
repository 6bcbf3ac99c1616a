"""Kernels of shapes.py launched over rows that are shorter than vectors."""

import warp as wp
from _shape_data import Case, case, differentiable


@differentiable
def joints_kernel(
    q: wp.array2d(dtype=float), rate: wp.array2d(dtype=float), dt: float,
    y: wp.array2d(dtype=float),
):  # fmt: skip
    world, joint = wp.tid()
    v = rate[world, joint]
    y[world, joint] = q[world, joint] + dt * v + 0.5 * wp.sin(v) * wp.exp(-v)


def worlds(data, joints):
    """Worlds by joints."""
    n = data.size(1 << 16, 1 << 23) // joints
    arrays = [data.real((n, joints)), data.real((n, joints)), 0.01]
    return Case(joints_kernel, (n, joints), arrays, [data.out((n, joints))], n * joints, "joint")


@case
def short_rows(data):
    """Worlds of seven joints."""
    return worlds(data, 7)


@case
def single_columns(data):
    """Worlds of one joint: a last dimension that is none."""
    return worlds(data, 1)


@case
def triples(data):
    """Three numbers for each point."""
    return worlds(data, 3)


@differentiable
def norms_kernel(x: wp.array2d(dtype=float), n: int, y: wp.array(dtype=float)):
    i = wp.tid()
    s = float(0.0)
    for k in range(n):
        s += x[i, k] * x[i, k]
    y[i] = wp.sqrt(s)


@case
def long_rows(data):
    """Norms of rows of 200 numbers, a thread for each."""
    n = data.size(1 << 11, 1 << 16)
    return Case(norms_kernel, n, [data.real((n, 200)), 200], [data.out(n)], n * 200, "number")


@differentiable
def filter_kernel(u: wp.array2d(dtype=float), n: int, q: wp.array2d(dtype=float)):
    w = wp.tid()
    for t in range(n):
        q[w, t + 1] = 0.9 * q[w, t] + 0.1 * u[w, t]


@case
def recurrent_rows(data):
    """A recurrence of 64 steps along rows."""
    n = data.size(1 << 12, 1 << 15)
    arrays = [data.real((n, 64)), 64]
    return Case(filter_kernel, n, arrays, [data.out((n, 65))], n * 64, "step")
