"""Errors of public functions about arguments that they cannot use.

A function that is called with a wrong argument fails somewhere inside, in words that do not help:
`'str' object has no attribute 'device'`. `checked` looks at the arguments after such a failure and
says which one is wrong, so calls that are right pay for no check:

    wp.utils.array_scan(): argument 'in_array' expects an array, but got 'str'

Failures with all arguments right, and errors that the package raises itself, stay as they are.
"""

from __future__ import annotations

import functools
import typing

from warp._src import argument_kinds as kinds_of
from warp._src import errors
from warp._src.argument_kinds import Kind

_Function = typing.TypeVar("_Function", bound=typing.Callable)
# The longest number or string that a message repeats.
_LONGEST = 40
# Where users find what a part of the package holds.
_PLACES = {
    "autograd": "wp.autograd",
    "optim": "wp.optim",
    "render": "wp.render",
    "sparse": "wp.sparse",
    "utils": "wp.utils",
}


# Kinds of parameters that mean the same in all functions.
COMMON = {
    **dict.fromkeys(("device", "warp_device", "target_device", "peer_device"), kinds_of.DEVICE),
    **dict.fromkeys(
        ("dtype", "block_type", "grad_dtype", "warp_dtype", "scalar_type"), kinds_of.TYPE
    ),
    **dict.fromkeys(
        ("pinned", "requires_grad", "retain_grad", "check_finite", "inclusive"), kinds_of.FLAG
    ),
    **dict.fromkeys(
        ("sync", "synchronize", "structure_only", "strip_hash", "use_ptx"), kinds_of.FLAG
    ),
    **dict.fromkeys(("prune_numerical_zeros", "use_cuda_graph", "return_ctype"), kinds_of.FLAG),
    **dict.fromkeys(("enable", "verbose", "adjoint", "external"), kinds_of.FLAG),
    **dict.fromkeys(("count", "value_count", "run_count", "max_items"), kinds_of.COUNT),
    **dict.fromkeys(("block_dim", "max_workers"), kinds_of.SMALL),
    **dict.fromkeys(("axis", "index", "stacklevel"), kinds_of.INTEGER),
    **dict.fromkeys(("stream",), kinds_of.STREAM),
    **dict.fromkeys(("kernel",), kinds_of.KERNEL),
    **dict.fromkeys(("path", "filename", "module_dir", "folder"), kinds_of.PATH),
    **dict.fromkeys(("name", "key", "message", "title", "alias"), kinds_of.TEXT),
    **dict.fromkeys(("alpha", "beta", "tol", "atol", "eps", "lr", "threshold"), kinds_of.NUMBER),
    **dict.fromkeys(("shape",), kinds_of.SHAPE),
    **dict.fromkeys(("callback",), kinds_of.CALLABLE),
}


def shown(value) -> str:
    """A value as messages name it: short numbers and strings themselves, others by their type.

    Example:
        >>> from warp import extend
        >>> extend.shown(3), extend.shown("x"), extend.shown([1, 2])
        ("'3'", "'x'", "'list'")
    """
    if isinstance(value, type):
        return f"the type '{vars(value).get('_wp_name_') or value.__name__}'"
    plain = type(value) in (bool, float, complex, str)
    if plain or (type(value) is int and value.bit_length() < 4 * _LONGEST):
        text = ascii(value) if isinstance(value, str) else f"'{value}'"
        if len(text) <= _LONGEST:
            return text
    return f"'{type(value).__name__}'"


def spelled(value) -> str:
    """The text of a value; the name of its type if it has none, such as lists of great depth."""
    try:
        return repr(value)
    except Exception:
        return shown(value)


def misfit(name: str, parameter: str, kind: Kind, value) -> errors.WarpArgumentError:
    """The error for an argument of a public function that is not of the kind it expects."""
    return errors.WarpArgumentError(
        f"{name}(): argument '{parameter}' expects {kind.wanted}, but got {shown(value)}"
    )


