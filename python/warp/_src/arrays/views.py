"""Views of arrays: indexing, slicing, reshaping, transposing, reinterpreting.

A view has its own descriptor over the same memory and keeps its base alive. If the base has a
gradient, so has the view: the same view of it. Bounds are strict, unlike those of Python's slices,
because an index out of bounds is a mistake more often than a wish.
"""

from __future__ import annotations

import itertools
import math
import operator
import typing

from warp._src import errors
from warp._src.argument_kinds import AXES
from warp._src.arguments import checked, shown
from warp._src.arrays import hooks
from warp._src.arrays.allocation import new_array
from warp._src.arrays.copies import assign, clone
from warp._src.arrays.gradients import gradient_type
from warp._src.arrays.layout import check_shape, element_type, type_id
from warp._src.types import dtypes
from warp._src.types.scalars import scalar_base


def _extents(shape) -> list:
    """A shape that `reshape` is given as a list of integers.

    Raises:
        TypeError: it is none.
    """
    try:
        if not isinstance(shape, (tuple, list)):
            return [operator.index(shape)]
    except TypeError:
        pass
    try:
        # One more than an array may have, of what may have no end.
        return list(map(operator.index, itertools.islice(shape, 5)))
    except TypeError:
        raise TypeError(
            f"reshape() expects an integer or a list of integers as `shape`, but got {shown(shape)}"
        ) from None


def _as_tuple(key):
    return key if isinstance(key, tuple) else (key,)


def _new_axes(key) -> list:
    """Places of new dimensions in the shape that a key leaves."""
    places, place = [], 0
    keys = _as_tuple(key)
    for index in keys:
        if index is None:
            places.append(place)
        place += index is None or isinstance(index, slice)
        if index is Ellipsis and None in keys:
            raise errors.WarpIndexError("expects `None` or `...` in an index, but got both")
    return places


