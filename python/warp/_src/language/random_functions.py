"""Random functions that are written in the kernel language: curl noise, Poisson's distribution."""

from typing import Any

from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import Scalar, vec2f, vec3f, vec4f
from warp._src.types.scalars import uint32


def curlnoise(
    state: uint32,
    xy: vec2f,
    octaves: Scalar = uint32(1),
    lacunarity: float = 2.0,
    gain: float = 0.5,
):
    """Random velocity without divergence at a point of the plane."""
    total = wp.vec2()
    frequency = float(1.0)
    amplitude = float(1.0)
    for _ in range(int(octaves)):
        total += amplitude * wp.noise_gradient(state, frequency * xy)
        amplitude *= gain
        frequency *= lacunarity
    return wp.vec2(-total[1], total[0])


def _curlnoise_in_space(state: uint32, place: Any, octaves: Scalar, lacunarity: float, gain: float):
    """The same in space, or in space and time."""
    total = wp.vec3()
    frequency = float(1.0)
    amplitude = float(1.0)
    for _ in range(int(octaves)):
        point = frequency * place
        first = wp.noise_gradient(state, point)
        state = wp.rand_init(int(state), 10019689)
        second = wp.noise_gradient(state, point)
        state = wp.rand_init(int(state), 13112221)
        third = wp.noise_gradient(state, point)
        total += amplitude * wp.vec3(
            third[1] - second[2], first[2] - third[0], second[0] - first[1]
        )
        amplitude *= gain
        frequency *= lacunarity
    return total


curlnoise_in_space = Function(_curlnoise_in_space)


def _curlnoise_xyz(
    state: uint32,
    xyz: vec3f,
    octaves: Scalar = uint32(1),
    lacunarity: float = 2.0,
    gain: float = 0.5,
):
    return curlnoise_in_space(state, xyz, octaves, lacunarity, gain)


def _curlnoise_xyzt(
    state: uint32,
    xyzt: vec4f,
    octaves: Scalar = uint32(1),
    lacunarity: float = 2.0,
    gain: float = 0.5,
):
    return curlnoise_in_space(state, xyzt, octaves, lacunarity, gain)


def _log_factorial(k: float):
    """By Stirling's series, from 7 on."""
    x = k + 1.0
    product = float(1.0)
    while x < 7.0:
        product *= x
        x += 1.0
    square = 1.0 / (x * x)
    series = (1.0 / 12.0 - square * (1.0 / 360.0 - square / 1260.0)) / x
    return (x - 0.5) * wp.log(x) - x + 0.9189385332 + series - wp.log(product)


def _poisson_by_products(state: uint32, lam: float):
    limit = wp.exp(-lam)
    count = uint32(0)
    product = wp.randf(state)
    while product > limit:
        count += uint32(1)
        product *= wp.randf(state)
    return count, state


def _poisson_by_rejection(state: uint32, lam: float):
    """Hoermann, "The transformed rejection method for generating Poisson random variables",
    Insurance: Mathematics and Economics 12, 1993: algorithm PTRS."""
    b = 0.931 + 2.53 * wp.sqrt(lam)
    a = -0.059 + 0.02483 * b
    log_inverse_alpha = wp.log(1.1239 + 1.1328 / (b - 3.4))
    inner = 0.9277 - 3.6224 / (b - 2.0)
    count = float(0.0)
    rejected = bool(True)
    while rejected:
        u = wp.randf(state) - 0.5
        v = wp.randf(state)
        edge = 0.5 - wp.abs(u)
        count = wp.floor((2.0 * a / edge + b) * u + lam + 0.43)
        if edge >= 0.07 and v <= inner:
            rejected = False
        elif count >= 0.0 and not (edge < 0.013 and v > edge):
            density = count * wp.log(lam) - lam - log_factorial(count)
            rejected = wp.log(v) + log_inverse_alpha - wp.log(a / (edge * edge) + b) > density
    return uint32(count), state


def _poisson(state: uint32, lam: float):
    """A number, and the state after it was drawn."""
    count = uint32(0)
    after = state
    if lam >= 10.0:
        count, after = poisson_by_rejection(state, lam)
    elif lam > 0.0:
        count, after = poisson_by_products(state, lam)
    return count, after


log_factorial = Function(_log_factorial, "log_factorial")
poisson_by_products = Function(_poisson_by_products, "poisson_by_products")
poisson_by_rejection = Function(_poisson_by_rejection, "poisson_by_rejection")
POISSON = Function(_poisson, "poisson")
FUNCTIONS = {"curlnoise": Function(curlnoise)}
FUNCTIONS["curlnoise"].__module__ = "warp"
FUNCTIONS["curlnoise"].add_overload(_curlnoise_xyz)
FUNCTIONS["curlnoise"].add_overload(_curlnoise_xyzt)