def checked(**kinds: Kind) -> typing.Callable[[_Function], _Function]:
    """Makes a public function say which of its arguments is wrong, once a call has failed.

    Args:
        kinds: kinds by the names of parameters. Names that mean the same everywhere, such
            as `device`, need none. The default of a parameter is right whatever its kind.

    Raises:
        WarpArgumentError: (the function) a call has failed and an argument is not of its kind.

    Example:
        >>> from warp.extend import checked, kinds
        >>> @checked(count=kinds.COUNT)
        ... def double(count):
        ...     return [0.0] * count
        >>> double("3")
        Traceback (most recent call last):
        ...
        warp._src.errors.WarpArgumentError: ...: argument 'count' expects an integer ...
    """

    def decorate(function):
        @functools.wraps(function)
        def call(*args, **kwargs):
            try:
                return function(*args, **kwargs)
            except (errors.WarpError, ImportError, OSError, MemoryError):
                # These say what is wrong, wherever they come from.
                raise
            except Exception as error:
                problem = _problem(function, kinds, args, kwargs, error)
                if problem is None:
                    raise
                raise problem from error

        call.argument_kinds = kinds
        return call

    return decorate


def forwarded(make, *args, **kwargs):
    """Calls what a function hands all its arguments to.

    Raises:
        WarpArgumentError: Python says that they do not fit its parameters.
    """
    try:
        return make(*args, **kwargs)
    except TypeError as error:
        if error.__traceback__.tb_next is not None:
            raise
        raise errors.WarpArgumentError(str(error).replace(".__init__", "")) from None


def explained(error, name: str, **given):
    """The error to raise for a failed call of a function that catches its failures itself.

    Such functions are called so often that the wrapper of `checked` would be felt.

    Args:
        error: the failure.
        name: the function as users write it.
        given: by the names of parameters, the kind that is expected and the value.
    """
    for parameter, (kind, value) in given.items():
        if not isinstance(error, errors.WarpError) and not kind.fits(value):
            return misfit(name, parameter, kind, value)
    return error


def public_name(function, owner=None) -> str:
    """A function's name as users write it, `wp.sparse.bsr_mv`; that of a class for `__init__`.

    Args:
        owner: of a method, the object that it was called with.
    """
    parts = function.__module__.split(".")
    place = _PLACES.get(parts[2] if len(parts) > 2 else "", "wp")
    if parts[2:4] == ["optim", "linear"]:
        place = "wp.optim.linear"
    if parts[0] != "warp":
        place = function.__module__
    name = function.__qualname__
    base, _, method = name.rpartition(".")
    if base and any(one.__name__ == base for one in type(owner).__mro__):
        name = f"{type(owner).__name__}.{method}"
    return f"{place}.{name.removesuffix('.__init__')}"


def _problem(function, kinds, args, kwargs, error):
    """The error that names the wrong argument; None if none is, or the package has named it."""
    import inspect
    import opcode

    last = error.__traceback__
    while last.tb_next is not None:
        last = last.tb_next
    code = last.tb_frame.f_code
    module = last.tb_frame.f_globals.get("__name__", "")
    if module.startswith("warp.") and code.co_code[last.tb_lasti] == opcode.opmap["RAISE_VARARGS"]:
        return None
    signature = inspect.signature(function)
    try:
        bound = signature.bind(*args, **kwargs)
    except TypeError as problem:
        return errors.WarpArgumentError(f"{public_name(function, *args[:1])}(): {problem}")
    for parameter, value in bound.arguments.items():
        declared = signature.parameters[parameter]
        if declared.kind in (declared.VAR_POSITIONAL, declared.VAR_KEYWORD):
            continue
        if value is declared.default:
            continue
        kind = kinds.get(parameter) or COMMON.get(parameter)
        if parameter == "self":
            kind = _owner(function)
        elif kind is None and isinstance(declared.default, bool):
            kind = kinds_of.FLAG
        if kind is not None and not kind.fits(value):
            name = public_name(function, bound.arguments.get("self"))
            return misfit(name, parameter, kind, value)
    return None


def _owner(function) -> Kind:
    """Objects of the class that a method belongs to."""
    _, _, cls = function.__qualname__.rpartition(".")[0].rpartition(".")

    def test(value):
        return any(base.__name__ == cls for base in type(value).__mro__)

    return Kind(f"a '{cls}'", test)
