"""Functions and kernels that are made once."""

from warp._src.fem.cache import dynamic_func as dynamic_func
from warp._src.fem.cache import dynamic_kernel as dynamic_kernel
