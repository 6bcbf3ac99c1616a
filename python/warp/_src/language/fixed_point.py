"""`wp.fixed_point`, written in the kernel language."""

import typing

from warp._src.derivatives.functions import CustomFunction
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import Float, matrix, quaternion, vector

# Steps after which an iteration ends that does not converge.
_LIMIT = 1000


def pulled_back(function, arrays, cotangent, *arguments):
    """The cotangents of a function's arguments; translated by the front end.

    arrays: add to the gradients of arrays among them, too.
    """
    raise TypeError("'pulled_back' can be called in kernels only")


def _largest_number(x: Float):
    return wp.abs(x)


def _largest_of_vector(x: vector(typing.Any, Float)):
    return wp.max(wp.abs(x))


def _largest_of_quaternion(x: quaternion(Float)):
    return wp.max(wp.max(wp.abs(x[0]), wp.abs(x[1])), wp.max(wp.abs(x[2]), wp.abs(x[3])))


def _largest_of_matrix(x: matrix((typing.Any, typing.Any), Float)):
    largest = x.dtype(0.0)
    for i in range(wp.static(x.shape[0])):
        largest = wp.max(largest, wp.max(wp.abs(x[i])))
    return largest


size = Function(_largest_number, "size")
for _overload in (_largest_of_vector, _largest_of_quaternion, _largest_of_matrix):
    size.add_overload(_overload)


def _rounding_of_half(x: wp.float16):
    return wp.float16(2.0e-3)


def _rounding_of_float(x: wp.float32):
    return wp.float32(2.4e-7)


def _rounding_of_double(x: wp.float64):
    return wp.float64(4.5e-16)


rounding = Function(_rounding_of_half, "rounding")
for _overload in (_rounding_of_float, _rounding_of_double):
    rounding.add_overload(_overload)


def _is_done(count: int, change: Float, last: Float, scale: Float):
    """True if x stopped changing, or only rounding errors still change it."""
    if not change > rounding(change) * scale or count >= _LIMIT:
        return True
    return count > 1 and change >= last and change <= wp.sqrt(rounding(change)) * scale


is_done = Function(_is_done, "is_done")


def _solution(step: typing.Callable, start: typing.Any, parameters: typing.Any):
    x = start
    last = size(start)
    done = False
    count = int(0)
    while not done:
        new = step(x, *parameters)
        change = size(new - x)
        count += 1
        done = is_done(count, change, last, size(new))
        last = change
        x = new
    return x, x


def _pullback(
    step: typing.Callable,
    start: typing.Any,
    parameters: typing.Any,
    solution: typing.Any,
    cotangent: typing.Any,
):
    """Solves w = cotangent + w ds/dx; the cotangents of the parameters are w ds/dp."""
    w = cotangent
    last = size(cotangent)
    done = False
    count = int(0)
    while not done:
        new = cotangent + pulled_back(step, False, w, solution, *parameters)[0]
        change = size(new - w)
        count += 1
        done = is_done(count, change, last, size(new))
        last = change
        w = new
    return type(start)(), pulled_back(step, True, w, solution, *parameters)[1:]


FIXED_POINT = CustomFunction(Function(_solution, "fixed_point"), Function(_pullback))
