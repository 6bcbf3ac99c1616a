"""`@wp.func`: functions that kernels and Python can call."""

from __future__ import annotations

import sys
import types as python_types
import typing
from collections.abc import Callable

from warp._src import errors
from warp._src.argument_kinds import FUNCTION, NONE, TEXT
from warp._src.arguments import checked, shown, spelled
from warp._src.kernels import declared
from warp._src.kernels.epoch import Epoch
from warp._src.types import dtypes
from warp._src.types.annotations import Reference, annotations_of, check_annotations, is_generic
from warp._src.types.composites import Composite, is_number
from warp._src.types.native import ArrayType
from warp._src.types.scalars import PYTHON_TYPES, scalar_base
from warp._src.types.vectors import GenericAnnotation

_Parameters = typing.ParamSpec("_Parameters")
_Result = typing.TypeVar("_Result")


class Function:
    """A function that kernels can call, and Python too.

    `overloads` lists the Python functions of that name; a call takes the one whose annotations fit.
    `pullbacks` and `replays` hold what `@wp.func_grad` and `@wp.func_replay` have registered.
    """

    # How other modules know a function of kernels without importing this one.
    _wp_function_ = True
    # True if the kernel cache may know it by its texts; a subclass with state of its own says no.
    has_lasting_name = True
    # The derivatives that `wp.custom_vjp` and `wp.custom_jvp` were given.
    pullback = None
    pushforward = None
    # Kind of geometry whose handle is the first argument (geometry.handles), or None.
    handle = None
    # The result of `_particular` for its function, once it has been called from Python.
    particular = None

    @checked(func=FUNCTION, source=TEXT | NONE)
    def __init__(self, func, key=None, code_transformers=None, source=None):
        check_annotations(func.__name__, func.__annotations__)
        if source is not None:
            from warp._src.kernels.made_functions import with_source

            func = with_source(func, source)
        if code_transformers:
            from warp._src.kernels.made_functions import transformed_function

            func = transformed_function(func, code_transformers)
        self.func = func
        self.key = key or func.__name__
        self.overloads = [func]
        self.pullbacks: list = []
        self.replays: list = []
        self.__name__ = func.__name__
        self.__qualname__ = func.__qualname__
        self.__module__ = func.__module__
        self.__doc__ = func.__doc__
        self.__wrapped__ = func
        declared.keep(func)

    @property
    def has_derivative(self) -> bool:
        """True if a derivative of its own belongs to the function."""
        return bool(self.pullbacks or self.replays or self.pullback or self.pushforward)

    @checked(func=FUNCTION)
    def add_overload(self, func) -> None:
        """Adds a function whose annotations no other one has.

        Raises:
            WarpError: only references tell it from another one.
        """
        if any(_value_types(func) == _value_types(other) for other in self.overloads):
            raise errors.WarpError(
                f"functions of the name '{self.key}' differ only by references (`wp.ref`), which "
                "no call tells apart: give one another name"
            )
        self.overloads.append(func)
        declared.keep(func)

    @checked(func=FUNCTION)
    def redefined(self, func):
        """The functions of this name with one in place of that with the same annotations.

        None if there is none to replace. This object keeps the old one, under other names.
        """
        types = list(func.__annotations__.values())
        kept = [f for f in self.overloads if list(f.__annotations__.values()) != types]
        if len(kept) == len(self.overloads):
            return None
        made = Function(func, self.key)
        made.overloads += kept
        if kept:
            made.pullbacks, made.replays = list(self.pullbacks), list(self.replays)
        return made

    def __call__(self, *args, **kwargs) -> typing.Any:
        if len(self.overloads) == 1:
            if self.particular is None:
                self.particular = _particular(self.func)
            if type(self) is Function and self.particular and _refuses(self.particular, args):
                raise self._refusal(args)
            try:
                return self.func(*args, **kwargs)
            except (TypeError, AttributeError, IndexError, KeyError, ValueError) as problem:
                if _accepts(self.func, args, kwargs, generic=False):
                    raise
                raise self._refusal(args, kwargs) from problem
        for func in self.overloads:
            if _accepts(func, args, kwargs):
                return func(*args, **kwargs)
        given = [f"'{dtypes.type_repr(type(value))}'" for value in args]
        given += [f"{name}='{dtypes.type_repr(type(value))}'" for name, value in kwargs.items()]
        raise errors.WarpTypeError(f"no overload of '{self.key}' takes ({', '.join(given)})")

    def _refusal(self, args, kwargs=None):
        # Programs know this error by its words.
        named = f" and {spelled(kwargs)}" if kwargs else ""
        return errors.WarpTypeError(
            f"Error calling function '{self.key}', no overload found for arguments "
            f"{spelled(args)}{named}"
        )

    def __repr__(self):
        return f"<function '{self.key}'>"


