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
from warp._src.frontend import updates
from warp._src.kernels import native_code
from warp._src.kernels.function import Function, NativeFunction
from warp._src.kernels.map_functions import define
from warp._src.kernels.native_structs import definitions, fields_of, is_struct, type_name
from warp._src.types import dtypes
from warp._src.types.annotations import Reference, annotations_of
from warp._src.types.native import ArrayType, native_text

_MADE = "_warp_array_function"
_FIX = "write the function in Python with `@wp.func`"
_FLOATS = ("f32", "f64")


class MemoryCode(NativeFunction):
    """A piece of native code as kernels call it.

    Attributes:
        results: native types of the numbers it gives; C++ returns them in a struct `Results`.
        structs: definitions of the structs of the user that the text needs.
        likes: by name of an array of gradients the parameter it belongs to.
    """

    results: tuple = ()
    structs: str = ""
    likes: dict = {}  # noqa: RUF012


def in_memory(function) -> bool:
    """True if a native function has more than numbers to take or to give."""
    declared = annotations_of(function.func)
    # Types that cannot be returned are refused there.
    returned = declared.get("return")
    return any(
        isinstance(one, ArrayType) or _is_composite(one) or is_struct(one)
        for one in map(_value_type, declared.values())
    ) or (returned is not None and not _can_return(returned))


def _value_type(annotation):
    """The type of what a parameter is or refers to."""
    return annotation.dtype if isinstance(annotation, Reference) else annotation


def _is_composite(annotation) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, dtypes.Composite)


