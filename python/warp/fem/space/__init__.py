"""Classes of function spaces, and of shape functions in `shape`."""

from warp._src.fem.spaces.space import CollocatedFunctionSpace as CollocatedFunctionSpace
from warp._src.fem.spaces.space import ContravariantFunctionSpace as ContravariantFunctionSpace
from warp._src.fem.spaces.space import CovariantFunctionSpace as CovariantFunctionSpace
from warp.fem.space import shape as shape
