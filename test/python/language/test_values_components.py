"""Builtins that work by component: every kind of composite gives what its scalars give."""

import numpy as np
import pytest

import warp as wp
from builtin_values import apply

KINDS = {
    "vec": (wp.vec3f, 3),
    "mat": (wp.mat22f, 4),
    "quat": (wp.quatf, 4),
    "transform": (wp.transformf, 7),
    "ints": (wp.types.vector(length=3, dtype=wp.int32), 3),
}
SHAPES = {"mat": (2, 2)}
PAIRS = {
    "add": ("vec", "mat", "quat", "transform", "ints"),
    "sub": ("vec", "mat", "quat", "transform", "ints"),
    "mod": ("vec", "ints"),
    "min": ("vec", "ints"),
    "max": ("vec", "ints"),
    "cw_mul": ("vec", "mat", "ints"),
    "cw_div": ("vec", "mat", "ints"),
    "bit_and": ("ints",),
    "bit_or": ("ints",),
    "bit_xor": ("ints",),
    "lshift": ("ints",),
    "rshift": ("ints",),
}
SINGLES = {
    "neg": ("vec", "mat", "quat", "transform", "ints"),
    "pos": ("vec", "mat", "quat", "transform", "ints"),
    "abs": ("vec", "ints"),
    "sign": ("vec", "ints"),
    "invert": ("ints",),
}
SCALAR_NAMES = {"cw_mul": "mul", "cw_div": "div"}


def values(kind, seed):
    random = np.random.default_rng(seed)
    shape = (40, *SHAPES.get(kind, (KINDS[kind][1],)))
    if kind == "ints":
        return random.integers(-9, 10, shape).astype(np.int32)
    return random.normal(size=shape).astype(np.float32)


def scalar(kind):
    return wp.int32 if kind == "ints" else wp.float32


def check(name, kind, operands, types, device):
    composite = KINDS[kind][0]
    result = apply(getattr(wp, name), operands, types, composite, device)
    flat = [
        np.broadcast_to(x.reshape(len(x), -1), result.reshape(40, -1).shape).reshape(-1)
        for x in operands
    ]
    same = getattr(wp, SCALAR_NAMES.get(name, name))
    expected = apply(same, flat, [scalar(kind)] * len(flat), scalar(kind), device)
    np.testing.assert_array_equal(result.reshape(-1), expected)


@pytest.mark.parametrize("name, kind", [(n, k) for n, kinds in PAIRS.items() for k in kinds])
def test_pairs(device, name, kind):
    check(name, kind, [values(kind, 1), values(kind, 2)], [KINDS[kind][0]] * 2, device)


@pytest.mark.parametrize("name, kind", [(n, k) for n, kinds in SINGLES.items() for k in kinds])
def test_singles(device, name, kind):
    check(name, kind, [values(kind, 1)], [KINDS[kind][0]], device)


@pytest.mark.parametrize(
    "name, kind", [("mul", k) for k in KINDS] + [("div", k) for k in KINDS if k != "transform"]
)
def test_scalar_beside_components(device, name, kind):
    x, s = values(kind, 1), values("ints" if kind == "ints" else "vec", 3)[:, 0]
    check(name, kind, [x, s], [KINDS[kind][0], scalar(kind)], device)
    check(name, kind, [s, x], [scalar(kind), KINDS[kind][0]], device)


@pytest.mark.parametrize("kind", ["vec", "mat", "quat", "transform"])
def test_lerp(device, kind):
    """Either product may be fused with the sum, so the last bit is open."""
    a, b, t = values(kind, 1), values(kind, 2), np.linspace(0, 1, 40, dtype=np.float32)
    composite = KINDS[kind][0]
    result = apply(wp.lerp, [a, b, t], [composite] * 2 + [wp.float32], composite, device)
    s = t.astype(float).reshape(-1, *[1] * (a.ndim - 1))
    first, second = a * (1.0 - s), b * s
    error = np.abs(result.reshape(a.shape) - (first + second))
    bound = np.finfo(np.float32).eps * (np.abs(first) + np.abs(second))
    assert (error <= bound).all()


@pytest.mark.parametrize("kind", KINDS)
def test_equality_takes_every_component(device, kind):
    a = values(kind, 1)
    b = a.copy()
    flat = b.reshape(40, -1)
    width = flat.shape[1]
    flat[np.arange(1, 40), np.arange(1, 40) % width] += 1
    types = [KINDS[kind][0]] * 2
    equal = apply(wp.eq, [a, b], types, wp.bool, device)
    np.testing.assert_array_equal(equal, np.arange(40) == 0)
    unequal = apply(wp.ne, [a, b], types, wp.bool, device)
    np.testing.assert_array_equal(unequal, np.arange(40) > 0)


def test_logic_of_booleans(device):
    a, b = [False, False, True, True], [False, True, False, True]
    for name, expected in (
        ("bit_and", [0, 0, 0, 1]),
        ("bit_or", [0, 1, 1, 1]),
        ("bit_xor", [0, 1, 1, 0]),
        ("lt", [0, 1, 0, 0]),
        ("ge", [1, 0, 1, 1]),
    ):
        result = apply(getattr(wp, name), [a, b], [wp.bool, wp.bool], wp.bool, device)
        np.testing.assert_array_equal(result, np.array(expected, bool))
    result = apply(wp.unot, [a], [wp.bool], wp.bool, device)
    np.testing.assert_array_equal(result, [True, True, False, False])
