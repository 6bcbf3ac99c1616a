"""`wp.map`, and the operators of arrays: a function applied to the elements of arrays.

Each combination of function and argument types gets a kernel, made from a few lines of generated
source and kept. The result type of the function is found by translating it once without outputs.
Arrays broadcast as in NumPy: a dimension of extent 1 is repeated by a view whose stride is 0.
"""

from __future__ import annotations

import math
import typing

from warp._src import errors
from warp._src.arrays import hooks
from warp._src.arrays.array import array
from warp._src.arrays.copies import clone, empty_like
from warp._src.arrays.create import empty
from warp._src.arrays.gradients import has_gradient
from warp._src.arrays.indexed import indexedarray
from warp._src.devices.devices import by_index, resolve_index
from warp._src.kernels.kernel import Kernel
from warp._src.kernels.launch import launch
from warp._src.kernels.map_functions import define, function_of
from warp._src.language import namespace
from warp._src.types import dtypes
from warp._src.types.composites import Composite, canonical_class
from warp._src.types.native import ArrayType
from warp._src.types.numpy_types import dtype_from_numpy
from warp._src.types.scalars import scalar_base

_kernels: dict = {}


def map(func, *inputs, out=None, return_kernel=False, block_dim=None, device=None) -> typing.Any:
    """Applies a function to the elements of arrays.

    Args:
        func: a `@wp.func`, a builtin, a Python function or a lambda with its source in a file.
        inputs: arrays, at least one, and values that are the same for all elements. A Python float
            is a `float32`, an int an `int32`. Shapes broadcast as in NumPy.
        out: array for the result, or a list of arrays if `func` returns several values.
        return_kernel: return the kernel, whose parameters are the inputs and then the outputs, and
            do not run it.
        block_dim: CUDA threads per block.
        device: where to run; by default where the arrays are.

    Returns:
        The array of results, or a list of arrays if `func` returns several values.

    Example:
        >>> import warp as wp
        >>> a = wp.array([-1.0, 0.5, 3.0], dtype=float, device="cpu")
        >>> print(wp.map(wp.clamp, a, 0.0, 1.0))
        [0.  0.5 1. ]

    Raises:
        TypeError: `func` does not take elements of these types.
        ValueError: there is no array, or shapes do not fit together.
    """
    if not inputs:
        raise errors.WarpShapeError("map: expects at least one array", code="map-arrays")
    function, identity = function_of(func)
    arguments = ", ".join(f"x{i}" for i in range(len(inputs)))
    name = "map_" + getattr(function, "key", "function")
    return apply(
        name,
        f"function({arguments})",
        {"function": function},
        identity,
        [(_annotation(value), value) for value in inputs],
        out,
        return_kernel,
        block_dim,
        device,
    )


def apply(name, expression, names, identity, inputs, out, return_kernel, block_dim, device):
    """Evaluates an expression of `x0`, `x1`, ... for all elements.

    Args:
        name: of the kernel.
        names: what else the expression refers to.
        identity: hashable; stands for expression and names.
        inputs: (type, value) of each; None as the type of an array.
    """
    inputs = [(annotation, _gathered(value)) for annotation, value in inputs]
    arrays = [value for _, value in inputs if isinstance(value, array)]
    if not arrays:
        raise errors.WarpShapeError("map: expects at least one array", code="map-arrays")
    index = arrays[0].device_index if device is None else resolve_index(device)
    shape = _broadcast([found.shape for found in arrays])
    outputs = None if out is None else list(out) if isinstance(out, (list, tuple)) else [out]
    if any(isinstance(output, indexedarray) for output in outputs or ()):
        made = [_packed_like(output) for output in outputs]
        apply(name, expression, names, identity, inputs, made, False, block_dim, device)
        _scatter(outputs, made)
        return out
    values = [value for _, value in inputs]
    if outputs is not None:
        _check_arrays(outputs)
        values = [_separate(value, outputs) for value in values]
    rank = len(shape)
    flat = not return_kernel and rank > 1 and _all_packed([*arrays, *(outputs or ())], shape)
    if flat:
        rank = 1
    annotations = [
        ArrayType(value.dtype, rank) if annotation is None else annotation
        for annotation, value in inputs
    ]
    kernel, kinds = _kernel(name, expression, names, identity, annotations, rank)
    several = len(kinds) > 1
    if return_kernel:
        return kernel
    if outputs is None:
        outputs = _new_outputs(arrays, shape, kinds, by_index(index))
    _check_outputs(outputs, shape, kinds)
    extents = (math.prod(shape),) if flat else shape
    arguments = [_spread(value, extents) if isinstance(value, array) else value for value in values]
    targets = [output.reshape(extents) if flat else output for output in outputs]
    launch(kernel, extents, arguments, targets, device=by_index(index), block_dim=block_dim or 0)
    if out is not None:
        return out
    return outputs if several else outputs[0]


