"""Type factories and questions about types, under the names that users know."""

from warp._src.arrays.array import array as array
from warp._src.types import numpy_types as _numpy_types
from warp._src.types.composites import Composite as Composite
from warp._src.types.constants import *  # noqa: F403
from warp._src.types.dtypes import *  # noqa: F403
from warp._src.types.matrices import composite_of_name as _composite_of_name
from warp._src.types.native import ArrayType as ArrayType
from warp._src.types.structs import StructInstance as StructInstance


def is_struct(x) -> bool:
    """True if `x` is an instance of a struct."""
    return isinstance(x, StructInstance)


def __getattr__(name):
    """`np_dtype_to_warp_type`, a table that needs NumPy, is made when it is asked for.

    Types that have no other name, such as `vec5f` and `mat4x12d`, are found for picklers."""
    found = _composite_of_name(name)
    if found is not None:
        return found
    if name != "np_dtype_to_warp_type":
        raise AttributeError(f"module 'warp.types' has no attribute '{name}'")
    globals()[name] = _numpy_types.scalar_types()
    return globals()[name]
