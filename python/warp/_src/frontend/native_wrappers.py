"""Native functions that change their arguments or have an adjoint, as functions of numbers alone.

Kernels call native code that takes numbers and gives one (`native_code`). So a function with
parameters by reference is made into one piece of native code per output, the result or the last
value of such a parameter, and a function in the kernel language that calls them and assigns. With
an adjoint each output has a derivative, which is native code too: the user's text with the
cotangent of this output set and the others zero, as it is linear in them. Clang drops from each
piece what it does not need.
"""

from __future__ import annotations

from warp._src.derivatives.functions import adjoint
from warp._src.kernels.function import Function, NativeFunction
from warp._src.kernels.map_functions import define
from warp._src.kernels.native_code import SCALARS
from warp._src.types import dtypes
from warp._src.types.annotations import Reference, annotations_of
from warp._src.types.native import native_text

_RESULT = "ret"
_MADE = "_warp_wrappers"


def needs_wrapper(function) -> bool:
    """True if a native function is more than one of numbers without a derivative."""
    declared = annotations_of(function.func).values()
    by_reference = any(isinstance(one, Reference) for one in declared)
    return by_reference or function.adj_native_snippet is not None


def wrapper_of(function, pointers=()):
    """The function in the kernel language that stands for a native one; made once.

    Args:
        pointers: (name, type) of each parameter that gets the address of a value of that type.
    """
    known = function.__dict__.setdefault(_MADE, {})
    key = tuple(pointers)
    if key not in known:
        known[key] = _Wrapper(function, dict(pointers)).made()
    return known[key]


class _Wrapper:
    """Parts of the texts of one native function."""

    def __init__(self, function, pointers):
        self.function = function
        self.pointers = pointers
        declared = dict(annotations_of(function.func))
        self.result = declared.pop("return", None)
        self.types, self.references = {}, []
        for name, annotation in declared.items():
            if isinstance(annotation, Reference):
                self.references.append(name)
                annotation = annotation.dtype
            elif name in pointers:
                self.references.append(name)
                annotation = pointers[name]
            self.types[name] = annotation

    def made(self) -> Function:
        """A function with the parameters of the native one; assigns, then returns."""
        names = {"Reference": Reference, "types": self.types}
        lines, assigned = [], []
        outputs = self.references if self.result is None else [_RESULT, *self.references]
        passed = ", ".join(self.types)
        for output in outputs:
            names[f"value_{output}"] = self.output(output)
            lines.append(f"    last_{output} = value_{output}({passed})")
            if output != _RESULT:
                assigned.append(f"    {output} = last_{output}")
        lines += assigned
        if self.result is not None:
            lines.append(f"    return last_{_RESULT}")
        parameters = ", ".join(
            f"{name}: Reference(types['{name}'])"
            if name in self.references
            else f"{name}: types['{name}']"
            for name in self.types
        )
        return Function(self.define(self.function.key, parameters, lines or ["    pass"], names))

    def define(self, name, parameters, lines, names):
        return define(name, "\n".join([f"def {name}({parameters}):", *lines, ""]), names)

    def output(self, output) -> Function:
        """One output as a function of the arguments, with its derivative if there is an adjoint."""
        kind = self.result if output == _RESULT else self.types[output]
        last = (
            "return warp_forward();" if output == _RESULT else f"warp_forward(); return {output};"
        )
        raw = self.native(f"{output}", self.forward() + last, kind)
        if self.function.adj_native_snippet is None:
            return raw
        declared = ", ".join(f"{name}: types['{name}']" for name in self.types)
        passed = ", ".join(self.types)
        names = {"types": self.types, "raw": raw, "kind": kind}
        text = [f"    return raw({passed})"]
        made = Function(self.define(f"{self.function.key}_{output}", declared, text, names))
        made.pullbacks.append(self.pullback(output, kind, declared))
        return made

    def pullback(self, output, kind, declared):
        """The derivative of one output in the form of `@wp.func_grad`."""
        names, lines = {"types": self.types, "kind": kind, "adjoint": adjoint}, []
        for name, annotation in self.types.items():
            if dtypes.canonical(annotation) not in _FLOATS:
                continue
            names[f"adjoint_{name}"] = self.adjoint(output, name, kind)
            given = ", ".join([*self.types, "cotangent"])
            lines.append(f"    adjoint[{name}] += adjoint_{name}({given})")
        parameters = f"{declared}, cotangent: kind"
        key = f"{self.function.key}_{output}_adjoint"
        return self.define(key, parameters, lines or ["    pass"], names)

    def forward(self) -> str:
        """The user's text as a lambda, which changes what is passed by reference."""
        returned = "void" if self.result is None else _cpp(self.result)
        own = [f"{name} = {name}" for name in self.types if name not in self.references]
        captured = ", ".join(["&", *own])
        return f"auto warp_forward = [{captured}]() mutable -> {returned} {{{self.body()}}};\n"

    def body(self) -> str:
        """The user's text; names of pointers stand for addresses of the values in it."""
        text = self.function.native_snippet
        if not self.pointers:
            return f"\n{text}\n"
        renamed = "".join(f"auto &value_of_{name} = {name};" for name in self.pointers)
        taken = "".join(f"uint64_t {name} = (uint64_t)&value_of_{name};" for name in self.pointers)
        return f"{renamed} {{ {taken}\n{text}\n }}"

    def adjoint(self, output, name, kind) -> NativeFunction:
        """The contribution of one output to the cotangent of one parameter."""
        started = "".join(
            f"{_cpp(annotation)} adj_{one} = 0;" for one, annotation in self.types.items()
        )
        result = "" if self.result is None else f"{_cpp(self.result)} adj_{_RESULT} = 0;"
        text = (
            f"{self.forward()} warp_forward(); {started} {result} adj_{output} = cotangent;\n"
            f"[&]() {{\n{self.function.adj_native_snippet}\n}}();\nreturn adj_{name};"
        )
        types = {**self.types, "cotangent": kind}
        return self.native(f"{output}_{name}", text, self.types[name], types)

    def native(self, suffix, text, result, types=None) -> NativeFunction:
        """Native code of numbers, by value."""
        types = types or self.types
        declared = ", ".join(f"{name}: types['{name}']" for name in types)
        made = self.define(
            f"{self.function.key}_{suffix}", declared, ["    pass"], {"types": types}
        )
        made.__annotations__["return"] = result
        found = NativeFunction(made, text, None, None)
        found.key = self.function.key
        return found


_FLOATS = tuple(dtypes.canonical(one) for one in (float, dtypes.float64))


def _cpp(annotation) -> str:
    """The name of a type in C++; the annotation's name where native code cannot have it."""
    text = native_text(annotation)
    return SCALARS.get(text, text)