# Arguments.


def _annotation(value):
    """The kernel's type for an input; None for an array."""
    if isinstance(value, (array, indexedarray)):
        return None
    if isinstance(value, Composite):
        return canonical_class(type(value))
    if isinstance(value, (bool, int, float, scalar_base)) or dtypes.is_struct(type(value)):
        return dtypes.canonical(type(value))
    if hasattr(value, "dtype") and getattr(value, "shape", None) == ():
        return dtype_from_numpy(value.dtype)
    raise TypeError(f"map: expects arrays and values, but got '{type(value).__name__}'")


def _gathered(value):
    return value.contiguous() if isinstance(value, indexedarray) else value


def _scatter(outputs, made) -> None:
    for output, result in zip(outputs, made, strict=True):
        if output is not result:
            output.assign(result)


def _new_outputs(arrays, shape, kinds, device) -> list[array]:
    varies = any(found.requires_grad for found in arrays)
    return [
        empty(shape, dtype, device, requires_grad=varies and has_gradient(dtype)) for dtype in kinds
    ]


def _packed_like(output):
    return empty_like(output) if isinstance(output, indexedarray) else output


def _broadcast(shapes) -> tuple:
    rank = max(len(shape) for shape in shapes)
    result = [1] * rank
    for shape in shapes:
        for axis, extent in enumerate(shape, rank - len(shape)):
            if extent != 1 and result[axis] not in (1, extent):
                shown = ", ".join(str(found) for found in shapes)
                raise errors.WarpShapeError(
                    f"shapes {shown} do not broadcast to one shape",
                    code="broadcast",
                    facts={"shapes": " and ".join(str(one) for one in shapes)},
                )
            if extent != 1:
                result[axis] = extent
    return tuple(result)


def _spread(value, shape):
    """A view of an array with the extents of the result."""
    if value.shape == shape:
        return value
    if len(shape) == 1 and value.size == shape[0] and value.is_contiguous:
        return value.reshape(shape)
    missing = len(shape) - value.ndim
    strides = [0] * missing + [
        0 if extent == 1 else stride
        for extent, stride in zip(value.shape, value.strides, strict=True)
    ]
    view = value._view(0, shape, strides)
    return value._with_grad(view, lambda grad: _spread(grad, shape))


def _all_packed(arrays, shape) -> bool:
    return all(found.shape == shape and found.is_contiguous for found in arrays)


def _check_arrays(outputs) -> None:
    for output in outputs:
        if not isinstance(output, array):
            raise TypeError(f"map: expects arrays as `out`, but got '{type(output).__name__}'")
        output._check_writable("map")