class ArrayViews:
    """Mixin of `array`."""

    __slots__ = ()

    def _view(self, offset, shape, strides, dtype=None):
        dtype = dtype or self.dtype
        item_size = dtypes.type_size_in_bytes(dtype)
        result = new_array(type(self))
        result._setup(
            (self.ptr or 0) + offset,
            tuple(shape),
            tuple(strides),
            dtype,
            type_id(dtype),
            item_size,
            self.device_index,
            self,
            self.pinned,
        )
        if self.read_only:
            result._protect()
        if self.lent:
            result.lent = True
        return result

    def __getitem__(self, key) -> typing.Any:
        if _has_arrays(key):
            return hooks.select(self, key)
        offset, shape, strides = self._select(key)
        if not shape:
            # The element itself, which waits for a GPU.
            return self._view(offset, (1,), (self.item_size,)).list()[0]
        return self._with_grad(self._view(offset, shape, strides), lambda grad: grad[key])

    def __setitem__(self, key, value):
        target = self[key] if _has_arrays(key) else self._part(key)
        is_sequence = isinstance(value, (list, tuple)) and (
            not getattr(self.dtype, "_shape_", ())
            or any(isinstance(item, (list, tuple)) for item in value)
        )
        if is_sequence or getattr(value, "ndim", 0):
            assign(target, value)
        else:
            target.fill_(value)

    def _part(self, key):
        """The element or elements of a key, as an array."""
        offset, shape, strides = self._select(key)
        part = self._view(offset, shape or (1,), strides or (self.item_size,))

        def derive(grad):
            offset, _, steps = grad._select(key)
            return grad._view(offset, part.shape, steps or (grad.item_size,))

        return self._with_grad(part, derive)

    def __iter__(self):
        if self.ndim == 1:
            return iter(self.list())
        return (self[row] for row in range(self.shape[0]))

    def _one(self, what):
        """The only element.

        Raises:
            TypeError: there are more or none, or it is no number.
        """
        if self.size != 1 or not issubclass(self.dtype, scalar_base):
            raise TypeError(
                f"expects an array of one number for {what}, but got shape {self.shape} of "
                f"'{dtypes.type_repr(self.dtype)}'"
            )
        return self.list()[0]

    def __float__(self):
        return float(self._one("float()"))

    def __int__(self):
        return int(self._one("int()"))

    def __format__(self, spec):
        return format(self._one(f"the format '{spec}'"), spec) if spec else str(self)

    def _keys(self, key):
        """An index or slice for each dimension."""
        keys = [k for k in _as_tuple(key) if k is not None]
        if Ellipsis in [k for k in keys if k is Ellipsis]:
            place = next(i for i, k in enumerate(keys) if k is Ellipsis)
            missing = self.ndim - len(keys) + 1
            keys[place : place + 1] = [slice(None)] * missing
        if len(keys) > self.ndim:
            raise errors.WarpIndexError(
                f"expects at most {self.ndim} indices for an array of shape {self.shape}, "
                f"but got {len(keys)}"
            )
        return keys + [slice(None)] * (self.ndim - len(keys))

    def _select(self, key):
        """Byte offset, shape and strides of what a key names; None is a new dimension of one."""
        offset, shape, strides = 0, [], []
        added = _new_axes(key)
        for axis, (index, extent, stride) in enumerate(
            zip(self._keys(key), self.shape, self.strides, strict=True)
        ):
            if isinstance(index, slice):
                start, count, step = _resolve_slice(index, extent, axis)
                offset += start * stride
                shape.append(count)
                strides.append(stride * step)
            else:
                try:
                    index = operator.index(index)
                except TypeError:
                    raise TypeError(
                        f"expects integers and slices as indices, but got '{type(index).__name__}'"
                    ) from None
                offset += _resolve_index(index, extent, axis) * stride
        for place in added:
            shape.insert(place, 1)
            strides.insert(place, self.item_size)
        return offset, shape, strides

    def flatten(self):
        """The elements as a one-dimensional view; the array must be contiguous."""
        return self if self.ndim == 1 else self.reshape(self.size)

    def reshape(self, shape):
        """A view with other extents, one of which may be -1; the array must be contiguous.

        Raises:
            ValueError: the number of elements differs, or the array is not contiguous.
        """
        extents = _extents(shape)
        if extents.count(-1) == 1:
            rest = math.prod(extent for extent in extents if extent != -1)
            if rest and self.size % rest == 0:
                extents[extents.index(-1)] = self.size // rest
        if -1 in extents or math.prod(check_shape(extents)) != self.size:
            raise errors.WarpShapeError(
                f"cannot reshape an array of shape {self.shape} into {_shown(shape)}",
                code="reshape-size",
                facts={
                    "shape": self.shape,
                    "size": self.size,
                    "new_shape": tuple(extents),
                    "new_size": math.prod(extents),
                },
            )
        if not self.is_contiguous:
            raise errors.WarpShapeError(
                "cannot reshape an array that is not contiguous, use `a.contiguous()` before"
            )
        strides, step = [], self.item_size
        for extent in reversed(extents):
            strides.insert(0, step)
            step *= extent
        view = self._view(0, extents, strides)
        return self._with_grad(view, lambda grad: grad.reshape(tuple(extents)))

    @checked(axes=AXES)
    def transpose(self, axes=None):
        """A view with dimensions in another order, by default reversed."""
        order = (
            tuple(reversed(range(self.ndim))) if axes is None else tuple(itertools.islice(axes, 5))
        )
        if sorted(order) != list(range(self.ndim)):
            raise errors.WarpShapeError(
                f"expects a permutation of {tuple(range(self.ndim))} as axes, but got {order}"
            )
        shape = [self.shape[axis] for axis in order]
        strides = [self.strides[axis] for axis in order]
        return self._with_grad(self._view(0, shape, strides), lambda grad: grad.transpose(order))

    @property
    def is_transposed(self) -> bool:
        """True if the transposed view is contiguous and this one is not."""
        return not self.is_contiguous and self.transpose().is_contiguous

    def view(self, dtype):
        """The same memory as elements of another type.

        The new type has the same size, or is the scalar of the old one (which adds the inner
        dimensions), or a composite of it (which takes the inner dimensions away).
        """
        dtype = element_type(dtype)
        size = dtypes.type_size_in_bytes(dtype)
        shape, strides = list(self.shape), list(self.strides)
        if size != self.item_size:
            inner = getattr(self.dtype, "_shape_", ())
            taken = getattr(dtype, "_shape_", ())
            if inner and not taken and size * math.prod(inner) == self.item_size:
                step = self.item_size
                for extent in inner:
                    step //= extent
                    shape.append(extent)
                    strides.append(step)
            elif taken and self._inner_packed(taken) and self.item_size * math.prod(taken) == size:
                del shape[-len(taken) :], strides[-len(taken) :]
            else:
                raise errors.WarpTypeError(
                    f"cannot view elements of type '{dtypes.type_repr(self.dtype)}' "
                    f"({self.item_size} bytes) with shape {self.shape} as "
                    f"'{dtypes.type_repr(dtype)}' ({size} bytes)",
                    code="view-size",
                    facts={"source": self.dtype, "target": dtype},
                )
        if not shape:
            shape, strides = [1], [size]
        if len(shape) > 4:
            raise errors.WarpShapeError(f"expects 1 to 4 dimensions, but got {len(shape)}")
        view = self._view(0, shape, strides, dtype)
        if self.requires_grad and gradient_type(self.dtype) is not self.dtype:
            # Gradients of 16 bits may have 32; other types of 16 bits have none.
            wide = gradient_type(dtype)
            if wide is dtype:
                return view
            narrow = self.item_size
            return self._with_grad(
                view, lambda grad: grad.view(dtype if grad.item_size == narrow else wide)
            )
        return self._with_grad(view, lambda grad: grad.view(dtype))

    def _inner_packed(self, inner) -> bool:
        """True if the last dimensions have these extents and lie packed."""
        if self.shape[-len(inner) :] != tuple(inner):
            return False
        step = self.item_size
        for extent, stride in zip(reversed(inner), reversed(self.strides), strict=False):
            if stride != step:
                return False
            step *= extent
        return True

    def contiguous(self):
        """The array itself if it is packed in row-major order, else a packed copy."""
        if self.is_contiguous:
            return self
        return clone(self)


