"""Derivatives where a function has none, an infinite one, or one that plain formulas lose."""

import math

import numpy as np
import pytest

import warp as wp
from builtin_values import unary
from frontend_programs import define

F32, F64 = wp.float32, wp.float64


@pytest.fixture(autouse=True)
def quiet(monkeypatch):
    monkeypatch.setattr(wp.config, "quiet", True)


def gradients(expression, operands, types, device, seed=1.0, result=None):
    """Gradients of an expression of a0, a1, ... by its operands, one thread."""
    names = {f"T{i}": t for i, t in enumerate(types)} | {"R": result or types[0]}
    arrays = ", ".join(f"p{i}: wp.array(dtype=T{i})" for i in range(len(types)))
    loads = "\n".join(f"    a{i} = p{i}[0]" for i in range(len(types)))
    source = (
        f"@wp.kernel\ndef apply({arrays}, y: wp.array(dtype=R)):\n{loads}\n"
        f"    y[0] = {expression}\n"
    )
    kernel = define(source, **names)["apply"]
    inputs = [
        wp.array([value], dtype=dtype, device=device, requires_grad=True)
        for value, dtype in zip(operands, types)
    ]
    output = wp.zeros(1, dtype=names["R"], device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, 1, inputs, [output], device=device)
    seeds = np.full(output.numpy().shape, seed)
    tape.backward(grads={output: wp.array(seeds, dtype=names["R"], device=device)})
    return [one.grad.numpy()[0] for one in inputs]


def partial(expression, *operands, dtype=F32, device="cpu", seed=1.0):
    found = gradients(expression, operands, [dtype] * len(operands), device, seed)
    return found[0] if len(found) == 1 else found


# Expression, operand, derivative where it is pinned, and by IEEE arithmetic.
SINGULAR = [
    ("wp.sqrt(a0)", 0.0, 0.0, math.inf),
    ("wp.log(a0)", 0.0, 0.0, math.inf),
    ("wp.log2(a0)", 0.0, 0.0, math.inf),
    ("wp.log10(a0)", 0.0, 0.0, math.inf),
    ("wp.cbrt(a0)", 0.0, 0.0, math.inf),
    ("wp.asin(a0)", 1.0, 0.0, math.inf),
    ("wp.acos(a0)", 1.0, 0.0, -math.inf),
    ("wp.acos(a0)", -1.0, 0.0, -math.inf),
    ("wp.erfinv(a0)", 1.0, 0.0, math.inf),
    ("wp.pow(a0, 0.5)", 0.0, 0.0, math.inf),
]


@pytest.mark.parametrize("expression, at, pinned, strict", SINGULAR)
def test_policies(device, monkeypatch, expression, at, pinned, strict):
    assert partial(expression, at, device=device) == pinned
    monkeypatch.setattr(wp.config, "singular", "strict")
    assert partial(expression, at, device=device) == strict


@pytest.mark.parametrize("expression, at, pinned, strict", SINGULAR)
def test_zero_cotangent_contributes_zero(device, expression, at, pinned, strict):
    assert partial(expression, at, device=device, seed=0.0) == 0
    assert partial(f"0.0 * {expression}", at, device=device) == 0


UNSELECTED = ["a0 / 0.0", "1.0 / a0", "wp.exp(a0 + 1e4)", "wp.sqrt(a0 - 1.0)", "wp.log(a0 - 1.0)",
              "wp.cosh(a0 + 1e4)", "wp.pow(a0 - 1.0, 0.5)", "wp.mod(a0, 0.0)", "wp.acos(a0 + 1.0)",
              "wp.length(wp.vec3(a0, a0, a0))"]  # fmt: skip


@pytest.mark.parametrize("expression", UNSELECTED)
def test_arm_not_chosen(device, expression):
    """The derivative of what `where` discards is an infinity times zero."""
    assert partial(f"wp.where(a0 > 1.0, {expression}, 2.0 * a0)", 0.0, device=device) == 2


