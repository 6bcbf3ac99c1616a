"""`wp.overload`: generic kernels with types chosen before the first launch."""

from __future__ import annotations

import types as python_types

from warp._src import errors
from warp._src.argument_kinds import DICT, KERNEL, LIST
from warp._src.arguments import checked
from warp._src.arrays.array import array
from warp._src.arrays.indexed import indexedarray
from warp._src.kernels.modules import all_modules, kernel_name
from warp._src.types import annotations, dtypes
from warp._src.types.annotations import is_generic
from warp._src.types.native import ArrayType


@checked(arg_types=LIST | DICT)
def overload(kernel, arg_types=None):
    """A generic kernel for given argument types.

    As a decorator it takes a function that has the name of a generic kernel and the annotations of
    the overload, and whose body is empty; it returns the generic kernel.

    Args:
        kernel: the generic kernel.
        arg_types: types of all parameters in order, or of the generic ones by name; arrays stand
            for their types.

    Raises:
        WarpError: the kernel is not generic, or there are more or fewer types than parameters.
        TypeError: a type does not fit its parameter.

    Example:
        >>> import warp as wp
        >>> @wp.kernel
        ... def fill(x: wp.array(dtype=wp.Scalar), value: wp.Scalar):
        ...     x[wp.tid()] = value
        >>> fill_float = wp.overload(fill, [wp.array(dtype=float), float])
    """
    if KERNEL.fits(kernel):
        return _specialized(kernel, arg_types or {})
    if not isinstance(kernel, python_types.FunctionType):
        raise TypeError(f"expects a generic kernel, but got '{type(kernel).__name__}'")
    if kernel.__annotations__.get("return") not in (None, "None", type(None)):
        raise errors.WarpTypeError(
            f"overload of '{kernel.__name__}' has a return annotation, leave it out",
            code="overload-return",
        )
    generic = _named(kernel)
    _specialized(generic, _declared(kernel))
    return generic


def _named(function):
    """The generic kernel whose function has the name of this one."""
    named = [
        kernel
        for module in all_modules()
        for kernel in module.kernels.values()
        if kernel.func.__module__ == function.__module__
        and kernel.is_generic
        and kernel.func.__qualname__ == function.__qualname__
    ]
    if len(named) != 1:
        found = "there are several kernels" if named else "there is no generic kernel"
        raise errors.WarpError(
            f"{found} '{kernel_name(function)}' to overload",
            code="overload-ambiguous" if named else None,
            facts={"name": kernel_name(function)},
        )
    return named[0]


def _declared(function) -> dict:
    import inspect

    spaces = [inspect.getclosurevars(function).nonlocals, function.__globals__]
    found = function.__annotations__.items()
    return {name: annotations.evaluate(value, spaces) for name, value in found if name != "return"}


def _specialized(kernel, arg_types):
    declared = _declared(kernel.func)
    if not kernel.is_generic:
        raise errors.WarpError(f"kernel '{kernel.key}' is not generic, so it has no overloads")
    if not isinstance(arg_types, dict):
        if len(arg_types) != len(declared):
            raise errors.WarpError(
                f"overload('{kernel.key}'): expects {len(declared)} types, but got {len(arg_types)}"
            )
        arg_types = dict(zip(declared, arg_types, strict=True))
    unknown = set(arg_types) - set(declared)
    if unknown:
        raise errors.WarpError(f"kernel '{kernel.key}' has no parameter '{unknown.pop()}'")
    chosen = {}
    for name, annotation in declared.items():
        wanted = _type_of(arg_types.get(name, annotation))
        if is_generic(wanted) or not _fits(annotation, wanted):
            raise TypeError(
                f"overload('{kernel.key}'): parameter '{name}' expects a type for "
                f"'{dtypes.type_repr(annotation)}', but got '{dtypes.type_repr(wanted)}'"
            )
        chosen[name] = wanted
    return _made(kernel, chosen)


def _type_of(wanted):
    """A type, or that of an array."""
    if isinstance(wanted, indexedarray):
        return wanted.annotation(wanted.dtype, wanted.ndim)
    return ArrayType(wanted.dtype, wanted.ndim) if isinstance(wanted, array) else wanted


def _fits(annotation, wanted) -> bool:
    from warp._src.frontend.functions import fits_native

    if not is_generic(annotation):
        return dtypes.types_equal(annotation, wanted)
    return fits_native(annotation, dtypes.native_type(annotations.resolve(wanted)))


def _made(kernel, chosen):
    """The overload for concrete types; made once."""
    signature = ", ".join(dtypes.native_text(annotations.resolve(t)) for t in chosen.values())
    found = kernel.declared_overloads.get(signature)
    if found is None:
        func = kernel.func
        copy = python_types.FunctionType(
            func.__code__, func.__globals__, func.__name__, func.__defaults__, func.__closure__
        )
        copy.__annotations__ = chosen
        copy.__qualname__, copy.__module__ = func.__qualname__, func.__module__
        copy.__kwdefaults__, copy.__doc__ = func.__kwdefaults__, func.__doc__
        key = f"{kernel.key}_{len(kernel.declared_overloads)}"
        found = kernel.declared_overloads[signature] = type(kernel)(
            copy, key, kernel.module, kernel.options
        )
    return found
