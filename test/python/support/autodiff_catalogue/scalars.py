"""T1 to T23 but for singular points: arithmetic, selections, conversions."""

import numpy as np

import warp as wp

from .problem import kernel, kernel_of, printed
from .registry import case


def elementwise(p, function):
    """The kernel y[i] = function(x[i])."""
    R = p.real

    @kernel_of(function)
    def unary(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = function(x[i])

    return unary


def pairwise(p, function):
    """The kernel y[i] = function(a[i], b[i])."""
    R = p.real

    @kernel_of(function)
    def binary(a: wp.array(dtype=R), b: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = function(a[i], b[i])

    return binary


@case("T1", "the derivative of x * x is 2 x")
def square(p):
    R = p.real

    @kernel
    def squares(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = x[i] * x[i]

    x, w = p.random(9), p.random(9)
    (got,) = p.pullback(squares, 9, [p.array(x)], [p.zeros(9)], [w])
    p.close(got, 2.0 * x * w)


@case("T2", "a quotient is differentiated by both operands")
def quotient(p):
    R = p.real

    @kernel
    def quotients(a: wp.array(dtype=R), b: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = a[i] / b[i]

    a, b, w = p.random(9), p.random(9), p.random(9)
    da, db = p.pullback(quotients, 9, [p.array(a), p.array(b)], [p.zeros(9)], [w])
    p.close(da, w / b)
    p.close(db, -w * a / b**2)


@case("T11", "frac grows as its operand does")
def fraction(p):
    (got,) = p.pullback(elementwise(p, wp.frac), 2, [p.array([5.5, -0.25])], [p.zeros(2)])
    p.same(got, [1.0, 1.0])


@case("T13", "equal operands of min and max share one cotangent")
def ties(p):
    for function in (wp.min, wp.max):
        inputs = [p.array([3.0]), p.array([3.0])]
        da, db = p.pullback(pairwise(p, function), 1, inputs, [p.zeros(1)])
        p.same(da + db, [1.0])


@case("T14", "clamp hands the cotangent to the operand that it returns")
def clamped(p):
    R = p.real

    @kernel
    def clamps(
        x: wp.array(dtype=R),
        low: wp.array(dtype=R),
        high: wp.array(dtype=R),
        y: wp.array(dtype=R),
    ):
        i = wp.tid()
        y[i] = wp.clamp(x[i], low[i], high[i])

    x, low, high = [-2.0, 0.5, 3.0], [-1.0] * 3, [1.0] * 3
    dx, dlow, dhigh = p.pullback(clamps, 3, [p.array(v) for v in (x, low, high)], [p.zeros(3)])
    p.same(dx, [0.0, 1.0, 0.0])
    p.same(dlow, [1.0, 0.0, 0.0])
    p.same(dhigh, [0.0, 0.0, 1.0])


@case("T16", "floor counts as a constant")
def floors(p):
    @wp.func
    def scaled(x: p.real):
        return wp.floor(x) * x

    x = np.array([2.5, -1.25, 7.75])
    (got,) = p.pullback(elementwise(p, scaled), 3, [p.array(x)], [p.zeros(3)])
    p.same(got, np.floor(x))


@case("T17", "a conversion to int and back stops the gradient and says so once")
def conversion(p):
    R = p.real

    @wp.func
    def scaled(x: R):
        return R(int(x)) * x

    x = np.array([2.5, 3.75])
    lines = []
    with printed(lines):
        (got,) = p.pullback(elementwise(p, scaled), 2, [p.array(x)], [p.zeros(2)])
    p.same(got, [2.0, 3.0])
    said = [line for line in lines if "gradient stops" in line]
    p.holds(len(said) == 1, f"'gradient stops' is printed {len(said)} times: {lines}")


@case("T19", "softplus has the logistic function as its derivative, far out too")
def soft_plus(p):
    z = np.array([-1e4, -3.0, 0.0, 2.0, 1e4])
    (got,) = p.pullback(elementwise(p, wp.softplus), 5, [p.array(z)], [p.zeros(5)])
    half = np.exp(-np.abs(z))
    p.close(got, np.where(z < 0.0, half, 1.0) / (1.0 + half))


@case("T21", "the arm of a ternary that is not taken leaves no trace")
def ternary(p):
    R = p.real

    @kernel
    def choose(
        x: wp.array(dtype=R), t: wp.array(dtype=R), f: wp.array(dtype=int), y: wp.array(dtype=R)
    ):
        i = wp.tid()
        y[i] = x[i] if f[i] == 1 else x[i] / t[i]

    inputs = [p.array([3.0, 3.0]), p.array([0.0, 2.0]), p.ints([1, 0])]
    dx, dt = p.pullback(choose, 2, inputs, [p.zeros(2)])
    p.same(dx, [1.0, 0.5])
    p.same(dt, [0.0, -0.75])


@case("T22", "gradients of half floats may be kept in float32", precisions=("float16",))
def half_floats(p):
    R = wp.float16

    @kernel
    def small(x: wp.array(dtype=R), y: wp.array(dtype=R)):
        i = wp.tid()
        y[i] = R(1.0e-4) * x[i] * x[i]

    tenth = float(np.float16(1e-4))
    x = wp.array([1e-4], dtype=R, device=p.device, requires_grad=True, grad_dtype=wp.float32)
    (got,) = p.pullback(small, 1, [x], [p.zeros(1)])
    p.near(got, 2.0 * tenth * tenth, 1e-6)


@case("T23", "copysign reads the sign bit, of negative zero too")
def copied_sign(p):
    x, z = [2.0, 2.0, -2.0], [-0.0, 0.0, -0.0]
    dx, dz = p.pullback(pairwise(p, wp.copysign), 3, [p.array(x), p.array(z)], [p.zeros(3)])
    p.same(dx, [-1.0, 1.0, 1.0])
    p.same(dz, [0.0, 0.0, 0.0])