def test_power(device):
    assert partial("wp.pow(a0, a1)", 0.0, 2.0, device=device) == [0, 0]
    assert partial("wp.pow(a0, a1)", 0.0, 0.0, device=device) == [0, 0]
    assert partial("wp.pow(a0, 3.0)", -2.0, device=device) == pytest.approx(12, rel=1e-6)


def test_exponent_of_a_negative_base(device, monkeypatch):
    with pytest.raises(wp.WarpError, match="negative base has no derivative by its exponent"):
        partial("wp.pow(a0, a1)", -2.0, 3.0, device=device)
        wp.synchronize()
    # Where nothing depends on it, nothing is wrong.
    assert partial("0.0 * wp.pow(a0, a1)", -2.0, 3.0, device=device) == [0, 0]
    monkeypatch.setattr(wp.config, "singular", "strict")
    base, exponent = partial("wp.pow(a0, a1)", -2.0, 3.0, device=device)
    assert base == pytest.approx(12, rel=1e-6) and math.isnan(exponent)


def test_digits_that_plain_formulas_lose(device):
    assert partial("wp.tanh(a0)", 9.0, device=device) == pytest.approx(6.0920e-8, rel=1e-4)
    almost = np.float32(1 - 2.0**-24)
    assert partial("wp.acos(a0)", almost, device=device) == pytest.approx(-2896.3094, rel=1e-6)
    for scale in (1e-25, 1e-23, 1.0, 1e20, 1e25):
        y, x = partial("wp.atan2(a0, a1)", 3 * scale, 4 * scale, device=device)
        assert y * scale == pytest.approx(4 / 25, rel=1e-6)
        assert x * scale == pytest.approx(-3 / 25, rel=1e-6)
    assert partial("wp.atan2(a0, a1)", 0.0, 0.0, device=device) == [0, 0]


def test_parts_of_numbers(device):
    assert partial("wp.frac(a0)", 5.5, device=device) == 1
    assert partial("wp.mod(a0, a1)", 5.5, 2.0, device=device) == [1, -2]
    assert partial("wp.mod(a0, a1)", -5.5, 2.0, device=device) == [1, 2]
    assert partial("wp.floor(a0) * a0", 2.5, device=device) == 2


def test_ties(device):
    assert partial("wp.min(a0, a1)", 2.0, 2.0, device=device) == [0, 1]
    assert partial("wp.max(a0, a1)", 2.0, 2.0, device=device) == [0, 1]
    assert partial("wp.min(a0, a1)", 1.0, math.nan, device=device) == [1, 0]
    assert partial("wp.max(a0, a1)", math.nan, 1.0, device=device) == [0, 1]
    assert partial("wp.abs(a0)", 0.0, device=device) == 1
    assert partial("wp.abs(a0)", -0.0, device=device) == 1


@pytest.mark.parametrize("x, expected", [(0.5, [1, 0, 0]), (-3.0, [0, 1, 0]), (4.0, [0, 0, 1]),
                                         (0.0, [1, 0, 0]), (1.0, [1, 0, 0])])  # fmt: skip
def test_clamp(device, x, expected):
    assert partial("wp.clamp(a0, a1, a2)", x, 0.0, 1.0, device=device) == expected


def test_copysign(device):
    for x, y, expected in ((2.0, -0.0, -1), (2.0, 0.0, 1), (-2.0, -0.0, 1), (-2.0, 3.0, -1)):
        assert partial("wp.copysign(a0, a1)", x, y, device=device) == [expected, 0]


def test_branch_not_taken(device):
    found = partial("a0 if a1 > 0.0 else a0 / a2", 2.0, 1.0, 0.0, device=device)
    assert found == [1, 0, 0]


@pytest.mark.parametrize("scale", [1e-25, 1.0, 1e25])
def test_length_of_any_scale(device, scale):
    v = np.array([3.0, 4.0, 12.0]) * scale
    (g,) = gradients("wp.length(a0)", [v], [wp.vec3], device, result=F32)
    np.testing.assert_allclose(g, v / np.linalg.norm(v), rtol=1e-6)
    w = np.array([1.0, -2.0, 0.5])
    n = v / np.linalg.norm(v)
    expression = "wp.dot(wp.vec3(1.0, -2.0, 0.5), wp.normalize(a0))"
    (g,) = gradients(expression, [v], [wp.vec3], device, result=F32)
    np.testing.assert_allclose(g * scale, (w - n * (n @ w)) / 13, rtol=1e-5, atol=1e-7)


