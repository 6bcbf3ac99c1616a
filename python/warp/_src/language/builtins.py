"""Builtins at Python scope: `wp.sin(0.5)`, `wp.normalize(wp.vec3(1.0, 2.0, 3.0))`, ...

The names, groups and signatures come from the compiler's registry. A call builds a kernel of one
operation for the types of its arguments, runs it on the CPU, and keeps it for the next call; so the
result is the one that kernels get.
"""

from __future__ import annotations

import ctypes

from warp import _native, config
from warp._src import errors
from warp._src.arrays.allocation import allocate, new_array
from warp._src.arrays.array import array
from warp._src.builtin_table import BUILTINS
from warp._src.devices.devices import CPU
from warp._src.types import dtypes
from warp._src.types.composites import Composite, Products, canonical_class
from warp._src.types.numpy_types import dtype_from_numpy
from warp._src.types.scalars import BITS, PYTHON_TYPES, ScalarType, int32, scalar_base

# They need a thread, or change an array: nothing that a single call could give.
_KERNEL_ONLY = frozenset(
    ("tid", "printf", "print", "len", "static", "lower_bound", "poisson", "sample_cdf")
)


def _declares(args, named) -> bool:
    """True if a call of `wp.tile` outside of kernels is a type, for an annotation."""
    return "dtype" in named or "shape" in named or isinstance(next(iter(args), None), type)


class Builtin:
    """A function of the kernel language.

    Attributes:
        group: family it belongs to.
        signatures: overloads, as `(a: vec<n,F>, b: vec<n,F>) -> F`.
    """

    def __init__(self, name, group, doc, signatures):
        self.__name__ = self.__qualname__ = self.key = name
        self.__module__ = "warp"
        self.group = group
        self.signatures = tuple(signatures)
        self.__doc__ = doc + "\n\nOverloads:\n" + "\n".join(f"    {name}{s}" for s in signatures)
        self._evaluators = {}

    def __reduce__(self):
        return self.__name__

    def __call__(self, *args, **named):
        if self.key == "tile_stack" or (self.key == "tile" and _declares(args, named)):
            from warp._src.types.tiles import TileStackType, declared_tile

            declared = declared_tile if self.key == "tile" else TileStackType
            try:
                return declared(*args, **named)
            except TypeError as error:
                problem = str(error).replace("TileStackType.__init__", "tile_stack")
                problem = problem.replace("declared_tile", "tile")
                raise errors.WarpTypeError(problem) from None
        if self.key in _KERNEL_ONLY or self.group == "Atomics":
            raise errors.WarpError(f"'{self.key}' can be called in kernels only")
        if named:
            args = self._positional(args, named)
        values = tuple(_value(self.key, argument) for argument in args)
        classes = tuple(map(type, values))
        evaluator = self._evaluators.get(classes)
        if evaluator is None:
            try:
                evaluator = self._evaluators[classes] = Evaluator(self.key, classes)
            except errors.WarpCodegenTypeError as problem:
                shown = ", ".join(
                    cls.__name__ if cls in PYTHON_TYPES else dtypes.type_repr(cls)
                    for cls in classes
                )
                problem.coded("builtin-arguments", name=self.key, types=shown)
                raise
        return evaluator(values, args)

    def __getitem__(self, parameters):
        """`wp.tile[dtype, ...]` and `wp.tile_stack[dtype, capacity]`, annotations of parameters."""
        if self.key not in ("tile", "tile_stack"):
            raise TypeError(f"'{self.key}' is a function, which has no items")
        from warp._src.types.tiles import TileStackType, TileType

        parts = parameters if isinstance(parameters, tuple) else (parameters,)
        if self.key == "tile_stack":
            if len(parts) != 2:
                raise TypeError(
                    f"wp.tile_stack[dtype, capacity] expects 2 parameters, but got {len(parts)}"
                )
            return TileStackType(dtype=parts[0], capacity=parts[1])
        if not parts:
            raise TypeError("wp.tile[...] requires at least a dtype")
        return TileType(parts[0], parts[1:])

    def _positional(self, args, named):
        """Arguments in order, for the first overload that has all the names."""
        for names in _native.Builder.parameter_names(self.key):
            rest = names[len(args) : len(args) + len(named)]
            if set(named) == set(rest):
                return (*args, *(named[name] for name in rest))
        raise TypeError(f"no overload of '{self.key}' has the parameters {', '.join(named)}")

    def __repr__(self):
        return f"<builtin '{self.key}'>"


