"""Derivatives of functions: what users write about them, in kernels and next to them.

`@wp.func_grad`, `@wp.func_replay`, `wp.custom_vjp` and `wp.custom_jvp` give a function a derivative
of its own.
`wp.grad(f)` and `wp.hessian(f)` are derivatives to be called in kernels, `wp.fixed_point` solves
x = step(x) there. `warp._src.frontend.derivative_calls` translates all of them.
"""

from __future__ import annotations

import types as python_types
import typing

from warp._src import errors
from warp._src.kernels.function import Function
from warp._src.language.builtins import Builtin


def _only_in_kernels(name):
    return TypeError(f"'{name}' can be called in kernels and functions of kernels only")


class _Adjoint:
    """`wp.adjoint[x]` in a `@wp.func_grad` function: the cotangent of a parameter, to be added to.

    For an array, it is the array of its gradients.
    """

    def __getitem__(self, name) -> typing.Any:
        raise TypeError("`wp.adjoint` can be used in functions with `@wp.func_grad` only")

    if typing.TYPE_CHECKING:

        def __setitem__(self, name: typing.Any, value: typing.Any) -> None: ...

    def __repr__(self):
        return "wp.adjoint"


adjoint = _Adjoint()


def func_grad(forward_fn):
    """Makes the decorated function the derivative of another one.

    It has the parameters of `forward_fn`, then one for the cotangent of each of its results, and
    adds to `wp.adjoint[x]` for each parameter `x` that has a derivative. It returns nothing. If
    `forward_fn` has overloads, it belongs to the one with its types.

    Raises:
        TypeError: `forward_fn` is not a `@wp.func` function.
        WarpCodegenTypeError: the parameters do not begin with those of `forward_fn`.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def root(x: float):
        ...     return wp.sqrt(x)
        >>> @wp.func_grad(root)
        ... def root_grad(x: float, adj_ret: float):
        ...     wp.adjoint[x] += adj_ret * 0.5 / wp.max(root(x), 1.0e-3)
    """

    def decorate(function):
        _check_registered(forward_fn, function, "func_grad")
        forward_fn.pullbacks.append(function)
        return function

    return decorate


def func_replay(forward_fn):
    """Makes the decorated function run where an adjoint needs the results of another one again.

    In a function that counts with an atomic, for example, it looks up the launch's result. It has
    the parameters and results of `forward_fn`, or of one of its overloads.

    Raises:
        TypeError: `forward_fn` is not a `@wp.func` function.
        WarpCodegenTypeError: the parameters are not those of `forward_fn`.
    """

    def decorate(function):
        _check_registered(forward_fn, function, "func_replay")
        forward_fn.replays.append(function)
        return function

    return decorate


def _check_registered(forward_fn, function, name):
    from warp._src.frontend.pullbacks import check_parameters

    if not isinstance(forward_fn, Function):
        raise TypeError(
            f"{name} expects a function with `@wp.func`, but got '{type(forward_fn).__name__}'"
        )
    if not isinstance(function, python_types.FunctionType):
        raise TypeError(f"{name} expects a function, but got '{type(function).__name__}'")
    check_parameters(forward_fn, function, name)


class FunctionDerivative:
    """The function that `wp.grad` and `wp.hessian` return."""

    def __init__(self, func, name):
        if not isinstance(func, (Function, Builtin)) and type(func).__name__ != "BuiltinRef":
            raise TypeError(
                f"{name} expects a function with `@wp.func` or a builtin, but got "
                f"'{type(func).__name__}'"
            )
        self.func = func
        self.name = name

    def __call__(self, *args, **kwargs) -> typing.Any:
        raise _only_in_kernels(repr(self))

    def __repr__(self):
        shown = getattr(self.func, "key", None) or getattr(self.func, "name", "")
        return f"{self.name}({shown})"


class Gradient(FunctionDerivative):
    """`wp.grad(func)`."""


class Hessian(FunctionDerivative):
    """`wp.hessian(func)`."""


class GradientBy(FunctionDerivative):
    """`gradient_by(func, count)`."""

    def __init__(self, func, count):
        super().__init__(func, "gradient_by")
        self.count = count


def grad(func) -> Gradient:
    """The gradient of a function, to be called in kernels with the function's arguments.

    Gives one cotangent per argument, as a tuple if there are several; of results, all components
    have the cotangent 1. Arguments that have no derivative get a zero. Writes of `func` are
    dropped. Gradients may be differentiated again.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def energy(a: wp.vec3, b: wp.vec3):
        ...     return 0.5 * wp.length_sq(a - b)
        >>> @wp.kernel
        ... def forces(a: wp.array(dtype=wp.vec3), b: wp.vec3, f: wp.array(dtype=wp.vec3)):
        ...     i = wp.tid()
        ...     da, db = wp.grad(energy)(a[i], b)
        ...     f[i] = -da
    """
    return Gradient(func, "wp.grad")


def hessian(func) -> Hessian:
    """The matrix of second derivatives of a function, to be called in kernels.

    By the first argument, a scalar or a vector of n components; the others are constants. The
    function returns one scalar. Gives a scalar or an n by n matrix.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def spring(x: wp.vec3, stiffness: float):
        ...     return 0.5 * stiffness * (wp.length(x) - 1.0) ** 2.0
        >>> @wp.kernel
        ... def stiffness(x: wp.array(dtype=wp.vec3), k: wp.array(dtype=wp.mat33)):
        ...     i = wp.tid()
        ...     k[i] = wp.hessian(spring)(x[i], 2.0)
    """
    return Hessian(func, "wp.hessian")