def test_zero_vector(device):
    for expression in ("wp.length(a0)", "wp.norm_l2(a0)", "wp.dot(a0, wp.normalize(a0))"):
        (g,) = gradients(expression, [[0.0, 0.0, 0.0]], [wp.vec3], device, result=F32)
        np.testing.assert_array_equal(g, 0)


def test_determinant_of_rank_two(device):
    a = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [5.0, 7.0, 9.0]])
    (g,) = gradients("wp.determinant(a0)", [a], [wp.mat33d], device, result=F64)
    u, s, vt = np.linalg.svd(a)
    cofactor = np.linalg.det(u) * np.linalg.det(vt) * u @ np.diag(
        [s[1] * s[2], s[0] * s[2], s[0] * s[1]]) @ vt  # fmt: skip
    np.testing.assert_allclose(g, cofactor, atol=1e-12)


def test_singular_matrix_has_an_inverse_of_zero(device):
    (g,) = gradients("wp.inverse(a0)", [np.zeros((2, 2))], [wp.mat22], device)
    np.testing.assert_array_equal(g, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_slerp_between_equal_rotations(device, sign):
    q = np.array([0.1, 0.2, 0.3, math.sqrt(0.86)], np.float32)
    a, b, t = gradients("wp.quat_slerp(a0, a1, a2)", [q, sign * q, 0.3],
                        [wp.quat, wp.quat, F32], device)  # fmt: skip
    assert np.all(np.isfinite(a)) and np.all(np.isfinite(b))
    assert abs(t) < 1e-6


def test_axis_and_angle_of_the_identity(device):
    kernel = define(
        "@wp.kernel\ndef apply(q: wp.array(dtype=wp.quat), y: wp.array(dtype=wp.float32)):\n"
        "    axis, angle = wp.quat_to_axis_angle(q[0])\n    y[0] = angle + axis[0]\n"
    )["apply"]
    q = wp.array([[0.0, 0.0, 0.0, 1.0]], dtype=wp.quat, device=device, requires_grad=True)
    y = wp.zeros(1, dtype=F32, device=device, requires_grad=True)
    with wp.Tape() as tape:
        wp.launch(kernel, 1, [q], [y], device=device)
    tape.backward(grads={y: wp.array([1.0], dtype=F32, device=device)})
    np.testing.assert_array_equal(q.grad.numpy(), 0)


def test_half_precision_may_have_wide_gradients(device):
    x = wp.array([1e-4], dtype=wp.float16, device=device, requires_grad=True, grad_dtype=F32)
    y = wp.zeros(1, dtype=F32, device=device, requires_grad=True)
    kernel = define(
        "@wp.kernel\ndef apply(x: wp.array(dtype=wp.float16), y: wp.array(dtype=wp.float32)):\n"
        "    v = x[0]\n    y[0] = wp.float32(wp.float16(1e-4) * v * v)\n"
    )["apply"]
    with wp.Tape() as tape:
        wp.launch(kernel, 1, [x], [y], device=device)
    tape.backward(grads={y: wp.array([1.0], dtype=F32, device=device)})
    assert x.grad.dtype is F32
    assert x.grad.numpy()[0] == pytest.approx(2e-8, rel=2e-3)


def test_unary_without_derivative_is_zero(device):
    for function in (wp.sign, wp.floor, wp.ceil, wp.round, wp.rint, wp.trunc, wp.step, wp.nonzero):
        x = wp.array([1.5], dtype=F32, device=device, requires_grad=True)
        y = wp.zeros(1, dtype=F32, device=device, requires_grad=True)
        with wp.Tape() as tape:
            wp.launch(unary(function, F32, F32), 1, [x], [y], device=device)
        tape.backward(grads={y: wp.array([1.0], dtype=F32, device=device)})
        assert x.grad.numpy()[0] == 0
