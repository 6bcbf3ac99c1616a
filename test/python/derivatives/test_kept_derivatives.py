"""Large functions with several calls are differentiated once; their calls stay in derivatives."""

import numpy as np
import pytest

import warp as wp
from frontend_programs import define


def tree(body, levels):
    """A kernel that calls the last of functions of which each is `body` with the one before."""
    lines = ["@wp.func\ndef f0(x: float):\n    return x\n"]
    lines += [
        f"@wp.func\ndef f{level}(x: float):\n    {body.format(f=f'f{level - 1}')}\n"
        for level in range(1, levels + 1)
    ]
    lines.append(
        "@wp.kernel\ndef kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):\n"
        f"    i = wp.tid()\n    y[i] = f{levels}(x[i])\n"
    )
    return define("\n".join(lines))["kernel"]


def fold(x, level):
    """Value and derivative of `f(x * 0.5) + f(x * x)`."""
    if level == 0:
        return x, np.ones_like(x)
    half, square = fold(0.5 * x, level - 1), fold(x * x, level - 1)
    return half[0] + square[0], 0.5 * half[1] + 2.0 * x * square[1]


def follow(x, level):
    """Value and derivative of the branches: products of the factors on the way."""
    value, factor, slope = x.copy(), np.ones_like(x), np.ones_like(x)
    for _ in range(level):
        large = value > 1.0
        factor = np.where(large, factor, 2.0 * factor)
        slope = np.where(large, 0.5 * slope, slope)
        value = np.where(large, 0.5 * value, value + 1.0)
    return value * factor, slope * factor


TREES = {
    "sums": ("return {f}(x * 0.5) + {f}(x * x)", 14, fold),
    "branches": (
        "if x > 1.0:\n        return {f}(x * 0.5)\n    return {f}(x + 1.0) * 2.0",
        40,
        follow,
    ),
}


def gradients(kernel, *inputs):
    """Values, the gradients of their sum by the adjoint, and derivatives along ones."""
    made = [wp.array(one, dtype=float, device="cpu", requires_grad=True) for one in inputs]
    count = len(inputs[0])
    ones = wp.ones(count, dtype=float, device="cpu")

    def function(*arrays):
        y = wp.zeros(count, dtype=float, device="cpu", requires_grad=True)
        wp.launch(kernel, count, [*arrays, y], device="cpu")
        return y

    with wp.Tape() as tape:
        y = function(*made)
    tape.backward(grads={y: ones})
    tangent = wp.autograd.jvp(function, made, [ones] * len(made))
    return y.numpy(), [one.grad.numpy() for one in made], tangent.numpy()


@pytest.mark.parametrize("case", TREES)
def test_trees(case):
    """Values and derivatives follow the formula, in both modes."""
    body, levels, formula = TREES[case]
    x = np.array([0.5, -0.75, 0.25, 0.9], np.float32)
    y, (gradient,), tangent = gradients(tree(body, levels), x)
    value, slope = formula(x.astype(np.float64), levels)
    np.testing.assert_allclose(y, value, rtol=2e-5)
    np.testing.assert_allclose(gradient, slope, rtol=2e-5)
    np.testing.assert_allclose(tangent, slope, rtol=2e-5)


@pytest.mark.parametrize("derivative", ["adjoint", "tangent"])
def test_code_follows_the_text(derivative):
    """There are 24 levels, which would be 2^24 copies, for CPUs and GPUs."""
    kernel = tree(TREES["sums"][0], 24)
    for stage in ({"stage": "llvm"}, {"stage": "ptx", "arch": 90}):
        text = kernel.ir(derivative=derivative, **stage)
        assert len(text.splitlines()) < 40_000


