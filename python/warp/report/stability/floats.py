"""Floating point in kernels: N5 to N13."""

import functools
import math

import numpy as np

import warp as wp
from warp.report.stability._case import case
from warp.report.stability.rotations import BOTH, wide


def ulps(found, exact, dtype):
    """Distances in units of the last place of the exact result."""
    spacing = np.spacing(np.abs(exact.astype(dtype))).astype(np.longdouble)
    with np.errstate(all="ignore"):
        error = np.abs(wide(found) - exact) / spacing
    same = (found == exact) | (np.isnan(found) & np.isnan(exact))
    return np.where(same, 0.0, error)


@functools.cache
def make_contraction(real):
    @wp.func
    def mixed(a: real, b: real, c: real):
        return a * b + c, (a * b + c) - (c + a * b), wp.sqrt(a * a + b * b)

    return mixed


@case("N5", "the same bits with and without optimization, and of both orders of a sum", BOTH)
def contraction(p):
    operands = [p.array(p.random.normal(size=4000).astype(p.dtype)) for _ in range(3)]
    a, b, c = (wide(one.numpy()) for one in operands)
    found = p.map(make_contraction(p.real), *operands)
    # Fused or not: within a rounding of the product and one of the sum.
    p.check("a b + c", np.abs(found[0] - (a * b + c)) / (np.abs(a * b) + np.abs(c)), 2 * p.u)
    p.check("order of operands", found[1], 0.0, a=a, b=b, c=c)
    p.check("sqrt(a a + b b)", ulps(found[2], np.sqrt(a * a + b * b), p.dtype), 2.5)


@functools.cache
def make_products(real):
    vec2 = wp.types.vector(2, real)
    mat22 = wp.types.matrix((2, 2), real)

    @wp.func
    def products(a: real, b: real, c: real, d: real):
        return wp.determinant(mat22(a, c, d, b)), wp.dot(vec2(a, c), vec2(b, d))

    return products


@case("N6", "a b - c d under cancellation: determinant of 2 x 2, dot products", BOTH)
def difference_of_products(p):
    n = 4000
    a, b = p.random.uniform(1, 2, n).astype(p.dtype), p.random.uniform(1, 2, n).astype(p.dtype)
    c = np.nextafter(a, np.array(2, p.dtype))
    d = np.nextafter(b, np.array(0, p.dtype))
    found, dot = p.map(make_products(p.real), *(p.array(one) for one in (a, b, c, d)))
    from fractions import Fraction

    both = [tuple(map(Fraction, row)) for row in zip(*(x.tolist() for x in (a, b, c, d)))]
    exact = np.array([float(x * y - z * w) for x, y, z, w in both])
    p.check("determinant, ulp", ulps(found, wide(exact), p.dtype), 1.5, a=a, b=b, c=c, d=d)
    total = np.array([float(x * y + z * w) for x, y, z, w in both])
    p.check("dot", (dot - total) / total, 2 * p.u, a=a, b=b, c=c, d=d)


@functools.cache
def make_roots(real):
    @wp.func
    def small_root(b: real):
        return real(2.0) / (b + wp.sqrt(b * b - real(4.0)))

    @wp.func
    def careful(x: real):
        s = wp.sin(real(0.5) * x)
        return wp.log1p(x), wp.expm1(x), wp.hypot(x, real(3e-5)), real(2.0) * s * s / (x * x)

    return small_root, careful


@case("N7", "small roots, log1p, expm1, hypot and (1 - cos x) / x^2 near zero", BOTH)
def cancellation(p):
    x = np.geomspace(1e-12, 1e-3, 500).astype(p.dtype)
    root, careful = make_roots(p.real)
    b = np.array([1e8 if p.dtype == "float64" else 1e4], p.dtype)
    found = p.map(root, p.array(b))
    exact = 2 / (wide(b) + np.sqrt(wide(b) ** 2 - 4))
    p.check("small root of x^2 - b x + 1", found / exact - 1, 3 * p.u, b=b)
    found = p.map(careful, p.array(x))
    w = wide(x)
    exact = (np.log1p(w), np.expm1(w), np.hypot(w, wide(np.array(3e-5, p.dtype))))
    exact += (2 * np.sin(w / 2) ** 2 / w**2,)
    names = ("log1p", "expm1", "hypot", "(1 - cos x) / x^2")
    for name, one, right in zip(names, found, exact):
        p.check(name, one / right - 1, 6 * p.u, x=x)


