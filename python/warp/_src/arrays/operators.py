"""Operators of arrays: `a + b`, `2.0 * a`, `a /= b`, `-a`.

They work on elements, with the meaning they have in kernels, and broadcast as in NumPy. Scalar
types do not mix; a Python number takes the scalar type of the array.
"""

from __future__ import annotations

from warp._src.arrays import hooks
from warp._src.types import dtypes, scalars
from warp._src.types.composites import Composite, canonical_class
from warp._src.types.numpy_types import dtype_from_numpy

# Attributes of arrays of other libraries.
_FOREIGN = ("__array_interface__", "__cuda_array_interface__", "__array__", "__dlpack__")


class ArrayArithmetic:
    """Mixin of `array`."""

    __slots__ = ()

    def __add__(self, other):
        return _binary("add", "+", self, other)

    def __radd__(self, other):
        return _binary("add", "+", self, other, swapped=True)

    def __iadd__(self, other):
        return _binary("add", "+", self, other, out=self)

    def __sub__(self, other):
        return _binary("sub", "-", self, other)

    def __rsub__(self, other):
        return _binary("sub", "-", self, other, swapped=True)

    def __isub__(self, other):
        return _binary("sub", "-", self, other, out=self)

    def __mul__(self, other):
        return _binary("mul", "*", self, other)

    def __rmul__(self, other):
        return _binary("mul", "*", self, other, swapped=True)

    def __imul__(self, other):
        return _binary("mul", "*", self, other, out=self)

    def __truediv__(self, other):
        return _binary("div", "/", self, other)

    def __rtruediv__(self, other):
        return _binary("div", "/", self, other, swapped=True)

    def __itruediv__(self, other):
        return _binary("div", "/", self, other, out=self)

    def __floordiv__(self, other):
        return _binary("floordiv", "//", self, other)

    def __rfloordiv__(self, other):
        return _binary("floordiv", "//", self, other, swapped=True)

    def __ifloordiv__(self, other):
        return _binary("floordiv", "//", self, other, out=self)

    def __mod__(self, other):
        return _binary("mod", "%", self, other)

    def __rmod__(self, other):
        return _binary("mod", "%", self, other, swapped=True)

    def __imod__(self, other):
        return _binary("mod", "%", self, other, out=self)

    def __pow__(self, other):
        return _binary("pow", "**", self, other)

    def __rpow__(self, other):
        return _binary("pow", "**", self, other, swapped=True)

    def __ipow__(self, other):
        return _binary("pow", "**", self, other, out=self)

    def __neg__(self):
        return _apply("neg", "-x0", [(None, self)], None)

    def __pos__(self):
        return _apply("pos", "+x0", [(None, self)], None)


def _binary(name, sign, own, value, swapped=False, out=None):
    other = _operand(own, value)
    if other is None and out is not None and any(hasattr(value, one) for one in _FOREIGN):
        # Its library would make another array, and the one that was to change would stay.
        raise TypeError(
            f"expects an array or a value to change an array in place by '{sign}=', but got "
            f"'{type(value).__name__}', use `wp.array(...)`"
        )
    if other is None:
        return NotImplemented
    operands = [other, (None, own)] if swapped else [(None, own), other]
    return _apply(name, f"x0 {sign} x1", operands, out)


def _apply(name, expression, operands, out):
    return hooks.apply(
        f"array_{name}", expression, {}, expression, operands, out, False, None, None
    )


def _operand(own, value):
    """(type, value) of the other operand; None if it is nothing to calculate with."""
    if dtypes.type_is_array(type(value)):
        return None, value
    if isinstance(value, Composite):
        return canonical_class(type(value)), value
    if isinstance(value, scalars.scalar_base):
        return dtypes.canonical(type(value)), value
    if isinstance(value, (int, float)):
        scalar = getattr(own.dtype, "_wp_scalar_type_", own.dtype)
        if dtypes.is_struct(scalar):
            return None
        if isinstance(value, float) and not issubclass(scalar, scalars.float_base):
            raise TypeError(
                f"expects operands of one type, but got an array of '{scalar.__name__}' and {value}"
            )
        return scalar, value
    if hasattr(value, "dtype") and getattr(value, "shape", None) == ():
        return dtype_from_numpy(value.dtype), value
    return None
