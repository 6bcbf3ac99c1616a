"""Right values for parameters by their names, so that calls get beyond the first check."""

import numpy as np
from support.argument_walk import objects
from support.argument_walk.values import anything

import warp as wp

_ARRAY = objects.floats
_INTS = lambda: objects.ints(0, 1, 2, 3)  # noqa: E731

# Parameters that are addresses or handles of memory: any number would be believed.
ADDRESSES = frozenset(
    ("ptr", "address", "handle", "ipc_handle", "cuda_stream", "cuda_event", "context", "ctx")
)

# Parameters that ask for work: large numbers of it are right, and take their time.
WORK = frozenset(("steps", "max_iterations", "max_passes", "max_iter", "maxiter"))

RIGHT = {
    "device warp_device target_device peer_device stream_or_device device_alias": lambda: "cpu",
    "dtype grad_dtype warp_dtype block_type value_type scalar_type": lambda: wp.float32,
    "shape dim dims launch_dims": lambda: 4,
    "kernel": lambda: objects.scale,
    "func function f forward_fn": lambda: objects.twice,
    "callback matvec adjoint closure pullback pushforward": lambda: anything,
    "inputs": lambda: [objects.floats(), 2.0],
    "outputs": list,
    "params": lambda: [objects.floats()],
    "grad gradients grads": lambda: [objects.floats()],
    "b x y z out in_array out_array src dest src_array dest_array": _ARRAY,
    "a A dest_matrix": objects.matrix,
    "values keys value array arr": _ARRAY,
    "rows columns row_offsets run_lengths indices": _INTS,
    "rows_of_blocks cols_of_blocks count size": lambda: 4,
    "points lowers uppers pos vertices": objects.corners,
    "radius alpha beta scale tol atol voxel_size threshold lr eps": lambda: 0.5,
    "nx ny nz dim_x dim_y dim_z": lambda: 4,
    "data": lambda: np.ones((4, 4), np.float32),
    "name key alias title message text": lambda: "walk",
    "tape": objects.RECIPES["Tape"],
    "graph": objects.RECIPES["Graph"],
    "mesh": objects.RECIPES["Mesh"],
    "module": objects.RECIPES["Module"],
    "path file filename file_path module_dir": lambda: "walk.file",
    "field": lambda: wp.zeros((4, 4, 4), dtype=float, device="cpu"),
    "length axis ndim index block_dim maxiter": lambda: 2,
}
RIGHT = {name: make for names, make in RIGHT.items() for name in names.split()}


def right(name: str):
    """A right value for a parameter of that name; None if none is known."""
    make = RIGHT.get(name)
    return None if make is None else make()
