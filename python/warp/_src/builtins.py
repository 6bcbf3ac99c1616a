"""Builtins at Python scope: `wp.sin(0.5)`, `wp.normalize(wp.vec3(1.0, 2.0, 3.0))`, ...

The names, groups and signatures come from the compiler's registry. A call builds a kernel of one
operation for the types of its arguments, runs it on the CPU, and keeps it for the next call; so the
result is the one that kernels get.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors, types
from warp._src.array import allocate, array, new_array
from warp._src.builtin_table import BUILTINS
from warp._src.composites import Composite, canonical_class
from warp._src.devices import CPU
from warp._src.scalars import scalar_base

# They need a thread, or change an array: nothing that a single call could give.
_KERNEL_ONLY = frozenset("tid printf print breakpoint block_dim len zeros array static".split())


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

    def __call__(self, *args, dtype=None, **named):
        if self.key in _KERNEL_ONLY:
            raise errors.WarpError(f"'{self.key}' can be called in kernels only")
        if named:
            args = self._positional(args, named)
        values = tuple(_value(self.key, argument) for argument in args)
        signature = (*map(type, values), dtype)
        evaluator = self._evaluators.get(signature)
        if evaluator is None:
            evaluator = self._evaluators[signature] = Evaluator(self.key, signature[:-1], dtype)
        return evaluator(values)

    def _positional(self, args, named):
        """Arguments in order, for the first overload that has all the names."""
        for signature in self.signatures:
            names = _parameter_names(signature)[len(args) :]
            if set(named) == set(names[: len(named)]):
                return (*args, *(named[name] for name in names[: len(named)]))
        raise TypeError(f"no overload of '{self.key}' has the parameters {', '.join(named)}")

    def __repr__(self):
        return f"<builtin '{self.key}'>"


class Evaluator:
    """One overload of a builtin, compiled for the CPU."""

    def __init__(self, name, classes, dtype):
        texts = [types.native_text(cls) for cls in classes]
        attributes = {} if dtype is None else {"dtype": types.native_type(dtype)}
        results = _build(_native.Builder(name), name, texts, attributes, None)
        self.dtypes = [types.dtype_of(str(value.type)) for value in results]
        builder = _native.Builder(name)
        _build(builder, name, texts, attributes, [str(value.type) for value in results])
        self.kernel = _native.Kernel(builder.finish(), name)

    def __call__(self, values):
        outputs = [new_array(array) for _ in self.dtypes]
        for output, dtype in zip(outputs, self.dtypes):
            allocate(output, (1,), dtype, CPU)
        self.kernel.launch(1, values, outputs, CPU)
        results = tuple(output.list()[0] for output in outputs)
        return results[0] if len(results) == 1 else (results or None)


def _build(builder, name, texts, attributes, result_texts):
    """Builds the kernel; without result types only the operation, whose results are returned."""
    count = len(texts)
    results = [f"!warp.array<1 x {text}>" for text in result_texts or ()]
    parameters = builder.begin_function(
        f"eval_{name}",
        [f"a{number}" for number in range(count)] + [f"r{number}" for number in range(len(results))],
        [_native.Type.parse(text) for text in [*texts, *results]],
        True,
    )
    values, _ = builder.builtin(name, parameters[:count], **attributes)
    if result_texts is not None:
        index = builder.tid(1)
        for target, value in zip(parameters[count:], values):
            builder.store(target, index, value)
        builder.end_function([])
    return values


def _value(name, argument):
    """An argument as an object whose class says its type."""
    if isinstance(argument, Composite):
        canonical = canonical_class(type(argument))
        if type(argument) is canonical:
            return argument
        return canonical.from_buffer_copy(argument)
    if isinstance(argument, (bool, int, float, scalar_base)):
        return argument
    if hasattr(argument, "dtype") and getattr(argument, "shape", None) == ():
        from warp._src.numpy_types import dtype_from_numpy

        return dtype_from_numpy(argument.dtype)(argument.item())
    raise TypeError(
        f"'{name}' at Python scope expects numbers, vectors, matrices, quaternions or transforms, "
        f"but got '{type(argument).__name__}'"
    )


def _parameter_names(signature: str) -> list[str]:
    """`(a: vec<n,F>, b: F = 1) -> F` gives a, b."""
    depth, names, word = 0, [], ""
    for character in signature[1:]:
        if character in "<(":
            depth += 1
        elif character in ">)":
            depth -= 1
        if depth < 0:
            break
        if character == "," and depth == 0:
            names.append(word)
            word = ""
        else:
            word += character
    names.append(word)
    return [name.partition(":")[0].strip() for name in names if name.strip()]


_made: dict[str, Builtin] = {}


def lookup(name: str) -> Builtin | None:
    """The builtin of a name, or None."""
    found = _made.get(name)
    if found is None and name in BUILTINS:
        found = _made[name] = Builtin(name, *BUILTINS[name])
    return found


def names() -> list[str]:
    """Names of all builtins."""
    return list(BUILTINS)
