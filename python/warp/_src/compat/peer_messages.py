"""The sentences of NVIDIA Warp for errors, by our codes (`WarpError.code`).

Programs may look for them. They are added to messages if `config.peer_messages` is set. A sentence
is a format string of the error's facts, or a function of them where the peer says several things.
"""

from __future__ import annotations

import re
import typing

from warp._src.types import dtypes
from warp._src.types.composites import is_number
from warp._src.types.native import ArrayType
from warp._src.types.scalars import ScalarType

_SHORT = {"int32": "int", "float32": "float"}
_ARGUMENT = re.compile(r"argument '(.*?)' expects '(.*?)', but got (.*)")
_ARRAY = re.compile(r"array\(ndim=(\d), dtype=(.*)\)$")


def sentence(code: str, facts: dict) -> str | None:
    """The sentence for a code, or None where the peer says nothing or facts are missing."""
    found = SENTENCES.get(code)
    if found is None:
        return None
    try:
        return found.format_map(facts) if isinstance(found, str) else found(**facts)
    except (KeyError, TypeError):
        # The error comes from another process, which keeps the facts.
        return None


def _external(kind) -> str:
    shown = kind.__qualname__
    if dtypes.type_is_array(kind):
        shown = "warp._src.types.array"
    elif kind.__module__ != "builtins":
        shown = f"{kind.__module__}.{shown}"
    return f"Invalid external reference type: <class '{shown}'>"


def _builtin_types(name, types) -> str:
    return (
        f"Couldn't find function overload for '{name}' that matched inputs with types: "
        f"[{', '.join(types)}]. Input types must be exactly the same, got {types}"
    )


def _components(native, given) -> str | None:
    """A composite cannot be made of values of the given types."""
    kinds = {"vec": "vector", "mat": "matrix", "quat": "quaternion"}
    family, shape = kinds.get(native.kind, "transformation"), tuple(native.shape)
    if len(given) == 1 and given[0].kind == native.kind:
        return _copied(family, native, given[0])
    others = [one for one in given if one != native.element]
    if others and all(other.kind in ("bool", "int", "float") for other in others):
        wanted = f"this {family} is expected to be of the type `{native.element.python_name}`"
        if len(given) == 1:
            return f"the value used to fill {wanted}"
        return f"all values used to initialize {wanted}".replace(" is ", " are ")
    of_shape = {
        "vector": f"vector of length {shape[0] if shape else 0}",
        "matrix": f"matrix of shape {shape}",
        "quaternion": "quaternion",
    }.get(family, "transform; expected 0, 1, or 7")
    return f"incompatible number of values given ({len(given)}) when constructing a {of_shape}"


def _copied(family, native, given) -> str:
    if native.kind == "vec":
        of, shapes = "of length", (native.shape[0], given.shape[0])
    else:
        of, shapes = "of shape", (tuple(native.shape), tuple(given.shape))
        family = "matrix"
    return (
        f"incompatible {family} {of} {shapes[0]} given when copy constructing a {family} {of} "
        f"{shapes[1]}"
    )


def _field(field, value) -> str | None:
    """A value does not fit a field of a struct."""
    head = f"Struct field '{field.name}' expects"
    record = getattr(field.dtype, "_wp_fields_", {})
    expected = record.get("data") if "indexed" in record else field.dtype
    if isinstance(expected, ArrayType):
        if not dtypes.type_is_array(type(value)):
            kind = "Warp indexed array" if record else "Warp array"
            return f"{head} a {kind}, got {type(value).__name__}"
        if not dtypes.types_equal(value.dtype, expected.dtype):
            wanted, got = map(dtypes.type_repr, (expected.dtype, value.dtype))
            return f"{head} dtype {wanted}, got {got}"
        return f"{head} an array with {expected.ndim} dimension(s), got {value.ndim} dimension(s)"
    if is_number(value) and not isinstance(expected, ScalarType):
        return f"{head} {dtypes.type_repr(expected)} but got a single value"
    return None