def _value_types(func) -> list:
    """Annotations of the parameters, references as what they refer to."""
    declared = [value for name, value in func.__annotations__.items() if name != "return"]
    return [one.dtype if isinstance(one, Reference) else one for one in declared]


def _particular(func) -> list:
    """Positions of the parameters that do not take every number of Python, and whether they take
    functions."""
    found = []
    for position, name in enumerate(func.__code__.co_varnames):
        wanted = func.__annotations__.get(name)
        if wanted is Function:
            found.append((position, True))
            continue
        of_warp = isinstance(wanted, type) and issubclass(wanted, (Composite, scalar_base))
        if of_warp and wanted not in PYTHON_TYPES.values():
            found.append((position, False))
    return found


def _refuses(particular, args) -> bool:
    """True if an argument is a number of Python for a parameter of another kind, or no function."""
    for position, takes_functions in particular:
        if position >= len(args):
            return False
        value = args[position]
        if not takes_functions:
            if type(value) in (bool, int, float):
                return True
        # Builtins are no instances.
        elif not isinstance(value, Function) and not hasattr(value, "signatures"):
            return True
    return False


def _is_of(expected, value) -> bool:
    """True if a value is of a family of types, such as vectors."""
    if isinstance(expected, GenericAnnotation):
        return isinstance(value, expected.family)
    return not isinstance(expected, typing.TypeVar) or is_number(value)


def _accepts(func, args, kwargs, generic=True) -> bool:
    """True if a function's annotations fit arguments.

    generic: whatever is given fits an annotation that leaves the type open.
    """
    import inspect

    try:
        bound = inspect.signature(func).bind(*args, **kwargs)
    except TypeError:
        return False
    declared = annotations_of(func)
    for name, value in bound.arguments.items():
        expected = declared.get(name)
        if isinstance(expected, Reference):
            expected = expected.dtype
        if expected is None or is_generic(expected):
            if not generic and not _is_of(expected, value):
                return False
            continue
        if isinstance(expected, ArrayType):
            fits = dtypes.is_array(value) and value.ndim == expected.ndim
            if not fits or not dtypes.types_equal(value.dtype, expected.dtype):
                return False
        elif isinstance(expected, type) and not dtypes.types_equal(type(value), expected):
            return False
    return True


@typing.overload
def func(f: Callable[_Parameters, _Result]) -> Callable[_Parameters, _Result]: ...


@typing.overload
def func(
    f: None = None, *, name: str | None = None, module=None, inline: bool | None = None
) -> Callable[[Callable[_Parameters, _Result]], Callable[_Parameters, _Result]]: ...


@typing.overload
def func(
    f: None = None,
    *,
    name: str | None = None,
    module=None,
    inline: bool | None = None,
    source: str,
) -> Callable[..., typing.Any]: ...


def func(f=None, *, name=None, module=None, inline=None, source=None):
    """Makes a function that kernels can call. It stays callable from Python.

    Decorating several functions of one name in one scope makes overloads, chosen by annotations.

    Args:
        name: name in messages, by default that of the function.
        module: module that the function belongs to, by default the one it is written in.
        inline: accepted for compatibility: functions become part of their kernels.
        source: text of the function, as of `wp.kernel`; gives the function and no decorator.

    Example:
        >>> import warp as wp
        >>> @wp.func
        ... def square(x: float):
        ...     return x * x

    Raises:
        TypeError: what is decorated is no function, or `inline` no truth value.
        ValueError: `source` is not one `def` without decorators.
    """
    if source is not None:
        f = function_of_source("func", f, source)
    if inline is not None and not isinstance(inline, bool):
        raise TypeError(f"inline must be a bool or None, but got {inline!r}")

    def decorate(function, depth):
        if not isinstance(function, python_types.FunctionType):
            raise TypeError(f"expects a function, but got '{type(function).__name__}'")
        former = sys._getframe(depth).f_locals.get(function.__name__)
        if isinstance(former, Function) and former.func.__qualname__ == function.__qualname__:
            again = former.redefined(function)
            if again is not None:
                # Kernels that call it are translated anew.
                Epoch.advance()
                return again
            former.add_overload(function)
            return former
        return Function(function, name)

    return (lambda function: decorate(function, 2)) if f is None else decorate(f, 2)


