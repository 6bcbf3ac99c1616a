"""Pages of the reference: directives of Sphinx's Python domain, one for each public name."""

from __future__ import annotations

import ast
import enum
import importlib
import inspect
import re
import types
from pathlib import Path

from reference.docstrings import markdown
from reference.names import public_names

SIMPLE = (bool, int, float, str, bytes, type(None), tuple)


class Stubs:
    """Overloads and summaries of what the package's stub defines itself."""

    def __init__(self, path: Path):
        self.signatures: dict[str, list[str]] = {}
        self.summaries: dict[str, str] = {}
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.FunctionDef):
                result = f" -> {readable(ast.unparse(node.returns))}" if node.returns else ""
                text = f"({readable(ast.unparse(node.args))}){result}"
                self.signatures.setdefault(node.name, []).append(text)
                self.summaries.setdefault(node.name, ast.get_docstring(node) or "")


def readable(annotation: str) -> str:
    """Types of the stub as users write them."""
    text = annotation.replace("builtins.", "").replace("typing.", "")
    for private, public in (("_Vec", "Vector"), ("_Mat", "Matrix"), ("_Quat", "Quaternion")):
        text = text.replace(f"{private}[", f"{public}[")
    text = text.replace("_Transform[", "Transformation[")
    text = re.sub(r"Literal\[(\d+)\]", r"\1", text)
    return re.sub(r"\b_([A-Za-z])\b", r"\1", text)


def default_text(value: object) -> str:
    if isinstance(value, SIMPLE) and len(repr(value)) < 40 and "<" not in repr(value):
        return repr(value)
    return getattr(value, "__name__", "...") if isinstance(value, type) else "..."


def signature_text(value, drop_self: bool = False) -> str:
    """The parameters of a callable, with defaults but without annotations."""
    try:
        parameters = list(inspect.signature(value).parameters.values())
    except (TypeError, ValueError):
        return "(...)"
    if drop_self and parameters and parameters[0].name in ("self", "cls"):
        parameters = parameters[1:]
    parts, starred = [], False
    for one in parameters:
        text = one.name
        if one.kind is one.VAR_POSITIONAL:
            text, starred = f"*{text}", True
        elif one.kind is one.VAR_KEYWORD:
            text = f"**{text}"
        elif one.kind is one.KEYWORD_ONLY and not starred:
            parts.append("*")
            starred = True
        if one.default is not one.empty:
            text += f"={default_text(one.default)}"
        parts.append(text)
    return f"({', '.join(parts)})"


def directive(kind: str, signatures: list[str], body: str, fence: str, options=()) -> str:
    lines = [f"{fence}{{py:{kind}}} {signatures[0]}"]
    lines += [f"{' ' * len(f'{fence}{{py:{kind}}} ')}{one}" for one in signatures[1:]]
    lines += [f":{option}:" for option in options]
    return "\n".join([*lines, "", body or "", fence])


def members(cls: type):
    """Public methods and properties of a class, inherited ones of the package included."""
    for name in sorted(dir(cls)):
        if name.startswith("_"):
            continue
        for base in cls.__mro__:
            if name in vars(base):
                if (getattr(base, "__module__", "") or "").startswith("warp"):
                    yield name, vars(base)[name]
                break


def member_page(cls: type, name: str, member: object) -> str | None:
    plain = member.__func__ if isinstance(member, (staticmethod, classmethod)) else member
    text = markdown(inspect.getdoc(getattr(cls, name, plain)))
    if isinstance(plain, property):
        return directive("property", [name], markdown(plain.__doc__), "`````")
    if callable(plain) and not isinstance(plain, type):
        kind = {staticmethod: "staticmethod", classmethod: "classmethod"}
        shown = name + signature_text(plain, not isinstance(member, staticmethod))
        return directive(kind.get(type(member), "method"), [shown], text, "`````")
    return directive("attribute", [name], "", "`````")


def is_number(cls: type) -> bool:
    """True for scalar, vector, matrix, quaternion and transform types of the package."""
    return hasattr(cls, "_wp_scalar_type_") or any(
        base.__name__ in ("ScalarType", "scalar_base") for base in cls.__mro__
    )


def class_page(name: str, cls: type, stubs: Stubs | None) -> str:
    parts = [markdown(inspect.getdoc(cls))]
    if is_number(cls):
        return directive("class", [name], parts[0], "``````")
    if issubclass(cls, enum.Enum):
        parts += [directive("attribute", [one.name], "", "`````") for one in cls]
        shown = name
    else:
        parts += [page for key, one in members(cls) if (page := member_page(cls, key, one))]
        shown = name + signature_text(cls)
    kind = "exception" if issubclass(cls, BaseException) else "class"
    return directive(kind, [shown], "\n\n".join(part for part in parts if part), "``````")


def value_text(value: object) -> str:
    """A line about a constant."""
    text = repr(value)
    if isinstance(value, SIMPLE) and len(text) < 80:
        return f"`{text}`"
    return markdown(inspect.getdoc(value)) if hasattr(value, "__doc__") else ""


def entry(name: str, value: object, stubs: Stubs | None) -> str:
    """The directive of one name."""
    if stubs and name in stubs.signatures:
        shown = [name + text for text in stubs.signatures[name]]
        doc = getattr(getattr(value, "func", value), "__doc__", None)
        body = markdown(doc) if isinstance(value, types.FunctionType) else ""
        body = body or markdown(stubs.summaries[name])
        return directive("function", shown, body, "``````")
    if inspect.isclass(value):
        return class_page(name, value, stubs)
    if isinstance(value, types.ModuleType):
        return directive(
            "data", [name], f"The module [`{value.__name__}`]({value.__name__}.md).", "``````"
        )
    if callable(value) and not isinstance(value, type):
        function = getattr(value, "func", value)
        text = markdown(inspect.getdoc(function))
        return directive("function", [name + signature_text(function)], text, "``````")
    return directive("data", [name], value_text(value), "``````")


def module_page(module: str) -> str:
    """A page with all public names of a module; names of `warp` refer to its pages."""
    import warp

    title = f"`{module}`"
    parts = [f"# {title}", "", markdown(importlib.import_module(module).__doc__), ""]
    parts += ["```{py:currentmodule} " + module, "```", ""]
    for name, value in public_names(module):
        if vars(warp).get(name) is value and not isinstance(value, SIMPLE):
            same = f"The same as {{py:obj}}`warp.{name}`."
            parts += [directive("data", [name], same, "``````"), ""]
        else:
            parts += [entry(name, value, None), ""]
    return "\n".join(parts)