@functools.cache
def make_selection(real):
    vec2 = wp.types.vector(2, real)

    @wp.func
    def select(a: real, b: real):
        low, high = wp.min(vec2(a, b), vec2(b, a)), wp.max(vec2(a, b), vec2(b, a))
        return wp.min(a, b), wp.max(a, b), low[0], high[1], wp.min(vec2(a, b)), wp.max(vec2(a, b))

    @wp.kernel
    def update(value: wp.array(dtype=real), low: wp.array(dtype=real), high: wp.array(dtype=real)):
        i = wp.tid()
        wp.atomic_min(low, 0, value[i])
        wp.atomic_max(high, 0, value[i])

    return select, update


def number_limits(a, b):
    """IEEE 754-2019 minimumNumber and maximumNumber: numbers before NaN, -0 below +0."""

    def key(x):
        return (x, math.copysign(1.0, x))

    given = [x for x in (a, b) if not math.isnan(x)]
    return (min(given, key=key), max(given, key=key)) if given else (math.nan, math.nan)


def differing(found, exact):
    """True if a number, or the sign of a zero, is another."""
    same = (found == exact) & (np.signbit(found) == np.signbit(exact))
    return np.where(same | (np.isnan(found) & np.isnan(exact)), 0.0, 1.0)


@case("N9", "min and max of NaN, signed zeros and infinities: minimumNumber, maximumNumber", BOTH)
def selection(p):
    values = [math.nan, -0.0, 0.0, math.inf, -math.inf, 1.0, -1.0, 5e-324]
    a, b = (one.ravel().astype(p.dtype) for one in np.meshgrid(values, values))
    limits = [number_limits(x, y) for x, y in zip(a.tolist(), b.tolist())]
    select, update = make_selection(p.real)
    found = p.map(select, p.array(a), p.array(b))
    names = ("min", "max", "min of vectors", "max of vectors", "min(vector)", "max(vector)")
    for k, name in enumerate(names):
        exact = np.array([pair[k % 2] for pair in limits])
        p.check(name, differing(found[k], exact), 0.0, a=a, b=b)
    for x, y in ((0.0, -0.0), (-0.0, 0.0), (math.nan, 1.0), (1.0, math.nan)):
        low, high = p.array([x]), p.array([x])
        p.launch(update, 1, p.array([y]), low, high)
        exact = number_limits(x, y)
        error = differing(np.array([low.numpy()[0], high.numpy()[0]]), np.array(exact))
        p.check("atomic_min, atomic_max", error.max(), 0.0, held=[x], given=[y])


@functools.cache
def make_integers(real):
    @wp.func
    def cast(x: real):
        return wp.int32(x), wp.uint8(x), wp.int64(x)

    @wp.func
    def divide(a: int, b: int):
        return a // b, a % b, a << b, a >> b

    return cast, divide


