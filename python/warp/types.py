"""Type factories and questions about types, under the names that users know."""

from warp._src.types.annotations import ArrayType as ArrayType
from warp._src.arrays.array import array as array
from warp._src.types.composites import Composite as Composite
from warp._src.types import dtypes as _dtypes
from warp._src.types.constants import *  # noqa: F403
from warp._src.types.structs import StructInstance as StructInstance
from warp._src.types.dtypes import *  # noqa: F403


def __getattr__(name):
    return getattr(_dtypes, name)
