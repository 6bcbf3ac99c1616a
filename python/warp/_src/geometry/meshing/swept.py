"""`swept_volume_mesh` and its parts: what rigid meshes cover in a sequence of poses.

A point is asked for its distance to each mesh in each pose, moved back into the mesh's own
coordinates; the least one is the distance to all of them. Between poses nothing is assumed.
"""

from __future__ import annotations

import enum

import warp as wp
from warp._src.argument_kinds import MESHES, NUMBER, POINT, POSITIVE, TRANSFORMS
from warp._src.arguments import checked
from warp._src.geometry.meshing.sweeps import Sweep, SweepGrid
from warp._src.geometry.surfaces.marching_cubes import IsoSurfaceMarchingCubes
from warp._src.kernels.function import func


class SweptVolumeSignMode(enum.IntEnum):
    """How the side of a mesh is found: by which function of kernels.

    NORMAL: `mesh_query_point_sign_normal`. WINDING_NUMBER:
    `mesh_query_point_sign_winding_number`, for meshes made with `support_winding_number=True`.
    PARITY: `mesh_query_point_sign_parity`. NO_SIGN: none, all distances are positive.
    """

    NORMAL = 0
    WINDING_NUMBER = 1
    PARITY = 2
    NO_SIGN = 3


@func
def swept_volume_sdf(
    point: wp.vec3,
    mesh_ids: wp.array(dtype=wp.uint64),
    transforms: wp.array2d(dtype=wp.transform),
    max_dist: float,
    sign_mode: int,
) -> float:
    """The distance of a point from meshes in all their poses, negative inside of one.

    Inside it is that to the surface of one of them, not to the surface of all. It has no
    derivative by what decides the side.

    point: in the world.
    mesh_ids: of the meshes.
    transforms: of shape (meshes, poses), from the coordinates of a mesh to the world; rigid.
    max_dist: how far to look; what is not found is outside at that distance.
    sign_mode: a `SweptVolumeSignMode`.
    """
    least = float(max_dist)
    for m in range(mesh_ids.shape[0]):
        mesh = mesh_ids[m]
        for pose in range(transforms.shape[1]):
            p = wp.transform_point(wp.transform_inverse(transforms[m, pose]), point)
            face = int(-1)
            u = float(0.0)
            v = float(0.0)
            side = float(1.0)
            found = bool(False)
            if sign_mode == 1:
                found = wp.mesh_query_point_sign_winding_number(mesh, p, max_dist, side, face, u, v)
            elif sign_mode == 2:
                found = wp.mesh_query_point_sign_parity(mesh, p, max_dist, side, face, u, v)
            elif sign_mode == 3:
                found = wp.mesh_query_point_no_sign(mesh, p, least, face, u, v)
            else:
                found = wp.mesh_query_point_sign_normal(mesh, p, max_dist, side, face, u, v)
            if found:
                at = wp.mesh_eval_position(mesh, face, u, v)
                least = wp.min(least, side * wp.length(p - at))
    return least


@wp.kernel(enable_backward=False, module="unique")
def _fill_field(
    mesh_ids: wp.array(dtype=wp.uint64),
    transforms: wp.array2d(dtype=wp.transform),
    lower: wp.vec3,
    spacing: wp.vec3,
    max_dist: float,
    sign_mode: int,
    field: wp.array3d(dtype=float),
):
    i, j, k = wp.tid()
    point = lower + wp.cw_mul(spacing, wp.vec3(float(i), float(j), float(k)))
    field[i, j, k] = swept_volume_sdf(point, mesh_ids, transforms, max_dist, sign_mode)


@checked(meshes=MESHES, transforms=TRANSFORMS, padding=NUMBER)
def swept_volume_bounds(meshes, transforms, padding=0.0, device=None):
    """The least box, along the axes, around the boxes of meshes in all their poses.

    Args:
        meshes: `Mesh` objects.
        transforms: their poses, an array of `transform` of shape (meshes, poses), or numbers of
            shape (meshes, poses, 7): position, then quaternion x, y, z, w. They are rigid.
        padding: how much the box grows on each side.
        device: where to compute; by default where the meshes are.

    Returns:
        Its least and its greatest corner, each a vec3.

    Raises:
        ValueError: there are no meshes, no vertices or no poses, not a row for each mesh, or a mesh
            is on another device.
        TypeError: the array is of another type.
    """
    low, high = Sweep(meshes, transforms, device).bounds()
    return wp.vec3(*(low - padding)), wp.vec3(*(high + padding))


