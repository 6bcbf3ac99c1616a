"""Gradients of arrays: when they get memory, their layout, and checks of those that users give.

An array that `requires_grad` has no gradient until somebody asks for it: the user, a backward pass,
another library. Then it is zero. Launches forward do not ask, and nor do views; code here asks with
`requires_grad` whether there is to be one, and with `grad_in_use` whether it may hold anything.

The gradient of an array has its type, its shape and its strides, so that one index leads to both.
Elements of 16 bits may have gradients of 32 instead (`grad_dtype`), with strides twice as large.
Kernels know only those: a launch of a derivative gets a wide copy of narrow gradients, adds to it
and rounds it once (`derivatives.wide_gradients`).
"""

from __future__ import annotations

import functools
import operator

from warp import _native
from warp._src import errors
from warp._src.argument_kinds import FLAG
from warp._src.arguments import checked
from warp._src.arrays import hooks
from warp._src.arrays.allocation import new_array
from warp._src.arrays.layout import element_type, type_id
from warp._src.forks import shared_lock
from warp._src.types import dtypes
from warp._src.types.native import ArrayType
from warp._src.types.scalars import uint8

# Two threads that ask at once get the same gradient.
_first_use = shared_lock()


class ArrayGradients:
    """Mixin of `array`.

    `_grad` is None before the first use. A view of an array whose gradient is still to come has in
    `_grad_source` that array, and what makes of its gradient that of the view. `any_retained` is
    false as long as no array has had `retain_grad`.
    """

    __slots__ = ()
    any_retained = False
    _grad = None
    _grad_source = None
    # True if components of 16 bits are to have a gradient of 32 when it is made.
    _wide_grad = False
    _requires_grad = False
    # The function that takes the gradient away at the end of another library's backward pass, if
    # any.
    passing = None
    # True if the memory is another library's to keep: derivatives use up gradients, and so it is
    # copied once the array becomes one.
    lent = False

    @checked(value=FLAG)
    def _set_requires_grad(self, value):
        if value:
            self._requires_grad = True
        else:
            self.grad = None

    # Read for each argument of a launch of an adjoint, so without a frame of Python.
    requires_grad = property(
        operator.attrgetter("_requires_grad"),
        _set_requires_grad,
        doc="True if derivatives are wanted; `grad` is allocated when it is first used.",
    )

    @property
    def retain_grad(self) -> bool:
        """True if `backward` leaves the gradient by the last contents in `grad`.

        Launches with `adjoint=True` leave the gradient of such an array as it is, if they only
        write the array.

        Raises:
            ValueError: it is set for an array without gradient.
        """
        return self._retain_grad

    @retain_grad.setter
    @checked(value=FLAG)
    def retain_grad(self, value):
        if value and not self._requires_grad:
            raise ValueError("retain_grad needs a gradient: set `requires_grad=True`, too")
        self._retain_grad = bool(value)
        ArrayGradients.any_retained |= self._retain_grad

    def _first_grad(self):
        """The gradient of an array that is to have one."""
        with _first_use:
            if self._grad is None:
                self.grad = self._make_grad()
        return self._grad

    def _set_grad(self, value):
        if value is not None:
            if getattr(value, "lent", False):
                take_memory(value, self)
            value = fitting_gradient(self, value)
        self._grad, self._grad_source = value, None
        self._requires_grad = value is not None
        self._retain_grad = self._retain_grad and value is not None
        self.grad_ptr = value.ptr or 0 if value is not None else 0

    grad = property(
        _native.gradient_of,
        _set_grad,
        doc="The array of derivatives, or None; zero when it is first read.\n\n"
        "Where components have 16 bits, one with 16 or with 32 can be set.",
    )

    @property
    def grad_in_use(self):
        """The gradient, or None if there is none or nothing can be in it but zeros.

        A captured conversion runs again when there may be something in it.
        """
        if self._grad is None and self._requires_grad:
            base, _ = self._grad_source or (None, None)
            known_zero = base is None or base.grad_in_use is None
            if known_zero and not _native.is_capturing(self.device_index):
                return None
        return self.grad

    def _make_grad(self):
        base, derive = self._grad_source or (None, None)
        if base is None or base.grad is None:
            return make_gradient(self)
        made = derive(base.grad)
        if base.passing is not None:
            base.passing.follow(self, made)
        return made

    def _with_grad(self, view, derive):
        """Gives a view the same view of the gradient."""
        if self._grad is not None and self.passing is None:
            view.grad = derive(self._grad)
        elif self._requires_grad:
            view._requires_grad, view._grad_source = True, (self, derive)
        view.retain_grad = self.retain_grad
        return view


@functools.cache
def gradient_type(dtype):
    """Element type of gradients as kernels have them, for an array with elements of `dtype`.

    It is `dtype`, but with 32 bits for those of 16.
    """
    if dtypes.is_struct(dtype):
        return dtype
    text = dtypes.native_text(dtype)
    wide = text.replace("bf16", "f32").replace("f16", "f32")
    return dtype if wide == text else dtypes.dtype_of(wide)