STRUCTS = """
@wp.struct
class Point:
    x: float
    tag: int
    v: wp.vec2

@wp.struct
class State:
    point: Point
    scale: float

@wp.func
def f0(s: State):
    return s
"""
LEVEL = """
@wp.func
def f{level}(s: State):
    t = s
    t.point.x = 0.5 * s.point.x
    t.scale = 0.5 * s.scale
    a = f{before}(t)
    t.point.x = s.point.x * s.point.x
    t.point.v = s.point.v * 2.0
    t.point.tag = s.point.tag + 1
    b = f{before}(t)
    r = State()
    r.point.x = a.point.x + b.point.x
    r.point.v = 0.5 * (a.point.v + b.point.v)
    r.point.tag = wp.max(a.point.tag, b.point.tag)
    r.scale = a.scale + b.scale
    return r
"""
OF_STRUCTS = """
@wp.kernel
def kernel(x: wp.array(dtype=float), y: wp.array(dtype=float)):
    i = wp.tid()
    s = State()
    s.point.x = x[i]
    s.point.v = wp.vec2(x[i], 1.0)
    s.scale = 3.0 * x[i]
    r = f{last}(s)
    y[i] = r.point.x + r.point.v[0] + r.point.v[1] + r.scale * float(r.point.tag)
"""


def tree_of_structs(levels):
    lines = [LEVEL.format(level=level, before=level - 1) for level in range(1, levels + 1)]
    return define(STRUCTS + "".join(lines) + OF_STRUCTS.format(last=levels))["kernel"]


def test_structs():
    """Structs in structs, with integers, among arguments and results."""
    levels = 12
    x = np.array([0.5, -0.75, 0.25, 0.9], np.float32)
    y, (gradient,), tangent = gradients(tree_of_structs(levels), x)
    x = x.astype(np.float64)
    value, slope = fold(x, levels)
    # A vector becomes 1.5 times as long at each level, the tag counts levels.
    value += 1.5**levels * (x + 1.0) + 3.0 * levels * x
    slope += 1.5**levels + 3.0 * levels
    np.testing.assert_allclose(y, value, rtol=2e-5)
    np.testing.assert_allclose(gradient, slope, rtol=2e-5)
    np.testing.assert_allclose(tangent, slope, rtol=2e-5)


@pytest.mark.parametrize("derivative", ["adjoint", "tangent"])
def test_code_with_structs_follows_the_text(derivative):
    """As above, with structs that are passed and returned."""
    kernel = tree_of_structs(24)
    for stage in ({"stage": "llvm"}, {"stage": "ptx", "arch": 90}):
        text = kernel.ir(derivative=derivative, **stage)
        assert len(text.splitlines()) < 40_000


BUDGET = {"inline_budget": 64}


@wp.func
def turn(p: wp.vec3, m: wp.mat33, degree: int, flip: bool):
    """A vector that a loop turns and clamps, its length, and a count."""
    q = m * p
    count = int(0)
    for i in range(6):
        if i >= degree:
            break
        q = m * q * 0.5 + wp.cross(p, q)
        if flip:
            q = wp.vec3(q[0], q[1] * q[2], wp.max(q[2], 0.1))
        count += 1
    return q, wp.length(q), count


@wp.func
def mixed(x: float, y: float, degree: int):
    m = wp.mat33(x, 0.5, y, -y, x, 0.25, 0.5, x * y, 1.0)
    a, s, n = turn(wp.vec3(x, y, 0.5), m, degree, True)
    b, t, k = turn(a, m, degree + 1, False)
    return wp.dot(a, b) + s * t + float(n + k) * x


@wp.kernel
def compositions(x: wp.array(dtype=float), y: wp.array(dtype=float), z: wp.array(dtype=float)):
    i = wp.tid()
    z[i] = mixed(x[i], y[i], i % 3) + mixed(y[i], x[i], 2)


def numpy_turn(p, m, degree, flip):
    q, count = m @ p, 0
    for _ in range(min(degree, 6)):
        q = m @ q * 0.5 + np.cross(p, q)
        if flip:
            q = np.array([q[0], q[1] * q[2], max(q[2], 0.1)])
        count += 1
    return q, np.sqrt(q @ q), count


def numpy_mixed(x, y, degree):
    m = np.array([[x, 0.5, y], [-y, x, 0.25], [0.5, x * y, 1.0]])
    a, s, n = numpy_turn(np.array([x, y, 0.5]), m, degree, True)
    b, t, k = numpy_turn(a, m, degree + 1, False)
    return a @ b + s * t + (n + k) * x