def _field(sweep, grid, sign_mode):
    if sign_mode == SweptVolumeSignMode.WINDING_NUMBER:
        for i, mesh in enumerate(sweep.meshes):
            if not mesh.support_winding_number:
                raise ValueError(
                    f"meshes[{i}] was made without `support_winding_number=True`; make it so, or "
                    "choose another 'sign_mode'"
                )
    ids = wp.array([mesh.id for mesh in sweep.meshes], dtype=wp.uint64, device=sweep.device)
    field = wp.empty(grid.shape, dtype=float, device=sweep.device)
    place = [wp.vec3(*grid.lower), wp.vec3(*grid.spacing), grid.reach, int(sign_mode), field]
    given = [ids, sweep.transforms, *place]
    wp.launch(_fill_field, grid.shape, inputs=given, device=sweep.device)
    return field


@checked(meshes=MESHES, transforms=TRANSFORMS, voxel_size=POSITIVE, lower=POINT, upper=POINT)
def swept_volume_field(
    meshes,
    transforms,
    voxel_size=None,
    *,
    resolution=None,
    lower=None,
    upper=None,
    sign_mode=SweptVolumeSignMode.WINDING_NUMBER,
    device=None,
):
    """Distances from meshes in all their poses, on a grid; negative inside of one.

    Args:
        meshes, transforms, device: as for `swept_volume_bounds`.
        voxel_size: the edge of a cell; the grid is two cells or more wider than the bounds.
        resolution: in its place, nodes along each axis.
        lower, upper: where the first and the last node are, for a `resolution`; by default two
            cells beyond the bounds.
        sign_mode: how the side is found.

    Returns:
        A float32 array of three dimensions, and where its first and its last node are.

    Raises:
        ValueError: as for `swept_volume_bounds`; or the grid is not described as above, or a mesh
            was made without what `sign_mode` needs.
        TypeError: the array of poses is of another type.
    """
    sweep = Sweep(meshes, transforms, device)
    grid = SweepGrid(sweep, voxel_size, resolution, lower, upper, 0.0)
    field = _field(sweep, grid, sign_mode)
    return field, wp.vec3(*grid.lower), wp.vec3(*grid.upper)


@checked(meshes=MESHES, transforms=TRANSFORMS, voxel_size=POSITIVE, lower=POINT, upper=POINT)
def swept_volume_mesh(
    meshes,
    transforms,
    voxel_size=None,
    *,
    resolution=None,
    lower=None,
    upper=None,
    threshold=0.0,
    sign_mode=SweptVolumeSignMode.WINDING_NUMBER,
    device=None,
):
    """The surface around everything that meshes cover in their poses, as triangles.

    It is that of `swept_volume_field` at a distance. On the grid it encloses all poses for sure if
    `threshold` is more than half of a cell's diagonal.

    Args:
        meshes, transforms, voxel_size, resolution, lower, upper, sign_mode, device: as for
            `swept_volume_field`; the grid is wider by the threshold.
        threshold: the distance.

    Returns:
        Vertices, an array of vec3, and an array of int32 with three of them per triangle. Seen from
        outside they go counter-clockwise.

    Raises:
        ValueError: as for `swept_volume_field`; or the threshold is not positive where distances
            have no sign.
        TypeError: the array of poses is of another type.
    """
    if sign_mode == SweptVolumeSignMode.NO_SIGN and not threshold > 0.0:
        raise ValueError(f"expects threshold > 0 where distances have no sign, but got {threshold}")
    sweep = Sweep(meshes, transforms, device)
    grid = SweepGrid(sweep, voxel_size, resolution, lower, upper, max(float(threshold), 0.0))
    field = _field(sweep, grid, sign_mode)
    return IsoSurfaceMarchingCubes.extract(
        field, threshold, lower=wp.vec3(*grid.lower), upper=wp.vec3(*grid.upper)
    )