@functools.cache
def has_gradient(dtype) -> bool:
    """True if elements of this type have components with derivatives."""
    if dtypes.is_struct(dtype):
        return any(
            not isinstance(field, ArrayType) and has_gradient(field)
            for field in dtype._wp_fields_.values()
        )
    return getattr(dtype, "_wp_scalar_type_", dtype) in dtypes.FLOAT_TYPES


def has_wide_gradient(one) -> bool:
    """True if the gradient of an array has, or is going to have, twice its bits."""
    if one._grad is None:
        return one._wide_grad
    return one._grad.item_size != one.item_size


def wants_wide_gradient(dtype, wanted) -> bool:
    """True if the option `grad_dtype` asks for a wider type than that of the elements.

    Raises:
        TypeError: gradients cannot have elements of that type.
    """
    if wanted is None:
        return False
    wide = gradient_type(dtype)
    for found in (dtype, wide):
        scalar = getattr(found, "_wp_scalar_type_", found)
        if element_type(wanted) in (found, scalar):
            return found is not dtype
    expected = " or ".join(f"'{dtypes.type_repr(one)}'" for one in dict.fromkeys((dtype, wide)))
    raise TypeError(
        f"expects {expected} as `grad_dtype` of an array of "
        f"'{dtypes.type_repr(dtype)}', but got '{dtypes.type_repr(element_type(wanted))}'"
    )


def make_gradient(source):
    """Zeros with the layout of an array, for its gradient."""
    dtype = gradient_type(source.dtype) if source._wide_grad else source.dtype
    item_size = dtypes.type_size_in_bytes(dtype)
    strides = _gradient_strides(source, item_size)
    if source.is_contiguous or not source.size:
        made = _zeros(source, source.shape, dtype)
        if not source.size or made.strides == strides:
            return made
    below, above = 0, item_size
    for extent, stride in zip(source.shape, strides, strict=True):
        reach = stride * (extent - 1)
        below, above = below + min(reach, 0), above + max(reach, 0)
    memory = _zeros(source, above - below, uint8)
    made = new_array(hooks.plain_array)
    made._setup(
        (memory.ptr or 0) - below,
        source.shape,
        strides,
        dtype,
        type_id(dtype),
        item_size,
        source.device_index,
        memory,
        source.pinned,
    )
    return made


def take_memory(gradient, source) -> None:
    """Moves an array that is `lent` to a copy, laid out as the gradient of another array."""
    from warp._src.arrays.copies import clone, copy

    if gradient.shape == source.shape and gradient.dtype is source.dtype and not source._wide_grad:
        own = make_gradient(source)
        copy(own, gradient)
    else:
        own = clone(gradient, requires_grad=False)
    gradient._setup(
        own.ptr,
        own.shape,
        own.strides,
        own.dtype,
        type_id(own.dtype),
        own.item_size,
        own.device_index,
        own,
        own.pinned,
    )
    gradient.lent = False


def _zeros(neighbour, shape, dtype):
    """An array of zeros on the device of another one."""
    made = hooks.plain_array(
        shape=shape, dtype=dtype, device=neighbour.device, pinned=neighbour.pinned
    )
    # At once also while a graph is captured, which would clear the gradient in each run.
    if made.size:
        _native.clear_new_memory(made.ptr, made.device_index, made.capacity)
    return made


def _gradient_strides(source, item_size) -> tuple:
    return tuple(stride * item_size // source.item_size for stride in source.strides)


def fitting_gradient(source, value):
    """Checks an array that is to be the gradient of another one.

    Raises:
        ValueError: shape, element type, strides or device do not fit.
    """
    types = dict.fromkeys((source.dtype, gradient_type(source.dtype)))
    if not isinstance(value, _native.Array):
        raise ValueError(
            f"expects an array as the gradient of {source!r}, but got '{type(value).__name__}'"
        )
    if value.read_only:
        raise ValueError(
            f"expects a gradient of {source!r} that derivatives can be added to, but got a "
            "read-only array, use a copy: `wp.clone(a)`"
        )
    if value.shape != source.shape:
        raise errors.WarpShapeError(
            f"expects a gradient like {source!r}, that is of shape {source.shape}, "
            f"but got shape {value.shape}"
        )
    if value.dtype not in types and not any(dtypes.types_equal(value.dtype, one) for one in types):
        expected = " or ".join(f"'{dtypes.type_repr(one)}'" for one in types)
        raise ValueError(
            f"expects a gradient of {expected} for an array of "
            f"'{dtypes.type_repr(source.dtype)}', but got '{dtypes.type_repr(value.dtype)}'"
        )
    if value.device_index != source.device_index:
        raise ValueError(
            f"expects a gradient on '{source.device}' like the array, but got one on "
            f"'{value.device}', use `.to('{source.device}')`"
        )
    strides = _gradient_strides(source, value.item_size)
    steps = zip(source.shape, strides, value.strides, strict=True)
    if source.size and any(extent > 1 and ours != theirs for extent, ours, theirs in steps):
        raise errors.WarpShapeError(
            f"expects a gradient with strides {strides} like the array's, but got "
            f"{value.strides}, copy it to the one that `requires_grad = True` makes"
        )
    return value