def call(context, function, node):
    """Calls what stands for a native function with arrays.

    Raises:
        WarpCodegenError: a parameter is neither a number, a vector, a matrix, a quaternion, a
            transform, a struct of such nor an array of these; or the result is an array or struct.
    """
    for name, annotation in annotations_of(function.func).items():
        if name == "return" and annotation is not None and not _can_return(annotation):
            problem = f"the native code of '{function.key}', which returns {_shown(annotation)},"
            raise context.unsupported(node, problem, _FIX, code="native-return")
        if name != "return" and type_name(_value_type(annotation)) is None:
            problem = f"the native code of '{function.key}', whose '{name}' C++ has no type for,"
            raise context.unsupported(node, problem, _FIX)
        is_reference = isinstance(annotation, Reference)
        if is_reference and (
            function.adj_native_snippet is not None or isinstance(annotation.dtype, ArrayType)
        ):
            what = (
                "array" if isinstance(annotation.dtype, ArrayType) else "argument with an adjoint"
            )
            problem = f"the native code of '{function.key}', which changes the {what} '{name}',"
            raise context.unsupported(node, problem, _FIX)
    if _MADE not in function.__dict__:
        function.__dict__[_MADE] = _Maker(function).made()
    made = function.__dict__[_MADE]
    references = updates.references_of(made)
    if references:
        return context.references.call_by_reference(made, references, node)
    arguments, keywords = context.constructors.arguments(node)
    return context.user_calls.call_function(made, arguments, keywords, node)


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
    """Source of the functions for one native function.

    Structs are passed field by field and made whole in C++. The last values of parameters by
    reference are results, too; the array fields of a struct stay as they are.
    """

    def __init__(self, function):
        self.function = function
        self.types = dict(annotations_of(function.func))
        self.result = self.types.pop("return", None)
        references = [name for name, one in self.types.items() if isinstance(one, Reference)]
        self.types = {name: _value_type(one) for name, one in self.types.items()}
        self.changed = [
            one
            for name in references
            for one in fields_of(name, self.types[name])
            if not isinstance(one.annotation, ArrayType)
        ]
        self.references = set(references)
        self.structs = definitions(self.types.values())
        self.parts = [one for name, kind in self.types.items() for one in fields_of(name, kind)]
        arrays = [one for one in self.parts if isinstance(one.annotation, ArrayType)]
        self.floats = [
            one
            for one in self.parts
            if one not in arrays and _numbers(one.annotation)[0] in _FLOATS
        ]
        self.gradients = [one for one in arrays if _has_gradient(one.annotation)]

    def made(self) -> Function:
        """A function with the parameters of the native one."""
        function = self.function
        made = self.forward(function.key, function.native_snippet)
        if function.replay_snippet is not None:
            replayed = self.forward(f"{function.key}_replay", function.replay_snippet)
            made.replays.append(replayed.func)
        smooth = self.floats or self.gradients or _numbers(self.result or int)[0] in _FLOATS
        if not self.references and (function.adj_native_snippet is not None or not smooth):
            made.pullbacks.append(self.pullback(function.adj_native_snippet or ""))
        return made

    def whole(self, prefix="") -> str:
        """C++ that makes structs of their fields, those whose names have the prefix."""
        text = ""
        for name, kind in self.types.items():
            if is_struct(kind):
                text += f"{type_name(kind)} {prefix}{name} = {{}}; "
                wanted = self.gradients if prefix else self.parts
                text += "".join(
                    f"{prefix}{one.path} = {prefix}{one.name}; "
                    for one in fields_of(name, kind)
                    if one in wanted
                )
        return text

    def forward(self, key, snippet) -> Function:
        body = f'\n#line 1 "{self.function.key}"\n{snippet}\n'
        # C++ that gives a result, its native types and what the kernel language makes of it.
        results = () if self.result is None else tuple(_numbers(self.result))
        if _is_composite(self.result) or self.references:
            kind = "void" if self.result is None else type_name(self.result)
            given = [] if self.result is None else _parts("warp_ret", self.result)
            for one in self.changed:
                given += _parts(one.path, one.annotation)
                results += tuple(_numbers(one.annotation))
            kept = "" if self.result is None else f"{kind} warp_ret = "
            body = f"{kept}[&]() -> {kind} {{{body}}}();\nreturn {{{', '.join(given)}}};"
        code = self.code(key, self._passed(), f"{{ {self.whole()}{body}}}")
        code.results = results
        left = [f"r{i}" for i in range(len(results))]
        targets = "".join(f"{one}, " for one in left)
        text = f"code({', '.join(one.path for one in self.parts)})"
        lines = [f"    {targets}= {text}" if targets else f"    {text}"]
        names = {"types": self.types, "code": code, "made": self.result, "Reference": Reference}
        if self.result is not None:
            count = len(_numbers(self.result))
            returned, left = _made_of("made", self.result, left[:count]), left[count:]
        for i, one in enumerate(self.changed):
            count = len(_numbers(one.annotation))
            names[f"made_{i}"] = one.annotation
            lines.append(f"    {one.path} = {_made_of(f'made_{i}', one.annotation, left[:count])}")
            left = left[count:]
        if self.result is not None:
            lines.append(f"    return {returned}")
        return Function(self.define(key, self.types, lines, names))

    def _passed(self) -> dict:
        """Types of what the piece of native code gets, by name."""
        return {one.name: one.annotation for one in self.parts}

    def pullback(self, snippet):
        """The derivative in the form of `@wp.func_grad`."""
        types, passed = dict(self.types), self._passed()
        if self.result is not None:
            types["adj_ret"] = passed["adj_ret"] = self.result
        seeds = [*(one.path for one in self.parts), *list(passed)[len(self.parts) :]]
        given = {**passed, **{f"adj_{one.name}": one.annotation for one in self.gradients}}
        plain = [name for name, kind in self.types.items() if not is_struct(kind)]
        arrays = {one.name for one in self.gradients}
        started = "".join(
            f"{type_name(self.types[name])} adj_{name} = {{}}; "
            for name in plain
            if name not in arrays
        )
        parts = {one: _parts(f"d_{one.name}", one.annotation) for one in self.floats}
        returned = ", ".join(
            part for one in self.floats for part in _parts(f"adj_{one.path}", one.annotation)
        )
        spread = [f"d_{i}" for i in range(sum(map(len, parts.values())))]
        body = (
            f"{{ {self.whole()}{self.whole('adj_')}{started}[&]() {{\n"
            f'#line 1 "{self.function.key}"\n{snippet}\n}}();\n'
            f"{f'return {{{returned}}};' if returned else ''} }}"
        )
        key = f"{self.function.key}_adjoint"
        code = self.code(key, given, body)
        code.results = tuple(kind for one in self.floats for kind in _numbers(one.annotation))
        code.likes = {f"adj_{one.name}": one.name for one in self.gradients}
        handed = ", ".join([*seeds, *(f"adjoint[{one.path}]" for one in self.gradients)])
        targets = "".join(f"{one}, " for one in spread)
        lines = [f"    {targets}= code({handed})" if targets else f"    code({handed})"]
        names = {"types": types, "code": code, "adjoint": adjoint}
        for i, one in enumerate(self.floats):
            own, spread = spread[: len(parts[one])], spread[len(parts[one]) :]
            names[f"made_{i}"] = one.annotation
            lines.append(f"    adjoint[{one.path}] += {_made_of(f'made_{i}', one.annotation, own)}")
        return self.define(key, types, lines, names)

    def code(self, key, types, body) -> MemoryCode:
        declared = self.define(f"{key}_code", types, ["    pass"], {"types": types}, ())
        code = MemoryCode(declared, body, None, None)
        code.key = self.function.key
        code.structs = self.structs
        return code

    def define(self, key, types, lines, names, references=None):
        references = self.references if references is None else references
        parameters = ", ".join(
            f"{name}: {'Reference' if name in references else ''}(types['{name}'])"
            for name in types
        )
        return define(key, "\n".join([f"def {key}({parameters}):", *lines, ""]), names)


def _has_gradient(annotation) -> bool:
    return str(dtypes.native_type(annotation.dtype)).rstrip(">").endswith(_FLOATS)


_COMPOSITES = ("vec", "mat", "quat", "transform")


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
        scalar = isinstance(annotation, type) and not is_struct(annotation)
        return scalar and native_text(annotation) in native_code.SCALARS
    return type_name(annotation) is not None


def _shown(annotation) -> str:
    return f"'{dtypes.type_repr(annotation)}'"