def function_of_source(decorator, function, source):
    """The function that the argument `source` of a decorator makes."""
    from warp._src.kernels.made_functions import function_of_caller, with_source
    from warp._src.version import calling_frame

    if not isinstance(source, str):
        raise TypeError(f"{decorator}: expects text as `source`, but got {shown(source)}")
    if isinstance(function, python_types.FunctionType):
        return with_source(function, source)
    return function_of_caller(source, calling_frame())


class NativeFunction(Function):
    """A function whose body is C++ or CUDA text.

    Attributes:
        native_snippet, adj_native_snippet, replay_snippet: the texts.
    """

    has_lasting_name = False

    def __init__(self, func, snippet, adj_snippet, replay_snippet):
        super().__init__(func)
        self.native_snippet = snippet
        self.adj_native_snippet = adj_snippet
        self.replay_snippet = replay_snippet

    @property
    def is_block_barrier(self) -> bool:
        """True if all it does is to let the threads of a block wait for each other.

        That needs no compiler, and is nothing where a block is one thread.
        """
        return "".join(self.native_snippet.split()) in _BARRIERS

    def __call__(self, *args, **kwargs):
        raise TypeError(f"'{self.key}' is native code and can be called in kernels only")


_BARRIERS = (
    *("WP_TILE_SYNC();", "__syncthreads();"),
    "#ifdefined(__CUDA_ARCH__)__syncthreads();#endif",
)


def func_native(snippet, adj_snippet=None, replay_snippet=None):
    """Declares a function by its C++ or CUDA text.

    Kernels may call one that takes numbers, vectors, matrices, quaternions and arrays, and gives
    one number, vector, matrix or quaternion, or none. It is compiled with the first kernel that
    calls it: on CPUs by Clang, which is installed or named by the environment variable WARP_CLANG,
    on GPUs by NVRTC, which is a part of CUDA and of the package nvidia-cuda-nvrtc, or named by
    WARP_NVRTC. Without a compiler, the launch is an error with the place of the call.

    The result of a function of numbers alone may depend on its arguments alone, unless its text
    names what threads do together (`__syncwarp`, `__shfl_xor_sync`, `atomicAdd`, ...): such a call
    stays where it stands, and the kernel is launched in blocks, as one with tiles. A text that is
    `WP_TILE_SYNC();` or `__syncthreads();` is a barrier and needs no compiler. A function may
    assign to parameters by reference (`wp.ref[float]`) and to what `wp.address_of` points to:
    copies, which are written back.

    An array is a `wp::array_t<T>` in the snippet, with `data`, `shape`, `strides` in bytes and
    `ndim`; `x[i]` is element i of packed memory, `wp::index(x, i, j)` and `wp::address(x, i, j)`
    go by the strides. `wp::view`, `load`, `store`, `array_store`, `atomic_add` are there as well,
    and vectors (`wp::vec3`) and matrices with a few operators. Nothing is checked.

    The adjoint finds the cotangent of a parameter `x` in `adj_x` and that of the result in
    `adj_ret`, and changes them; it has to be linear in them. For an array it is the array of its
    gradients, or of zeros that are thrown away where there are none. With arrays it runs once, else
    once for each output and each parameter. Without one, a kernel that calls the function has no
    gradient through it.

    Args:
        snippet: body of the function.
        adj_snippet: body of its adjoint.
        replay_snippet: body that a backward pass runs in place of the first where it needs the
            result again. It does not write to arrays again: those are as the launch left them.
    """

    def decorate(func):
        former = sys._getframe(1).f_locals.get(func.__name__)
        if isinstance(former, NativeFunction) and former.func.__qualname__ == func.__qualname__:
            # Kernels that call it are translated anew.
            Epoch.advance()
        return NativeFunction(func, snippet, adj_snippet, replay_snippet)

    return decorate
