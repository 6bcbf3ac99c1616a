"""Operators of composites at Python scope: rounded as kernels round, and their names in place."""

import numpy as np
import pytest

import warp as wp
from random_runs import seeds

FLOATS = [wp.float16, wp.float32, wp.float64]


def matrix(rows, columns):
    return lambda scalar: wp.types.matrix((rows, columns), scalar)


def vector(length):
    return lambda scalar: wp.types.vector(length, scalar)


PAIRS = {
    "quaternions": (wp.types.quaternion, wp.types.quaternion),
    "transforms": (wp.types.transformation, wp.types.transformation),
    "matrices": (matrix(3, 3), matrix(3, 3)),
    "other extents": (matrix(2, 3), matrix(3, 4)),
    "spatial": (matrix(6, 6), vector(6)),
    "matrix and vector": (matrix(3, 3), vector(3)),
    "vector and matrix": (vector(2), matrix(2, 4)),
}


def random(dtype, rng):
    values = rng.standard_normal(dtype._length_)
    if dtype._length_ in (4, 7) and len(dtype._shape_) == 1:
        values[-4:] /= np.linalg.norm(values[-4:])
    return dtype(*values.tolist())


def exact(pair, a, b):
    """The product in 64 bits."""
    x, y = (np.array([float(v) for v in one]).reshape(one._shape_) for one in flat(a, b))
    if pair in ("quaternions", "transforms"):
        product = hamilton(x[-4:], y[-4:])
        if pair == "quaternions":
            return product
        w = hamilton(hamilton(x[3:], np.append(y[:3], 0)), x[3:] * [-1, -1, -1, 1])
        return np.concatenate([x[:3] + w[:3], product])
    return x @ y


def flat(*values):
    class Flat(list):
        pass

    for one in values:
        rows = one if len(one._shape_) == 1 else [v for row in one for v in row]
        found = Flat(rows)
        found._shape_ = one._shape_
        yield found


def hamilton(a, b):
    u, v = a[:3], b[:3]
    return np.append(a[3] * v + b[3] * u + np.cross(u, v), a[3] * b[3] - u @ v)


@pytest.mark.parametrize("pair", PAIRS)
@pytest.mark.parametrize("scalar", FLOATS)
def test_the_operator_is_the_function_and_what_a_kernel_makes(pair, scalar):
    """All bits of `a * b`, `wp.mul(a, b)` and the kernel's product agree, and they are right."""
    left, right = (make(scalar) for make in PAIRS[pair])
    kind = type(left() * right())

    @wp.kernel
    def multiply(a: wp.array(dtype=left), b: wp.array(dtype=right), result: wp.array(dtype=kind)):
        i = wp.tid()
        result[i] = a[i] * b[i]

    rng = np.random.default_rng(1)
    count = len(seeds(50))
    a, b = ([random(dtype, rng) for _ in range(count)] for dtype in (left, right))
    result = wp.zeros(count, dtype=kind, device="cpu")
    arrays = [wp.array(x, dtype=d, device="cpu") for x, d in ((a, left), (b, right))]
    wp.launch(multiply, count, arrays, [result], device="cpu")
    epsilon = {wp.float16: 1e-2, wp.float32: 2e-6, wp.float64: 1e-14}[scalar]
    for x, y, z in zip(a, b, result.list(), strict=True):
        assert bytes(x * y) == bytes(wp.mul(x, y)) == bytes(z)
        found = np.array([float(v) for v in next(flat(x * y))])
        np.testing.assert_allclose(found, exact(pair, x, y).ravel(), atol=8 * epsilon)
    if pair == "transforms":
        assert bytes(a[0] * b[0]) == bytes(wp.transform_multiply(a[0], b[0]))


class Pose(wp.transform):
    pass


class Turn(wp.quat):
    pass


def test_derived_classes_keep_their_type():
    pose, turn = Pose(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0), Turn(0.0, 0.0, 1.0, 0.0)
    assert type(pose * wp.transform()) is Pose and pose * wp.transform() == pose
    assert type(turn * turn) is Turn and turn * turn == wp.quat(0.0, 0.0, 0.0, -1.0)


def test_large_matrices_and_integers():
    """These are not compiled: sums are exact, or of 64 bits."""
    big = wp.types.matrix((40, 40), float)
    values = np.random.default_rng(2).integers(-9, 9, (40, 40))
    m = big(*values.ravel().tolist())
    assert np.array_equal(np.array(m * m), (values @ values).ravel())
    i = wp.types.matrix((2, 2), wp.int64)(2**40, 1, 3, 2)
    assert [int(v) for row in i * i for v in row] == [
        2**80 % 2**64 + 3,
        2**40 + 2,
        3 * 2**40 + 6,
        7,
    ]


@pytest.mark.parametrize("name", ["+=", "-=", "*=", "/=", "@="])
def test_values_are_values(name):
    """An operator in place makes a new value for its name alone, as a number does."""
    m, q, t = wp.mat22(1.0, 2.0, 3.0, 4.0), wp.quat(0.0, 0.0, 0.6, 0.8), wp.transform()
    operands = {"+=": (m, m), "-=": (m, m), "*=": (m, m), "/=": (m, 2.0), "@=": (m, m)}
    a, b = operands[name]
    alias, held, before = a, [a], bytes(a)
    scope = {"a": a, "b": b}
    exec(f"a {name} b", scope)
    assert scope["a"] is not alias and bytes(alias) == before == bytes(held[0])
    for value in (q, t):
        scope = {"a": value, "b": value}
        if name == "*=":
            before = bytes(value)
            exec("a *= b", scope)
            assert bytes(value) == before and scope["a"] == value * value


def test_python_scope_within_a_graph():
    """Builtins and products are evaluated at once, and the graph does not get them."""
    q = wp.quat(0.0, 0.0, 0.6, 0.8)
    a = wp.zeros(1, dtype=wp.quat, device="cpu")
    expected = wp.quat(0.0, 0.0, 0.96, 0.28)
    with wp.ScopedCapture(device="cpu") as capture:
        product, length = q * q, wp.length(wp.vec3(3.0, 4.0, 0.0))
        a.fill_(product)
    np.testing.assert_allclose(np.array(product), np.array(expected), atol=1e-7)
    assert length == 5.0 and a.numpy()[0].tolist() == [0, 0, 0, 0]
    for _ in range(2):
        q * q * q
        wp.capture_launch(capture.graph)
        np.testing.assert_allclose(a.numpy()[0], np.array(expected), atol=1e-7)
