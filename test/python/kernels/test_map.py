"""`wp.map`: functions of all kinds over arrays that broadcast."""

import numpy as np
import pytest

import warp as wp


@wp.func
def scaled_sum(x: float, y: float, s: float = 2.0):
    return x + s * y


@wp.func
def overloaded(x: float):
    return x + 1.0


@wp.func
def overloaded(x: wp.vec3):  # noqa: F811
    return wp.length(x)


def plain(x, y):
    if x > y:
        return x - y
    return y - x


def two(x):
    return x * 2.0, wp.vec2(x, -x)


def rng():
    return np.random.default_rng(7)


def numbers(*shape):
    return rng().normal(size=shape).astype(np.float32)


def test_builtins(device):
    x = numbers(100)
    a = wp.array(x, device=device)
    got = wp.map(wp.sin, a)
    assert (got.dtype, str(got.device)) == (wp.float32, device)
    np.testing.assert_allclose(got.numpy(), np.sin(x), atol=1e-6)
    np.testing.assert_array_equal(wp.map(wp.clamp, a, -0.5, 0.5).numpy(), np.clip(x, -0.5, 0.5))


def test_functions_of_all_kinds(device):
    x, y = numbers(2, 50)
    a, b = wp.array(x, device=device), wp.array(y, device=device)
    np.testing.assert_allclose(wp.map(scaled_sum, a, b).numpy(), x + 2 * y, rtol=1e-6)
    np.testing.assert_array_equal(wp.map(plain, a, b).numpy(), np.abs(x - y))
    np.testing.assert_array_equal(wp.map(lambda x, y: wp.max(x, y), a, b).numpy(), np.fmax(x, y))
    offset = 3.0
    np.testing.assert_array_equal(wp.map(lambda x: x + offset, a).numpy(), x + np.float32(3))


# The values that a function captures are part of what it is.
def test_closures(device):
    a = wp.zeros(2, device=device)
    found = [wp.map(lambda x, s=float(s): x + s, a).list()[0] for s in range(3)]
    assert found == [0.0, 1.0, 2.0]

    def make(s):
        return lambda x: x + s

    assert [wp.map(make(s), a).list()[0] for s in (1.0, 2.0)] == [1.0, 2.0]
    # Two lambdas of one line differ by what they do.
    assert [wp.map(f, a).list()[0] for f in (lambda x: x + 5.0, lambda x: x - 5.0)] == [5.0, -5.0]


def test_overloads_and_composites(device):
    v = numbers(10, 3)
    a = wp.array(v, dtype=wp.vec3, device=device)
    np.testing.assert_allclose(wp.map(overloaded, a).numpy(), np.linalg.norm(v, axis=1), rtol=1e-6)
    np.testing.assert_array_equal(wp.map(overloaded, wp.zeros(2, device=device)).numpy(), 1.0)
    turned = wp.map(wp.quat_rotate, wp.quat(0.0, 0.0, 1.0, 0.0), a)
    assert turned.dtype is wp.vec3
    np.testing.assert_allclose(turned.numpy(), v * [-1, -1, 1], atol=1e-6)


def test_several_results(device):
    x = numbers(20)
    a = wp.array(x, device=device)
    doubled, pairs = wp.map(two, a)
    np.testing.assert_array_equal(doubled.numpy(), 2 * x)
    np.testing.assert_array_equal(pairs.numpy(), np.stack([x, -x], 1))
    outputs = [wp.zeros(20, device=device), wp.zeros(20, dtype=wp.vec2, device=device)]
    assert wp.map(two, a, out=outputs) is outputs
    np.testing.assert_array_equal(outputs[0].numpy(), 2 * x)


@pytest.mark.parametrize(
    "shapes",
    [
        [(4, 5), (5,)],
        [(4, 1), (1, 5)],
        [(3, 1, 4), (5, 4)],
        [(1,), (6,)],
        [(2, 3, 4, 5), (3, 1, 5)],
        [(0, 3), (3,)],
    ],
    ids=str,
)
def test_broadcasting(device, shapes):
    x, y = (numbers(*shape) for shape in shapes)
    got = wp.map(wp.add, wp.array(x, device=device), wp.array(y, device=device))
    assert got.shape == np.broadcast_shapes(*shapes)
    np.testing.assert_array_equal(got.numpy(), x + y)


def test_views(device):
    x = numbers(6, 8)
    a = wp.array(x, device=device)
    got = wp.map(wp.add, a.transpose(), a[0, :6])
    np.testing.assert_array_equal(got.numpy(), x.T + x[0, :6])
    wp.map(wp.neg, a[1:4, ::2], out=a[1:4, ::2])
    x[1:4, ::2] *= -1
    np.testing.assert_array_equal(a.numpy(), x)


# An output that overlaps an input is as if the input had been read before.
def test_overlap(device):
    a = wp.array(np.arange(1000.0), dtype=wp.float64, device=device)
    wp.map(wp.add, a[1:], a[:-1], out=a[1:])
    x = np.arange(1000.0)
    x[1:] = x[1:] + x[:-1]
    np.testing.assert_array_equal(a.numpy(), x)


def test_kernel(device):
    a = wp.array(numbers(5), device=device)
    kernel = wp.map(scaled_sum, a, a, return_kernel=True)
    out = wp.zeros(5, device=device)
    wp.launch(kernel, dim=5, inputs=[a, a], outputs=[out], device=device)
    np.testing.assert_allclose(out.numpy(), 3 * a.numpy(), rtol=1e-6)


def test_kernels_are_kept(device):
    from warp._src.kernels.maps import _kernels

    a = wp.zeros(3, device=device)
    wp.map(lambda x: x * 7.0, a)
    count = len(_kernels)
    for _ in range(3):
        wp.map(scaled_sum, a, a)
    assert len(_kernels) <= count + 1


@wp.struct
class Line:
    slope: float
    start: float


@wp.func
def evaluate(line: Line, x: float):
    return line.start + line.slope * x


def test_structs(device):
    line = Line()
    line.slope, line.start = 2.0, 1.0
    got = wp.map(evaluate, line, wp.array([0.0, 1.0], dtype=float, device=device))
    assert got.list() == [1.0, 3.0]


def nothing(x: float):
    x = x + 1.0


@pytest.mark.parametrize(
    "call, message",
    [
        (lambda a: wp.map(wp.sin), "at least one array"),
        (lambda a: wp.map(wp.sin, 1.0), "at least one array"),
        (lambda a: wp.map(3, a), "expects a function, but got 'int'"),
        (lambda a: wp.map(wp.sin, a, "x"), "'str'"),
        (
            lambda a: wp.map(wp.add, a, wp.zeros(2, device="cpu")),
            r"\(3,\), \(2,\) do not broadcast",
        ),
        (lambda a: wp.map(wp.dot, a, a), "'dot'"),
        (lambda a: wp.map(nothing, a), "no value|nothing"),
        (lambda a: wp.map(wp.sin, a, out=wp.zeros(2, device="cpu")), "output of shape"),
        (
            lambda a: wp.map(wp.sin, a, out=wp.zeros(3, dtype=int, device="cpu")),
            "'float32'.*'int32'",
        ),
        (lambda a: wp.map(wp.sin, a, out=3), "arrays as `out`"),
    ],
)
def test_refusals(call, message):
    with pytest.raises((TypeError, ValueError, wp.WarpCodegenError), match=message):
        call(wp.zeros(3, device="cpu"))


def test_lambda_without_source():
    with pytest.raises(wp.WarpCodegenError, match="lambda"):
        wp.map(eval("lambda x: x"), wp.zeros(3, device="cpu"))