def _launch_argument(message) -> str | None:
    """A launch argument does not fit its parameter; the native side gives the message alone."""
    found = _ARGUMENT.search(message)
    if found is None:
        return None
    name, expected, given = found.groups()
    lead = f"argument '{name}' expects"
    kind = re.findall(r"'([^']*)'", given)[-1 if given.endswith(")") else 0].rpartition(".")[2]
    array = _ARRAY.match(expected)
    if array or "array(" in expected:
        got = _ARRAY.match(given.partition("'")[2].partition("'")[0])
        if not array or not got:
            kind = "NoneType" if kind == "None" else kind
            return f"{lead} an array of type {expected}, but passed value has type {kind}"
        if array[1] != got[1]:
            return (
                f"{lead} an array with {array[1]} dimension(s) but the passed array has {got[1]} "
                "dimension(s)"
            )
        return f"{lead} an array with dtype={array[2]} but passed array has dtype={got[2]}"
    got = "None" if kind == "None" else "a single value"
    return f"{lead} {expected} but got {got}"


def _launch_conversion(message) -> str | None:
    """A launch argument cannot be made the number or the composite that is expected."""
    found = _ARGUMENT.search(message)
    if found is None:
        return None
    return f"Failed to convert argument for param {found[1]} to {found[2]}"


def _map_function(function, types) -> str:
    """`wp.map` cannot apply a function to elements of these types."""
    code = function.__code__
    if code.co_argcount != len(types):
        return (
            f"Number of input arguments ({len(types)}) does not match expected number of "
            f"function arguments ({code.co_argcount})"
        )
    declared = [function.__annotations__.get(name) for name in code.co_varnames]
    for given, wanted in zip(types, declared, strict=False):
        if isinstance(wanted, type) and dtypes.canonical(wanted) is not given:
            shown = ", ".join(dtypes.type_repr(dtype) for dtype in types)
            name = function.__qualname__.replace(".<locals>.", "__locals__")
            return f"Function {name} does not support the provided argument types {shown}"
    return "The provided function must return a value"


def _result(function, written, wanted, names, is_local_array) -> str:
    """A function returns something else than annotated."""
    head = f"The function `{function}`"
    declared = ["Any" if native is None else native.python_name for native in wanted]
    if written in (int, float, bool):
        declared = [written.__name__]
    if is_local_array:
        element = getattr(wanted[0], "element", None)
        shown = f"Array[{element.python_name}]" if element else declared[0]
        return (
            f"{head} returns a fixed-size array whereas it has its return type annotated as "
            f"`{shown}`."
        )
    head += " has its return type annotated as"
    if len(wanted) == 1:
        if len(names) == 1:
            return f"{head} `{declared[0]}` but the code returns a value of type `{names[0]}`."
        shown = _SHORT.get(declared[0], declared[0])
        return f"{head} `{shown}` but the code returns {len(names)} values."
    if len(wanted) != len(names):
        return f"{head} a tuple of {len(wanted)} elements but the code returns {len(names)} values."
    short = ", ".join(_SHORT.get(name, name) for name in declared)
    return (
        f"{head} `tuple[{short}]` but the code returns a tuple with types `({', '.join(names)})`."
    )


def _view(source, target) -> str:
    """Sizes of elements do not fit for a view."""
    ours, other = dtypes.type_scalar_type(source), dtypes.type_scalar_type(target)
    size, size_target = map(dtypes.type_size_in_bytes, (source, target))
    source_text, target_text = f"source dtype has size {size} bytes", "target dtype has size"
    if ours is not source and other is target:
        size_ours = dtypes.type_size_in_bytes(ours)
        source_text = f"source scalar dtype {ours.__name__} has size {size_ours} bytes"
    elif ours is source and other is not target:
        target_text = f"target scalar dtype {other.__name__} has size"
        size_target = dtypes.type_size_in_bytes(other)
    return (
        f"cannot create an array view with dtype {dtypes.type_repr(target)} from source dtype "
        f"{dtypes.type_repr(source)}: {source_text}, but {target_text} {size_target} bytes"
    )


