"""Type factories and questions about types, under the names that users know."""

from warp._src.annotations import ArrayType
from warp._src.array import array
from warp._src.composites import Composite
from warp._src.constants import *  # noqa: F403
from warp._src.structs import StructInstance
from warp._src.types import *  # noqa: F403