@case("N10", "casts of NaN, infinities and large numbers; division of negatives; wide shifts", BOTH)
def integers(p):
    cast, divide = make_integers(p.real)
    x = np.array([math.nan, math.inf, -math.inf, 1e10, -1e10, 1e30, 2.9, -2.9, -0.0], p.dtype)
    found = p.map(cast, p.array(x))
    for one, kind in zip(found, (np.int32, np.uint8, np.int64)):
        ends = np.iinfo(kind)
        exact = [0 if math.isnan(v) else min(max(v, ends.min), ends.max) for v in x.tolist()]
        exact = [int(v) for v in exact]
        wrong = [int(f) != e for f, e in zip(one.tolist(), exact)]
        p.check(f"{kind.__name__}: saturates, NaN is 0", np.array(wrong, float), 0.0, x=x)
    a = np.array([7, -7, 7, -7, 0, -(2**31), 5, 1, -1], np.int32)
    b = np.array([3, 3, -3, -3, 5, 7, 1, 31, 31], np.int32)
    found = p.map(divide, p.array(a, wp.int32), p.array(b, wp.int32))
    # Quotients are rounded down, remainders have the dividend's sign as in C.
    p.check("//", (found[0] != a // b).astype(float), 0.0, a=a, b=b)
    remainder = np.fmod(a.astype(np.int64), b)
    p.check("%", (found[1] != remainder).astype(float), 0.0, a=a, b=b)


@functools.cache
def make_subnormal(real):
    @wp.func
    def arithmetic(a: real, b: real):
        return a + b, a - b, a * real(0.5), a / real(2.0), wp.sqrt(a)

    return arithmetic


@case("N11", "subnormal numbers through + - * / and the square root", BOTH)
def subnormals(p):
    tiny = np.finfo(p.dtype).smallest_subnormal
    a = (np.arange(1, 2001) * tiny * 977).astype(p.dtype)
    b = (np.arange(2000, 0, -1) * tiny * 31).astype(p.dtype)
    found = p.map(make_subnormal(p.real), p.array(a), p.array(b))
    half = np.array(0.5, p.dtype)
    for name, one, exact in zip("+-*/", found, (a + b, a - b, a * half, a / (1 / half))):
        p.check(name, (one != exact).astype(float), 0.0, a=a, b=b)
    p.check("sqrt, ulp", ulps(found[4], np.sqrt(wide(a)), p.dtype), 0.5001, a=a)


@functools.cache
def make_unary(real, name):
    function = getattr(wp, name)

    @wp.func
    def unary(x: real):
        return function(x)

    return unary


#: Ranges of the operands, as exponents of ten, and whether negative ones are taken.
UNARY = {
    "sin": (-30, 6, True), "cos": (-30, 6, True), "tan": (-30, 5, True),
    "exp": (-30, 1.9, True), "expm1": (-30, 1.9, True), "log": (-37, 37, False),
    "log1p": (-30, 30, False), "log2": (-37, 37, False), "log10": (-37, 37, False),
    "sqrt": (-37, 37, False), "cbrt": (-37, 37, True), "sinh": (-30, 1.9, True),
    "cosh": (-30, 1.9, True), "tanh": (-30, 2, True), "asin": (-30, 0, True),
    "acos": (-30, 0, True), "atan": (-30, 30, True),
}  # fmt: skip


#: Largest errors of CUDA's functions by its programming guide, in units of the last place, beside
#: the correctly rounded result, which is half a unit off itself.
CUDA_ERRORS = {
    "sin": 2, "cos": 2, "tan": 4, "exp": 2, "expm1": 1, "log": 1, "log1p": 1, "log2": 1,
    "log10": 2, "sqrt": 0, "cbrt": 1, "sinh": 3, "cosh": 2, "tanh": 2, "asin": 2, "acos": 2,
    "atan": 2,
}  # fmt: skip


@case("N13", "elementary functions over their range", ("float32",))
def elementary(p):
    for name, (first, last, negative) in UNARY.items():
        x = 10.0 ** p.random.uniform(first, last, 20000)
        if negative:
            x *= p.random.choice([-1.0, 1.0], x.size)
        x = x.astype(p.dtype)
        reference = {"asin": "arcsin", "acos": "arccos", "atan": "arctan"}.get(name, name)
        exact = getattr(np, reference)(wide(x))
        found = p.map(make_unary(p.real, name), p.array(x))
        limit = 1.0 if p.device == "cpu" else CUDA_ERRORS[name] + 0.5
        p.check(f"{name}, ulp", ulps(found, exact, p.dtype), limit, x=x)
    q = np.concatenate(
        [10.0 ** p.random.uniform(-30, 0, 9000), 1 - 10.0 ** np.linspace(-7, 0, 999)]
    )
    q = q[np.abs(q) < 1].astype(p.dtype)
    q = q[q < 1]
    found = p.map(make_unary(p.real, "erfinv"), p.array(q))
    exact = inverse_error_function(wide(q), found)
    # As CUDA's erfinvf.
    p.check("erfinv, ulp", ulps(found, exact, p.dtype), 2.0, x=q)


def inverse_error_function(y, start):
    """Newton's method from a close start, in float64 with the series of erf."""
    x = start.astype(np.float64)
    for _ in range(3):
        value = np.array([math.erf(v) if v < 0.5 else 1.0 - math.erfc(v) for v in x])
        # Beyond 0.5 the complement keeps the digits.
        gap = np.array(
            [
                math.erf(v) - float(w) if v < 0.5 else float(1 - w) - math.erfc(v)
                for v, w in zip(x, y)
            ]
        )
        x = np.where(value == value, x - gap * np.sqrt(np.pi) / 2 * np.exp(x * x), x)
    return wide(x)
