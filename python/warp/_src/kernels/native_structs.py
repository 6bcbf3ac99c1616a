"""C++ names of the types of parameters of functions that users write in C++, structs among them.

A struct has the user's name and its fields, in memory as kernels have it: an array of structs can
be read and written as one of the C++ structs.
"""

from __future__ import annotations

import re
import typing

from warp._src.types import dtypes
from warp._src.types.native import ArrayType, native_text

# By the text of the native type: what C++ calls it.
SCALARS = {
    "i1": "bool",
    "si8": "int8_t",
    "ui8": "uint8_t",
    "si16": "int16_t",
    "ui16": "uint16_t",
    "si32": "int32_t",
    "ui32": "uint32_t",
    "si64": "int64_t",
    "ui64": "uint64_t",
    "f32": "float",
    "f64": "double",
}
_COMPOSITE = re.compile(r"!warp\.(\w+)<(?:([\dx ]+) x )?(\w+)>")


class Field(typing.NamedTuple):
    """A part of a parameter as kernels pass it: what no struct is.

    Attributes:
        name: of a parameter of the piece of native code.
        path: what both languages call it, `p.body.mass`.
        annotation: its type.
    """

    name: str
    path: str
    annotation: object


def element_name(native: str) -> str | None:
    """The C++ name of values by the text of their native type; None if there is none."""
    if native.startswith("!warp.struct"):
        return struct_name(dtypes.dtype_of(native))
    found = _COMPOSITE.fullmatch(native)
    if found is None:
        return SCALARS.get(native)
    kind, extents, scalar = found.groups()
    if scalar not in SCALARS or kind not in ("vec", "mat", "quat", "transform"):
        return None
    numbers = [*re.findall(r"\d+", extents or ""), SCALARS[scalar]]
    return f"wp::{kind}_t<{', '.join(numbers)}>"


def scalar_name(native: str) -> str:
    """The C++ name of the numbers of a vector, matrix, quaternion or transform."""
    return SCALARS[_COMPOSITE.fullmatch(native)[3]]


def type_name(annotation) -> str | None:
    """The C++ name of the type of a parameter or of a field; None if there is none."""
    if isinstance(annotation, ArrayType):
        element = element_name(native_text(annotation.dtype))
        return element and f"wp::array_t<{element}>"
    if is_struct(annotation):
        return struct_name(annotation)
    return element_name(native_text(annotation))


def is_struct(annotation) -> bool:
    return isinstance(annotation, type) and dtypes.is_struct(annotation)


def struct_name(struct) -> str | None:
    """The user's name; None if C++ has no type for a field."""
    known = all(type_name(one) is not None for one in struct._wp_fields_.values())
    return re.sub(r"\W", "_", struct.__name__) if known else None


def fields_of(name, annotation, path=None) -> list[Field]:
    """The parts of a parameter that are passed one by one."""
    path = path or name
    if not is_struct(annotation):
        return [Field(name, path, annotation)]
    return [
        part
        for field, inner in annotation._wp_fields_.items()
        for part in fields_of(f"{name}__{field}", inner, f"{path}.{field}")
    ]


def definitions(annotations) -> str:
    """The C++ structs that types are or have, inner ones first."""
    found: dict = {}
    for annotation in annotations:
        _define(annotation, found)
    return "".join(found.values())


def _define(annotation, found) -> None:
    if isinstance(annotation, ArrayType):
        _define(annotation.dtype, found)
    if not is_struct(annotation) or annotation in found:
        return
    for inner in annotation._wp_fields_.values():
        _define(inner, found)
    fields = "".join(f"{type_name(one)} {name}; " for name, one in annotation._wp_fields_.items())
    name, size = struct_name(annotation), dtypes.type_size_in_bytes(annotation)
    found[annotation] = (
        f"struct {name} {{ {fields}}};\n"
        f'static_assert(sizeof({name}) == {size}, "fields lie as in kernels");\n'
    )