class Evaluator:
    """One overload of a builtin, compiled for the CPU.

    Attributes:
        changed: positions of the arguments that it changes; their new values are the last results.
    """

    def __init__(self, name, classes):
        texts = [dtypes.native_text(cls) for cls in classes]
        results, self.changed = _build(_native.Builder(name), name, texts)
        self.dtypes = [dtypes.dtype_of(text) for text in results]
        builder = _native.Builder(name)
        _build(builder, name, texts, results)
        self.kernel = _native.Kernel(builder.finish(), name)
        # Memory of results that no call is using.
        self._spare = []

    def __call__(self, values, given):
        outputs = self._spare.pop() if self._spare else self._allocate()
        self.kernel.evaluate(values, outputs)
        results = [_python_value(output) for output in outputs]
        self._spare.append(outputs)
        for position in reversed(self.changed):
            result = results.pop()
            # Numbers, such as the state of a generator, are values in Python.
            if isinstance(given[position], Composite):
                ctypes.memmove(ctypes.addressof(given[position]), result, ctypes.sizeof(result))
        return results[0] if len(results) == 1 else (tuple(results) or None)

    def _allocate(self) -> list:
        outputs = [new_array(array) for _ in self.dtypes]
        for output, dtype in zip(outputs, self.dtypes, strict=True):
            allocate(output, (1,), dtype, CPU)
        return outputs


def _python_value(output):
    """The only element: a number of Python for its own types, else one of the element's type."""
    dtype = output.dtype
    if issubclass(dtype, Composite):
        return dtype.from_ptr(output.ptr)
    if not isinstance(dtype, ScalarType):
        return output.list()[0]
    value = dtype._type_.from_address(output.ptr).value
    if dtype in BITS:
        value = BITS[dtype][1](value)
    if dtype in PYTHON_TYPES.values():
        return value
    return value if config.legacy_scalar_return_types else dtype(value)


def _build(builder, name, texts, result_texts=None):
    """Builds the kernel; without types of the results it stays unfinished.

    Returns:
        The types of the results and of what it changes, and the positions of the latter.
    """
    count = len(texts)
    results = [f"!warp.array<1 x {text}>" for text in result_texts or ()]
    parameters = builder.begin_function(
        f"eval_{name}",
        [f"a{index}" for index in range(count)] + [f"r{index}" for index in range(len(results))],
        [_native.Type.parse(text) for text in [*texts, *results]],
        True,
    )
    values, changed = builder.builtin(name, parameters[:count])
    values = [*values, *(value for _, value in changed)]
    if result_texts is not None:
        index = builder.tid(1)
        for target, value in zip(parameters[count:], values, strict=True):
            builder.store(target, index, value)
        builder.end_function([])
    return [str(value.type) for value in values], [position for position, _ in changed]


def _value(name, argument):
    """An argument as an object whose class says its type."""
    if isinstance(argument, Composite):
        canonical = canonical_class(type(argument))
        if type(argument) is canonical:
            return argument
        return canonical.from_buffer_copy(argument)
    if type(argument) is int and not -(2**31) <= argument < 2**31:
        # Only the last 32 bits, as explicit casts take them.
        return int32(argument)
    if type(argument) in (bool, int, float) or isinstance(argument, scalar_base):
        return argument
    if hasattr(argument, "dtype") and getattr(argument, "shape", None) == ():
        # NumPy's numbers say their type; its float64 is a `float`, too.
        return dtype_from_numpy(argument.dtype)(argument.item())
    if isinstance(argument, (int, float)):
        # A subclass, such as a member of an enumeration.
        return float(argument) if isinstance(argument, float) else int(argument)
    raise TypeError(
        f"'{name}' at Python scope expects numbers, vectors, matrices, quaternions or transforms, "
        f"but got '{type(argument).__name__}'"
    )


_made: dict[str, Builtin] = {}


def lookup(name: str) -> Builtin | None:
    """The builtin of a name, or None."""
    found = _made.get(name)
    if found is None and name in BUILTINS:
        found = _made[name] = Builtin(name, *BUILTINS[name])
    return found


Products.multiply = lookup("mul")