SENTENCES: dict[str, str | typing.Callable[..., str | None]] = {
    "builtin-types": _builtin_types,
    "components": _components,
    "external-reference": _external,
    "field-type": _field,
    "launch-argument": _launch_argument,
    "launch-conversion": _launch_conversion,
    "map-function": _map_function,
    "result-type": _result,
    "transform-number": (
        "Invalid argument in transformation constructor: expected a scalar value, got {given}"
    ),
    "transform-part": (
        "Invalid argument '{name}' in transformation constructor: expected a sequence, got {given}"
    ),
    "view-size": _view,
    "aot-empty": "No compilable kernels found, expects a kernel or a generic kernel with overloads",
    "argument-missing": "{name}() missing required keyword argument '{which}'",
    "array-parameters": "array{ndim}d[...] takes a single type parameter",
    "array-rank": "ndim must be between 1 and 4, got {spelled}",
    "array-slot-index": "Array slot write indices must be integers or slices",
    "array-slice-step": "Slice step cannot be zero",
    "attribute": "`{name}` is not an attribute of '{owner}' ({dtype})",
    "operator": "Operator `{name}` is not defined",
    "attribute-constant": "`{name}` is not an attribute of '{base}'",
    "attribute-module": (
        "`{name}` is not an attribute of '{module}'\nCould not find function {called}"
    ),
    "broadcast": "Shapes {shapes} are not broadcastable",
    "builtin-arguments": (
        "Couldn't find a function '{name}' compatible with the arguments '{types}'"
    ),
    "choice": "{name} must be the string literal {first!r} or {second!r}",
    "compare-types": "Can't test equality for objects with different types",
    "component-count": (
        "Invalid number of arguments in {constructor} constructor, expected {length} elements, "
        "got {count}"
    ),
    "component-string": "Expected to assign a `{wanted}` value but got `str` instead",
    "component-type": "Expected to assign a `{wanted}` value but got `{given}` instead",
    "constant-type": "Invalid constant type: {kind}",
    "construct": "Construct `ast.{kind}` not supported in kernels.",
    "copy-gaps": (
        "Copies of parts of arrays that are not contiguous are only supported for 1-D; {shapes}"
    ),
    "copy-integers": "Copy offsets and count must be integers",
    "copy-negative": "{word} must be non-negative",
    "copy-range": "the range exceeds the {side} size",
    "copy-size": "destination dtype={dest}, source dtype={src}",
    "cuda-properties": "get_cuda_kernel_properties() requires a CUDA device",
    "dlpack-capsule": "Expected a valid DLPack capsule, got {got}",
    "dlpack-device": "Unsupported source device for DLPack: device_type={kind}, device_id={number}",
    "dlpack-types": "Incompatible data types: DLPack {held} and Warp {dtype}",
    "extent-large": (
        "Array shapes must not exceed the maximum representable value of a signed 32-bit integer"
    ),
    "extent-negative": "Array shapes must be non-negative",
    "in-out-late": "in_out arguments should be placed before output-only arguments",
    "in-out-twice": "in_out_argnames must not contain duplicate names",
    "in-out-unknown": "in_out_argnames {unknown} did not match any function argument names",
    "index-count": "Incorrect number of indices specified for array indexing",
    "index-type": "Invalid key {spelled}, expected int or slice",
    "jax-extent": (
        "Warp cannot launch a kernel using wp.tid() with extent {extent} in dimension {axis}"
    ),
    "kernel-expected": "expected a wp.Kernel, got {name}",
    "kernel-generic": "{caller} requires a concrete overload, use wp.overload",
    "kernel-return": (
        "Warp kernels cannot return values. Write results to output arguments, and omit the "
        "return annotation or use `-> None`."
    ),
    "list": (
        "List constructs are not supported in kernels. Use vectors like `wp.vec3()` for small "
        "fixed-size collections, or `wp.zeros(shape=N, dtype=...)` for stack-allocated arrays."
    ),
    "local-array-shape": (
        "the `shape` argument must be specified as a constant when zero-initializing an array"
    ),
    "map-arrays": "map requires at least one warp.array input",
    "map-out-count": (
        "Number of provided output arrays ({got}) does not match expected number of function "
        "outputs ({wanted})"
    ),
    "map-out-dtype": "Output array{which} dtype {got} does not match expected dtype {wanted}",
    "map-out-shape": "Output array{which} shape {got} does not match expected shape {wanted}",
    "map-out-single": (
        "Invalid output provided, expected {wanted} Warp arrays with shape {shape} and dtypes "
        "({names})"
    ),
    "matrix-index": "Invalid {what} index",
    "matrix-index-count": "Invalid key, expected one or two indices, got {count}",
    "matrix-index-type": "Invalid key {spelled}, expected int or pair of ints",
    "matrix-rank": "Matrix shape must have exactly two dimensions, got {extents} in shape {shape}",
    "matrix-row": (
        "Invalid argument in matrix constructor, expected row of length {columns}, got {row}"
    ),
    "matrix-shape": "the `shape` argument must be specified when initializing a matrix by value",
    "native-return": "unsupported return type",
    "null-pointer": "NULL pointer exception",
    "operator-types": (
        "Couldn't find function overload for '{name}': Input types must be {exactly}the same, "
        "got {types}"
    ),
    "overload": (
        "Couldn't find function overload for '{name}' that matched inputs with types: [{types}]"
    ),
    "overload-ambiguous": "Ambiguous kernel lookup for '{name}'",
    "overload-return": "Return annotations are not allowed on @wp.overload stubs",
    "overwritten": (
        "Array {array!r} is being written to{place} but has already been read from in a "
        "previous launch. This may corrupt gradient computation in the backward pass."
    ),
    "printf-count": (
        "the maximum number of variadic arguments that can be passed to `printf` is {most}"
    ),
    "printf-format": "unsupported built-in function 'printf'",
    "random-bounds": "{name}() 'min' and 'max' must both be {kinds}",
    "reassign": "Cannot reassign local '{name}' that is bound to wp.grad(...)",
    "requirement": "{sentence}",
    "reshape-size": (
        "cannot reshape array of shape {shape} (size {size}) into shape {new_shape} (size "
        "{new_size})"
    ),
    "slice-components": (
        "The provided vector is expected to be of length {count} with dtype {shown}."
    ),
    "slice-constant": "Slice component must be a compile-time constant",
    "slice-count": (
        "The length of the provided vector ({got}) isn't compatible with the given slice "
        "(expected {count})."
    ),
    "slice-size": "Can only assign sequence of same size",
    "slice-step": "slice step cannot be zero",
    "slice-type": (
        "Expected to assign a slice from a sequence of `{wanted}` values but got `{given}` instead"
    ),
    "slice-value": (
        "The provided value is expected to be a vector of length {count}, with dtype {shown}."
    ),
    "slot-type": "Composite slot assignment expects value of type {shown}, got {given}",
    "starred": (
        "Starred expressions are only supported for tuples, vectors, matrices and slices of arrays"
    ),
    "static-failed": (
        "Error evaluating static expression: {problem}. Make sure all variables used in the "
        "static expression are constant."
    ),
    "static-value": "Static expression returns an unsupported value: {what}",
    "stride-count": "Invalid number of strides, expected {expected} strides, got {given}",
    "struct-bases": "Warp structs must be defined as base classes",
    "tape-scope": "ended tape scope, but scope not present",
    "tile-arange-count": "tile_arange() spans more elements than can be counted",
    "tile-arange-fraction": "tile_arange() {name}={number} has a fractional part",
    "tile-axis": "{name}() axis argument must be valid axis of the {kind}, got {found}.",
    "tile-elements": "{name}() does not support {elements} tiles",
    "tile-index": "tile indices must be integers or slices",
    "tile-index-type": "Tile indexing requires an integer index tile.",
    "tile-indices": "{name}() '{other}' argument must have {count} dimensions, got {rank}",
    "tile-indices-type": "expects an integer index tile",
    "tile-offset": (
        "{name}() offset argument must have the same number of dimensions as the array to load "
        "from, got {count} indices for an array with {rank} dimensions"
    ),
    "tile-operands": "Cannot {verb} {left} by {right}: at least one operand must be a scalar type",
    "tile-rank": "{name}() output must have between one and four dimensions, got {count}",
    "tile-scalars": "element type must be scalar",
    "tile-shape": "shape must be a tuple of constants",
    "tile-shapes": "Tile arguments to tile operators must have the same shape",
    "tile-stack-capacity": "tile_stack() requires capacity to be a compile-time constant",
    "tile-struct-bits": "bitwise inplace operators do not support Warp struct tiles",
    "tile-struct-operator": "bitwise inplace operators do not support Warp struct tiles: {name}",
    "tile-view-shape": "tile_view() cannot take 'shape' together with a slice",
    "undefined": "Referencing undefined symbol: {name}",
    "unpack-end": "unpacking an array requires explicit upper bound",
    "unpack-negative": "slice indices cannot be negative for arrays",
    "unpack-step": "slice step cannot be negative",
    "vector-length": "the `length` argument must be specified when zero-initializing a vector",
}