def test_vectors_matrices_and_several_results():
    """Integers and booleans among the arguments; against differences in float64."""
    kernel = wp.kernel(compositions.func, module="unique", module_options=BUDGET)
    random = np.random.default_rng(5)
    x, y = random.uniform(-0.8, 0.8, (2, 9)).astype(np.float32)

    def value(x, y):
        return np.array(
            [
                numpy_mixed(a, b, i % 3) + numpy_mixed(b, a, 2)
                for i, (a, b) in enumerate(zip(x, y, strict=True))
            ]
        )

    z, (of_x, of_y), tangent = gradients(kernel, x, y)
    x, y, h = x.astype(np.float64), y.astype(np.float64), 1e-6
    np.testing.assert_allclose(z, value(x, y), rtol=1e-4, atol=1e-5)
    slope_x = (value(x + h, y) - value(x - h, y)) / (2 * h)
    slope_y = (value(x, y + h) - value(x, y - h)) / (2 * h)
    np.testing.assert_allclose(of_x, slope_x, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(of_y, slope_y, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(tangent, slope_x + slope_y, rtol=1e-3, atol=1e-4)


def ended(x, level):
    """Value and derivative of a loop that a condition on its sum ends."""
    if level == 0:
        return x, 1.0
    s, slope = 0.0, 0.0
    for _ in range(4):
        if s > x:
            break
        s, slope = 0.5 * s + 0.3 * np.sin(x + s), 0.5 * slope + 0.3 * np.cos(x + s) * (1.0 + slope)
    (half, of_x), (other, of_s) = ended(0.5 * x, level - 1), ended(s, level - 1)
    return 0.5 * half + 0.25 * other + s, 0.25 * of_x + (0.25 * of_s + 1.0) * slope


def left(x, level):
    """Value and derivative of a loop with a return and a step that is skipped."""
    if level == 0:
        return x, 1.0
    s, slope = 0.0, 0.0
    for i in range(4):
        if x > i - 2.0:
            return s, slope
        if i == 2:
            continue
        s, slope = s + np.sin(x * (i + 1)), slope + np.cos(x * (i + 1)) * (i + 1)
    (half, of_x), (other, of_s) = left(0.5 * x, level - 1), left(0.5 * s, level - 1)
    return 0.5 * half + 0.25 * other + s, 0.25 * of_x + (0.125 * of_s + 1.0) * slope


LOOPS = {
    # Sums of earlier iterations are kept in memory.
    "break": (
        "s = float(0.0)\n    for i in range(4):\n        if s > x:\n            break\n"
        "        s = 0.5 * s + 0.3 * wp.sin(x + s)\n"
        "    return 0.5 * {f}(x * 0.5) + 0.25 * {f}(s) + s",
        5,
        ended,
    ),
    # Functions that stay have such loops.
    "return": (
        "s = float(0.0)\n    for i in range(4):\n        if x > float(i) - 2.0:\n"
        "            return s\n        if i == 2:\n            continue\n"
        "        s = s + wp.sin(x * float(i + 1))\n"
        "    return 0.5 * {f}(x * 0.5) + 0.25 * {f}(s * 0.5) + s",
        12,
        left,
    ),
}


@pytest.mark.parametrize("case", LOOPS)
@pytest.mark.parametrize("count", [1, 19])
def test_loops_that_end_early(case, count):
    """Threads end them after different numbers of iterations."""
    body, levels, formula = LOOPS[case]
    kernel = wp.kernel(tree(body, levels).func, module="unique", module_options=BUDGET)
    x = np.random.default_rng(2).uniform(-3.0, 2.0, count).astype(np.float32)
    y, (gradient,), tangent = gradients(kernel, x)
    value, slope = np.array([formula(float(one), levels) for one in x]).T
    np.testing.assert_allclose(y, value, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(gradient, slope, rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(tangent, slope, rtol=1e-4, atol=1e-4)
    kernel.ir(derivative="adjoint", stage="ptx", arch=90)
