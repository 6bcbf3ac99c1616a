"""Native functions with arrays among their parameters.

The snippet sees each array as NVIDIA Warp's `wp::array_t<T>`. Kernels pass address, extents and
strides as numbers, from which a few lines of C++ make that. So a function in the kernel language
stands for the native one; its derivative, if there is an adjoint, hands over the arrays of the
gradients, too, and gets the cotangents of the numbers back. Other than code of numbers alone such
code reads and writes memory, so passes keep it in its place.
"""

from __future__ import annotations

from warp._src.derivatives.functions import adjoint
from warp._src.kernels import native_code
from warp._src.kernels.function import Function, NativeFunction
from warp._src.kernels.map_functions import define
from warp._src.types import dtypes
from warp._src.types.annotations import annotations_of
from warp._src.types.native import ArrayType, native_text

_MADE = "_warp_array_function"
_FIX = "write the function in Python with `@wp.func`"
_FLOATS = ("f32", "f64")


class MemoryCode(NativeFunction):
    """A piece of native code as kernels call it.

    Attributes:
        results: native types of what it gives; C++ returns them in a struct `Results`.
        likes: by name of an array of gradients the parameter it belongs to.
    """

    results: tuple = ()
    likes: dict = {}  # noqa: RUF012


def takes_arrays(function) -> bool:
    return any(isinstance(one, ArrayType) for one in annotations_of(function.func).values())


def call(context, function, node):
    """Calls what stands for a native function with arrays.

    Raises:
        WarpCodegenError: a parameter is neither a number nor an array of numbers or of vectors,
            matrices, quaternions or transforms of them.
    """
    for name, annotation in annotations_of(function.func).items():
        if _cpp(annotation) is None:
            problem = f"the native code of '{function.key}', whose '{name}' C++ has no type for,"
            raise context.unsupported(node, problem, _FIX)
    if _MADE not in function.__dict__:
        function.__dict__[_MADE] = _Maker(function).made()
    arguments, keywords = context.constructors.arguments(node)
    return context.user_calls.call_function(function.__dict__[_MADE], arguments, keywords, node)


def emit(context, code, node):
    """The call of a piece of native code, inside of the function that stands for it."""
    arguments, keywords = context.constructors.arguments(node)
    overload, bound = context.user_calls.select(code, arguments, keywords, node)
    values, declared = [], []
    for binding, parameter in zip(bound, overload.parameters, strict=True):
        if type(binding) in (bool, int, float) and parameter.native is not None:
            value = context.convert_constant(binding, parameter.native, node)
        else:
            value = context.materialize(binding, node)
        kind = str(value.type)
        context.at(node)
        if value.type.kind != "array":
            values.append(value)
            declared.append((parameter.name, kind, 0))
            continue
        rank, builder = value.type.rank, context.builder
        values.append(builder.pointer(value))
        values += [builder.dim(value, axis) for axis in range(rank)]
        values += [builder.stride(value, axis) for axis in range(rank)]
        declared.append((parameter.name, str(value.type.element), rank))
    symbol = native_code.add_memory(code, declared, native_code.place_of(context, node))
    context.at(node)
    results = context.builder.builtin(f"_{symbol}:{','.join(code.results or ['si32'])}", values)[0]
    return tuple(results) if code.results else None


class _Maker:
    """What the functions for one native function are made from."""

    def __init__(self, function):
        self.function = function
        self.types = dict(annotations_of(function.func))
        self.result = self.types.pop("return", None)
        self.arrays = [name for name, one in self.types.items() if isinstance(one, ArrayType)]
        self.floats = [name for name, one in self.types.items() if native_text(one) in _FLOATS]
        self.gradients = [name for name in self.arrays if _has_gradient(self.types[name])]

    def made(self) -> Function:
        """A function with the parameters of the native one."""
        function = self.function
        made = self.forward(function.key, function.native_snippet)
        if function.replay_snippet is not None:
            replayed = self.forward(f"{function.key}_replay", function.replay_snippet)
            made.replays.append(replayed.func)
        smooth = self.floats or self.gradients or native_text(self.result or int) in _FLOATS
        if function.adj_native_snippet is not None or not smooth:
            made.pullbacks.append(self.pullback(function.adj_native_snippet or ""))
        return made

    def forward(self, key, snippet) -> Function:
        results = () if self.result is None else (native_text(self.result),)
        code = self.code(key, self.types, f'{{\n#line 1 "{self.function.key}"\n{snippet}\n}}')
        code.results = results
        text = f"code({', '.join(self.types)})"
        lines = [f"    {text}"] if self.result is None else [f"    r, = {text}", "    return r"]
        names = {"types": self.types, "code": code}
        return Function(self.define(key, self.types, lines, names))

    def pullback(self, snippet):
        """The derivative in the form of `@wp.func_grad`."""
        types = dict(self.types)
        if self.result is not None:
            types["adj_ret"] = self.result
        seeds = list(types)
        given = {**types, **{f"adj_{name}": self.types[name] for name in self.gradients}}
        others = [name for name in self.types if name not in self.gradients]
        started = "".join(f"{_cpp(self.types[name])} adj_{name} = {{}}; " for name in others)
        returned = ", ".join(f"adj_{name}" for name in self.floats)
        body = (
            f'{{ {started}[&]() {{\n#line 1 "{self.function.key}"\n{snippet}\n}}();\n'
            f"{f'return {{{returned}}};' if returned else ''} }}"
        )
        key = f"{self.function.key}_adjoint"
        code = self.code(key, given, body)
        code.results = tuple(native_text(self.types[name]) for name in self.floats)
        code.likes = {f"adj_{name}": name for name in self.gradients}
        passed = ", ".join([*seeds, *(f"adjoint[{name}]" for name in self.gradients)])
        targets = "".join(f"d_{name}, " for name in self.floats)
        lines = [f"    {targets}= code({passed})" if targets else f"    code({passed})"]
        lines += [f"    adjoint[{name}] += d_{name}" for name in self.floats]
        return self.define(key, types, lines, {"types": types, "code": code, "adjoint": adjoint})

    def code(self, key, types, body) -> MemoryCode:
        declared = self.define(f"{key}_code", types, ["    pass"], {"types": types})
        code = MemoryCode(declared, body, None, None)
        code.key = self.function.key
        return code

    def define(self, key, types, lines, names):
        parameters = ", ".join(f"{name}: types['{name}']" for name in types)
        return define(key, "\n".join([f"def {key}({parameters}):", *lines, ""]), names)


def _has_gradient(annotation) -> bool:
    return str(dtypes.native_type(annotation.dtype)).rstrip(">").endswith(_FLOATS)


def _cpp(annotation):
    """What C++ calls a type; None where native code cannot have it."""
    if isinstance(annotation, ArrayType):
        element = native_code.element_name(native_text(annotation.dtype))
        return element and f"wp::array_t<{element}>"
    return native_code.SCALARS.get(native_text(annotation))
