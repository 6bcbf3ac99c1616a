"""Native functions with arrays, vectors and matrices among their parameters or as their result.

The snippet sees each array as NVIDIA Warp's `wp::array_t<T>`. Kernels pass address, extents and
strides as numbers, from which a few lines of C++ make that. So a function in the kernel language
stands for the native one; its derivative, if there is an adjoint, hands over the arrays of the
gradients, too, and gets the cotangents of the numbers back. Other than code of numbers alone such
code reads and writes memory, so passes keep it in its place. Vectors and matrices cross the border
number by number.
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
        results: native types of the numbers it gives; C++ returns them in a struct `Results`.
        likes: by name of an array of gradients the parameter it belongs to.
    """

    results: tuple = ()
    likes: dict = {}  # noqa: RUF012


def in_memory(function) -> bool:
    """Whether a native function has more than numbers to take or to give."""
    declared = annotations_of(function.func)
    # What cannot be returned is refused there.
    returned = declared.get("return")
    return any(isinstance(one, ArrayType) or _is_composite(one) for one in declared.values()) or (
        returned is not None and not _can_return(returned)
    )


def _is_composite(annotation) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, dtypes.Composite)


def call(context, function, node):
    """Calls what stands for a native function with arrays.

    Raises:
        WarpCodegenError: a parameter is neither a number, a vector, a matrix or a quaternion nor
            an array of these or of transforms; or the result is an array, a struct or a transform.
    """
    for name, annotation in annotations_of(function.func).items():
        if name == "return" and annotation is not None and not _can_return(annotation):
            problem = f"the native code of '{function.key}', which returns {_shown(annotation)},"
            raise context.unsupported(node, problem, _FIX, also="unsupported return type")
        if name != "return" and _cpp(annotation) is None:
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
        if value.type.kind in _COMPOSITES:
            parts = context.slices.components(value, _count(kind), node)
            values += parts
            declared.append((parameter.name, kind, -len(parts)))
            continue
        if value.type.kind != "array":
            values.append(value)
            declared.append((parameter.name, kind, 0))
            continue
        rank, builder = value.type.rank, context.builder
        values.append(builder.pointer(value))
        values += [builder.dim(value, axis) for axis in range(rank)]
        values += [builder.stride(value, axis) for axis in range(rank)]
        declared.append((parameter.name, str(value.type.element), rank))
    place = native_code.place_of(context, node)
    symbol = native_code.add_memory(code, declared, place, context.session.build)
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
        self.floats = [
            name
            for name, one in self.types.items()
            if not isinstance(one, ArrayType) and _numbers(one)[0] in _FLOATS
        ]
        self.gradients = [name for name in self.arrays if _has_gradient(self.types[name])]

    def made(self) -> Function:
        """A function with the parameters of the native one."""
        function = self.function
        made = self.forward(function.key, function.native_snippet)
        if function.replay_snippet is not None:
            replayed = self.forward(f"{function.key}_replay", function.replay_snippet)
            made.replays.append(replayed.func)
        smooth = self.floats or self.gradients or _numbers(self.result or int)[0] in _FLOATS
        if function.adj_native_snippet is not None or not smooth:
            made.pullbacks.append(self.pullback(function.adj_native_snippet or ""))
        return made

    def forward(self, key, snippet) -> Function:
        body = f'\n#line 1 "{self.function.key}"\n{snippet}\n'
        results = () if self.result is None else _numbers(self.result)
        if _is_composite(self.result):
            kind = _cpp(self.result)
            given = ", ".join(_parts("warp_ret", self.result))
            body = f"{kind} warp_ret = [&]() -> {kind} {{{body}}}();\nreturn {{{given}}};"
        code = self.code(key, self.types, f"{{{body}}}")
        code.results = tuple(results)
        text = f"code({', '.join(self.types)})"
        parts = [f"r{i}" for i in range(len(results))]
        lines = (
            [f"    {''.join(f'{one}, ' for one in parts)}= {text}"] if parts else [f"    {text}"]
        )
        if parts:
            lines.append(f"    return {_made_of('made', self.result, parts)}")
        names = {"types": self.types, "code": code, "made": self.result}
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
        parts = {name: _parts(f"d_{name}", self.types[name]) for name in self.floats}
        returned = ", ".join(
            part for name in self.floats for part in _parts(f"adj_{name}", self.types[name])
        )
        spread = [f"d_{i}" for i in range(sum(map(len, parts.values())))]
        body = (
            f'{{ {started}[&]() {{\n#line 1 "{self.function.key}"\n{snippet}\n}}();\n'
            f"{f'return {{{returned}}};' if returned else ''} }}"
        )
        key = f"{self.function.key}_adjoint"
        code = self.code(key, given, body)
        code.results = tuple(one for name in self.floats for one in _numbers(self.types[name]))
        code.likes = {f"adj_{name}": name for name in self.gradients}
        passed = ", ".join([*seeds, *(f"adjoint[{name}]" for name in self.gradients)])
        targets = "".join(f"{one}, " for one in spread)
        lines = [f"    {targets}= code({passed})" if targets else f"    code({passed})"]
        names = {"types": types, "code": code, "adjoint": adjoint}
        for name in self.floats:
            own, spread = spread[: len(parts[name])], spread[len(parts[name]) :]
            names[f"made_{name}"] = self.types[name]
            lines.append(
                f"    adjoint[{name}] += {_made_of(f'made_{name}', self.types[name], own)}"
            )
        return self.define(key, types, lines, names)

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


_COMPOSITES = ("vec", "mat", "quat")


def _numbers(annotation) -> list[str]:
    """Native types of the numbers that a value is for C++."""
    if _is_composite(annotation):
        return [native_text(annotation._wp_scalar_type_)] * annotation._length_
    return [native_text(annotation)]


def _count(native) -> int:
    """Numbers of a vector, matrix or quaternion by the text of its type."""
    return dtypes.dtype_of(native)._length_


def _parts(name, annotation) -> list[str]:
    """The numbers of a variable in C++."""
    if not _is_composite(annotation):
        return [name]
    scalar = native_code.SCALARS[_numbers(annotation)[0]]
    return [f"((const {scalar} *)&{name})[{i}]" for i in range(annotation._length_)]


def _made_of(kind, annotation, parts) -> str:
    """The value that numbers make in the kernel language; `kind` is a name of its type."""
    return f"{kind}({', '.join(parts)})" if _is_composite(annotation) else parts[0]


def _can_return(annotation) -> bool:
    if not _is_composite(annotation):
        scalar = isinstance(annotation, type) and not dtypes.is_struct(annotation)
        return scalar and native_text(annotation) in native_code.SCALARS
    return not issubclass(annotation, dtypes.Transformation) and _cpp(annotation) is not None


def _shown(annotation) -> str:
    return f"'{dtypes.type_repr(annotation)}'"


def _cpp(annotation):
    """What C++ calls a type; None where native code cannot have it."""
    if isinstance(annotation, ArrayType):
        element = native_code.element_name(native_text(annotation.dtype))
        return element and f"wp::array_t<{element}>"
    if _is_composite(annotation) and issubclass(annotation, dtypes.Transformation):
        return None
    return native_code.element_name(native_text(annotation))