def _has_arrays(key) -> bool:
    """True if there are arrays of indices in a key."""
    keys = key if type(key) is tuple else (key,)
    return any(isinstance(one, ArrayViews) for one in keys)


def _resolve_index(index, extent, axis) -> int:
    if not -extent <= index < extent:
        raise errors.WarpIndexError(
            f"index {index} is out of bounds for dimension {axis} with extent {extent}"
        )
    return index % extent


def _resolve_slice(key, extent, axis):
    """First index, number of indices and step of a slice."""
    step = 1 if key.step is None else key.step.__index__()
    if step <= 0:
        kind = errors.WarpShapeError if step == 0 else errors.WarpIndexError
        raise kind(
            f"expects a positive step in a slice, but got {step}",
            code="slice-step" if step == 0 else None,
        )
    bounds = []
    for bound, default in ((key.start, 0), (key.stop, extent)):
        bound = default if bound is None else bound.__index__()
        if not -extent <= bound <= extent:
            raise errors.WarpIndexError(
                f"slice bound {bound} is out of bounds for dimension {axis} with extent {extent}"
            )
        bounds.append(bound + extent if bound < 0 else bound)
    start, stop = bounds
    return start, max(0, -(-(stop - start) // step)), step


def _shown(shape):
    return (shape,) if hasattr(shape, "__index__") else tuple(shape)
