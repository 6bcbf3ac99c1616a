"""Copies of arrays, indexed or not, on any devices.

Arrays are told by what their classes have, so that their methods may be written with this.
"""

from __future__ import annotations

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import ARRAY, COUNT
from warp._src.arguments import checked
from warp._src.arrays import hooks
from warp._src.arrays.allocation import allocate, new_array
from warp._src.arrays.layout import element_type
from warp._src.arrays.observers import Observers, observed_copy
from warp._src.devices import devices
from warp._src.types import dtypes


@checked(src=ARRAY)
def empty_like(src, device=None, requires_grad=None, pinned=None, retain_grad=False, dtype=None):
    """An array with shape and element type of `src` and undefined contents.

    Device, gradient and pinned memory are by default as of `src`; `retain_grad` as for `wp.array`.

    Raises:
        TypeError: `src` is no array.
    """
    if not dtypes.type_is_array(type(src)):
        raise TypeError(f"expects an array, but got '{type(src).__name__}'")
    where = src.device if device is None else devices.get_device(device)
    if requires_grad is None:
        requires_grad = src.requires_grad
    if pinned is None:
        pinned = src.pinned and where.is_cpu
    source = _plain(src)
    made = new_array(type(source))
    dtype = src.dtype if dtype is None else element_type(dtype)
    allocate(made, src.shape, dtype, where.index, pinned)
    if requires_grad:
        made.requires_grad = True
        made._wide_grad = dtype is src.dtype and source._wide_grad
    if retain_grad:
        made.retain_grad = True
    return made


def _plain(source):
    """An array itself, or that behind an indexed one."""
    return source if isinstance(source, _native.Array) else source.data


@checked(src=ARRAY)
def clone(src, device=None, requires_grad=None, pinned=None, retain_grad=False):
    """A contiguous copy, on the device of `src` unless another one is named."""
    result = empty_like(src, device, requires_grad, pinned, retain_grad)
    copy(result, src)
    return result


def assign(dest, src, whole=True) -> None:
    """Copies to an array, indexed or not, from one of the same shape or what can be made one.

    For two packed arrays it is enough that they have as many elements, or, unless `whole`, that
    `dest` has as many; what is left of it stays.

    Raises:
        ValueError: the shapes differ.
    """
    if not dtypes.type_is_array(type(src)):
        src = hooks.plain_array(src, dtype=dest.dtype, device="cpu", copy=False)
    fits = src.size == dest.size or (not whole and src.size < dest.size)
    if src.shape != dest.shape and not (fits and _both_packed(src, dest)):
        raise ValueError(f"expects shape {dest.shape} to assign, but got {src.shape}")
    copy(dest, src)


def _both_packed(*arrays) -> bool:
    return all(isinstance(one, _native.Array) and one.is_contiguous for one in arrays)


@checked(dest=ARRAY, src=ARRAY, dest_offset=COUNT, src_offset=COUNT)
def copy(dest, src, dest_offset=0, src_offset=0, count=0, stream=None) -> None:
    """Copies elements between arrays on any devices.

    Args:
        dest, src: arrays of equal shape, or of equal element size if offsets or count are given.
            With offsets or count, those that are indexed have one dimension.
        dest_offset, src_offset: first element to write and read.
        count: number of elements, 0 for all of `src`.
        stream: CUDA stream to use.

    Raises:
        ValueError: shapes, element sizes or ranges do not fit together.
    """
    for name, value in (("dest", dest), ("src", src)):
        if not dtypes.type_is_array(type(value)):
            raise TypeError(f"expects an array as '{name}', but got '{type(value).__name__}'")
    if dest_offset or src_offset or count:
        _check_range(dest_offset, src_offset, count)
    dest._check_writable("copy")
    if dest.item_size != src.item_size:
        raise errors.WarpShapeError(
            f"expects elements of equal size to copy, but got '{dtypes.type_repr(src.dtype)}' "
            f"({src.item_size} bytes) and '{dtypes.type_repr(dest.dtype)}' "
            f"({dest.item_size} bytes)",
            code="copy-size",
            facts={"dest": dtypes.type_repr(dest.dtype), "src": dtypes.type_repr(src.dtype)},
        )
    whole = not dest_offset and not src_offset and count in (0, src.size)
    if whole and dest.shape == src.shape:
        if src.size:
            _copy_all(dest, src, stream)
        return
    count = count or src.size - src_offset
    shapes = f"destination shape={dest.shape}, source shape={src.shape}"
    views = [
        _range(array, offset, count, name, shapes)
        for array, offset, name in ((dest, dest_offset, "dest"), (src, src_offset, "src"))
    ]
    if count:
        _copy_all(*views, stream)


def _check_range(dest_offset, src_offset, count) -> None:
    """Checks that offsets and count are whole numbers and not negative."""
    words = ("Destination offset", "Source offset", "count")
    for word, value in zip(words, (dest_offset, src_offset, count), strict=True):
        if not hasattr(value, "__index__"):
            raise errors.WarpTypeError(
                f"expects ints as offsets and count of a copy, but got {value!r}",
                code="copy-integers",
            )
        if value < 0:
            raise errors.WarpShapeError(
                f"negative offsets and counts of a copy are out of range, but got {value}",
                code="copy-negative",
                facts={"word": word},
            )


def _copy_all(dest, src, stream):
    if not (isinstance(dest, _native.Array) and isinstance(src, _native.Array)):
        hooks.copy_elements(dest, src, stream)
    elif Observers.active:
        observed_copy(dest, src, stream)
    else:
        _native.copy_array(dest, src, stream)


def _range(source, offset, count, name, shapes=""):
    """Elements offset .. offset+count of an array in row-major order, as a view."""
    if offset < 0 or count < 0 or offset + count > source.size:
        raise errors.WarpShapeError(
            f"elements {offset} to {offset + count} are out of range for '{name}' with "
            f"{source.size} elements",
            code="copy-range",
            facts={"side": "source" if name == "src" else "destination"},
        )
    if not isinstance(source, _native.Array):
        return source.part(offset, count, name)
    if source.ndim == 1:
        stride = source.strides[0]
    elif source.is_contiguous:
        stride = source.item_size
    else:
        raise errors.WarpShapeError(
            f"expects '{name}' to be contiguous or one-dimensional to copy a part of it; of arrays "
            "of one shape all is copied",
            code="copy-gaps",
            facts={"shapes": shapes},
        )
    part = source._view(offset * stride, (count,), (stride,))
    return source._with_grad(part, lambda grad: _range(grad, offset, count, name, shapes))
