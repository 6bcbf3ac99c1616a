"""Structs of many fields, copied and changed on some threads only."""

import numpy as np
import pytest

import warp as wp


@wp.struct
class Body:
    x: wp.vec3
    v: wp.vec3
    a: wp.mat33
    b: wp.mat33
    q: wp.quat
    m: float
    k: float
    s: int
    t: int


@wp.kernel
def move(a: wp.array(dtype=Body), o: wp.array(dtype=Body), dt: float):
    i = wp.tid()
    body = a[i]
    if body.s < 10:
        body.x = body.x + body.v * dt
    o[i] = body


def test_scalar_code_gathers_no_fields():
    text = move.ir("llvm")
    assert "masked.gather" not in text and "masked.scatter" not in text


@pytest.mark.parametrize("n", [1, 15, 16, 17, 1000])
def test_bodies_move(n, device):
    rng = np.random.default_rng(n)
    values = np.zeros(n, dtype=Body.numpy_dtype())
    for name in values.dtype.names:
        values[name] = rng.integers(0, 20, values[name].shape)
    a = wp.array(values, dtype=Body, device=device)
    o = wp.zeros(n, dtype=Body, device=device)
    wp.launch(move, n, [a, o, 0.5], device=device)
    right = values.copy()
    moving = values["s"] < 10
    right["x"][moving] += 0.5 * values["v"][moving]
    for name in values.dtype.names:
        np.testing.assert_array_equal(o.numpy()[name], right[name])
