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
