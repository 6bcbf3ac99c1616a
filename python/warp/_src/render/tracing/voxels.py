"""Grids of volumes: the box around their voxels and the largest value."""

import numpy as np

import warp as wp


def extent_of(volume, most):
    """The box around a grid's voxels in the world, and the largest value."""
    if volume.dtype != wp.float32:
        raise TypeError(f"expects a volume of floats, but got '{volume.dtype}'")
    voxels = volume.get_voxels().numpy()
    if len(voxels) == 0:
        raise ValueError("expects a volume with voxels, but got an empty one")
    low, high = voxels.min(axis=0) - 1, voxels.max(axis=0) + 1
    corners = np.stack(np.meshgrid(*np.stack([low, high]).T, indexing="ij"), -1).reshape(-1, 3)
    world = np.array([_to_world(volume, corner) for corner in corners])
    if most is None:
        most = _largest(volume, voxels)
    return world.min(axis=0), world.max(axis=0), float(most)


@wp.kernel(enable_backward=False)
def place_corner(id: wp.uint64, uvw: wp.vec3, out: wp.array(dtype=wp.vec3)):
    out[0] = wp.volume_index_to_world(id, uvw)


@wp.kernel(enable_backward=False)
def read_voxels(id: wp.uint64, ijk: wp.array(dtype=wp.vec3i), out: wp.array(dtype=float)):
    n = wp.tid()
    out[n] = wp.volume_lookup_f(id, ijk[n][0], ijk[n][1], ijk[n][2])


def _to_world(volume, corner):
    out = wp.zeros(1, dtype=wp.vec3, device=volume.device)
    inputs = [volume.id, wp.vec3(*map(float, corner))]
    wp.launch(place_corner, 1, inputs, [out], device=volume.device)
    return out.numpy()[0]


def _largest(volume, voxels):
    ijk = wp.array(voxels, dtype=wp.vec3i, device=volume.device)
    out = wp.zeros(len(voxels), dtype=float, device=volume.device)
    wp.launch(read_voxels, len(voxels), [volume.id, ijk], [out], device=volume.device)
    values = out.numpy()
    if not np.isfinite(values).all() or values.min() < 0.0:
        raise ValueError(
            f"expects finite densities of 0 or more, but got {values.min()} to {values.max()}"
        )
    return values.max()