def _check_outputs(outputs, shape, kinds) -> None:
    names = ", ".join(dtypes.type_repr(dtype) for dtype in kinds)
    if len(outputs) != len(kinds):
        raise errors.WarpOutputError(
            f"expects {len(kinds)} outputs of type {names}, but got {len(outputs)}",
            code="map-out-single" if len(outputs) == 1 else "map-out-count",
            facts={"shape": shape, "names": names, "wanted": len(kinds), "got": len(outputs)},
        )
    for i, (output, dtype) in enumerate(zip(outputs, kinds, strict=True)):
        which = f" {i}" if len(outputs) > 1 else ""
        if output.shape != shape:
            raise errors.WarpOutputError(
                f"expects output{which} of shape {shape}, but got {output.shape}",
                code="map-out-shape",
                facts={"which": which, "got": output.shape, "wanted": shape},
            )
        if output.dtype is not dtype:
            got, wanted = dtypes.type_repr(output.dtype), dtypes.type_repr(dtype)
            raise errors.WarpOutputError(
                f"expects output{which} of type '{wanted}', but got '{got}'",
                code="map-out-dtype",
                facts={"which": which, "got": got, "wanted": wanted},
            )


def _range(value) -> tuple[int, int]:
    """First and last byte of an array."""
    spans = (s * (n - 1) for n, s in zip(value.shape, value.strides, strict=True))
    start = value.ptr or 0
    return start, start + sum(spans) + value.item_size


def _separate(value, outputs):
    """The input itself, or a copy if elements of it would be overwritten before they are read."""
    if not isinstance(value, array) or not value.size:
        return value
    start, end = _range(value)
    for output in outputs:
        first, last = _range(output)
        same = (output.ptr, output.shape, output.strides) == (value.ptr, value.shape, value.strides)
        if start < last and first < end and not same and value.device_index == output.device_index:
            return clone(value)
    return value


# Kernels.


def _kernel(name, expression, names, identity, annotations, rank):
    """The kernel for these types, and the element types of its outputs."""
    key = (name, identity, rank, *annotations)
    found = _kernels.get(key)
    if found is None:
        from warp._src.frontend.build import types_of_local

        probe = _compile(name, expression, names, annotations, rank, None)
        try:
            natives = types_of_local(probe, name, "result")
        except errors.WarpCodegenError as problem:
            shown = ", ".join(_element_text(annotation) for annotation in annotations)
            problem.notes = (*problem.notes, f"in '{name}' for elements of {shown}")
            function = getattr(names.get("function"), "func", None)
            if hasattr(function, "__code__"):
                types = [_element_type(annotation) for annotation in annotations]
                problem.coded("map-function", function=function, types=types)
            raise
        kinds = [dtypes.dtype_of(native) for native in natives]
        function = _compile(name, expression, names, annotations, rank, kinds)
        found = _kernels[key] = Kernel(function, name, "warp.map"), kinds
    return found


def _element_type(annotation):
    return annotation.dtype if isinstance(annotation, ArrayType) else annotation


def _element_text(annotation) -> str:
    return f"'{dtypes.type_repr(_element_type(annotation))}'"


def _compile(name, expression, names, annotations, rank, kinds):
    """A Python function with the kernel's source; without outputs if `kinds` is None."""
    annotated = {f"a{i}": annotation for i, annotation in enumerate(annotations)}
    outputs = [ArrayType(dtype, rank) for dtype in kinds or ()]
    annotated |= {f"o{i}": annotation for i, annotation in enumerate(outputs)}
    where = ", ".join("ijkl"[:rank])
    lines = [f"def {name}({', '.join(annotated)}):", f"    {where} = wp.tid()"]
    for i, annotation in enumerate(annotations):
        element = f"a{i}[{where}]" if isinstance(annotation, ArrayType) else f"a{i}"
        lines.append(f"    x{i} = {element}")
    lines.append(f"    result = {expression}")
    if len(outputs) == 1:
        lines.append(f"    o0[{where}] = result")
    elif outputs:
        lines.append(f"    {', '.join(f'r{i}' for i in range(len(outputs)))} = result")
        lines += [f"    o{i}[{where}] = r{i}" for i in range(len(outputs))]
    function = define(name, "\n".join(lines) + "\n", {"wp": namespace, **names})
    function.__annotations__ = annotated
    return function


def _copy_elements(dest, src, stream=None) -> None:
    from warp._src.kernels.indexed_copies import copy_elements

    copy_elements(dest, src, stream)


hooks.apply = apply
hooks.copy_elements = _copy_elements
