"""Type factories and questions about types, under the names that users know."""

from warp._src.annotations import ArrayType as ArrayType
from warp._src.array import array as array
from warp._src.composites import Composite as Composite
from warp._src.constants import *  # noqa: F403
from warp._src.structs import StructInstance as StructInstance
from warp._src.types import *  # noqa: F403