class CustomFunction(Function):
    """A function together with derivatives of it, see `custom_vjp` and `custom_jvp`."""

    has_lasting_name = False

    def __init__(self, forward, pullback=None, pushforward=None):
        super().__init__(forward.func, forward.key)
        self.overloads = forward.overloads
        # A pushforward comes to what there is already.
        if pullback is None:
            self.pullbacks, self.replays = forward.pullbacks, forward.replays
        self.pullback = pullback or forward.pullback
        self.pushforward = pushforward or forward.pushforward

    def __call__(self, *args, **kwargs) -> typing.Any:
        result = super().__call__(*args, **kwargs)
        has_residuals = self.pullback is not None and isinstance(result, tuple)
        return result[0] if has_residuals else result


def gradient_by(func, count) -> GradientBy:
    """The gradient of a function by its first arguments, to be called in kernels, in a tuple.

    Others may be what has no gradient, such as structs of arrays.

    Args:
        func: a `@wp.func` function.
        count: of the arguments.

    Example:
        >>> import warp as wp
        >>> from warp import extend
        >>> gradient_by = extend.gradient_by
        >>> @wp.func
        ... def energy(x: float, stiffness: wp.array(dtype=float), i: int):
        ...     return 0.5 * stiffness[i] * x * x
        >>> @wp.kernel
        ... def force(x: float, stiffness: wp.array(dtype=float), f: wp.array(dtype=float)):
        ...     (slope,) = gradient_by(energy, 1)(x, stiffness, 0)
        ...     f[0] = -slope
        >>> f = wp.zeros(1, dtype=float, device="cpu")
        >>> k = wp.array([4.0], dtype=float, device="cpu")
        >>> wp.launch(force, 1, [0.5, k], [f], device="cpu")
        >>> float(f.numpy()[0])
        -2.0
    """
    return GradientBy(func, count)


def custom_vjp(f, pullback) -> CustomFunction:
    """A function like `f` that has `pullback` as its derivative.

    `f` returns a value, or a value and residuals: what the derivative needs of the computation. A
    call of the new function gives the value alone. `pullback` is called with the arguments of
    `f`, the residuals and the cotangent of the value, or without the arguments if there are
    residuals; it returns one cotangent for each argument that is a float, or is made of floats.

    Forward mode multiplies tangents with what `pullback` returns, one call for each component of
    the value; `custom_jvp` says how it is to be done in one.

    Raises:
        TypeError: one of them is not a `@wp.func` function.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def forward(x: float):
        ...     y = wp.exp(x)
        ...     return y, y
        >>> @wp.func
        ... def pullback(y: float, cotangent: float):
        ...     return y * cotangent
        >>> exp = wp.custom_vjp(forward, pullback)
        >>> float(exp(0.0))
        1.0
    """
    _check_functions("custom_vjp", f, pullback)
    return CustomFunction(f, pullback)


def custom_jvp(f, pushforward) -> CustomFunction:
    """A function like `f` that has `pushforward` as its derivative in forward mode.

    `pushforward` is called with the arguments of `f`, then a tangent for each of them that is a
    float or made of floats (of a struct, for each such field), and returns a tangent for each
    result of floats. It has to be linear in the tangents. Unless `f` has a derivative of its own,
    that of `pushforward` by the tangents is the one in reverse mode.

    Raises:
        TypeError: one of them is not a `@wp.func` function.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def root(x: float):
        ...     return wp.sqrt(x)
        >>> @wp.func
        ... def pushforward(x: float, tangent: float):
        ...     return 0.5 * tangent / wp.max(wp.sqrt(x), 1.0e-3)
        >>> safe_root = wp.custom_jvp(root, pushforward)
        >>> float(safe_root(4.0))
        2.0
    """
    _check_functions("custom_jvp", f, pushforward)
    return CustomFunction(f, pushforward=pushforward)


def _check_functions(name, *functions):
    for function in functions:
        if not isinstance(function, Function):
            raise TypeError(
                f"{name} expects functions with `@wp.func`, but got '{type(function).__name__}'"
            )


def fixed_point(step, start, *parameters):
    """The solution of x = step(x, *parameters), in kernels, from repeated application to `start`.

    Stops when x changes by no more than rounding errors, or after 1000 steps. The derivative is
    that of the solution (by the implicit function theorem), whatever way led there: it solves
    w = g + w ds/dx by the same iteration, and does not depend on `start`.

    Args:
        step: a `@wp.func` function that contracts near the solution.
        start: where to start, a float or a vector, matrix or quaternion of floats.
        parameters: further arguments of `step`.

    Raises:
        TypeError: called in Python.
    """
    raise _only_in_kernels("wp.fixed_point")


# Makes functions at compile time where a kernel calls it.
FACTORIES = (grad, hessian, gradient_by, custom_vjp, custom_jvp)


def check_no_struct_of_arrays(native, what, place) -> None:
    """Rejects structs that have no cotangent because they hold arrays."""
    for name, field in native.fields:
        if field.kind == "array":
            raise errors.WarpCodegenTypeError(
                f"{what} is a '{native.python_name}', whose array '{name}' has no cotangent",
                hint="pass the arrays as arguments of their own",
                **place,
            )
        if field.kind == "struct":
            check_no_struct_of_arrays(field, what, place)


def is_differentiable(native) -> bool:
    """True if a type of the compiler has cotangents: floats and composites of floats."""
    scalar = native.element or native
    return native.kind != "array" and scalar.kind == "float"
