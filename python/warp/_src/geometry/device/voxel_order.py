"""Puts the voxels of points in the order in which a grid of NanoVDB has them.

That is the order of their roots' coordinates, then of their places in upper nodes, in lower nodes
and in leaves: two stable sorts, as one key has not room for all. Where a node of a level begins
follows from neighbours in the order.
"""

from __future__ import annotations

from typing import Any

import warp as wp

_IN_ROOT, _ROOT = 36, 60
_LAST = wp.constant(wp.uint64(1 << _ROOT))
_INVALID = wp.constant(wp.uint32(16))


@wp.func
def _voxel_of(
    point: wp.vec3, inverse: wp.mat33d, shift: wp.vec3d, found: wp.array(dtype=wp.uint32)
):
    """The voxel around a point of the world, and whether there is one."""
    is_there = wp.isfinite(point)
    voxel = wp.vec3i()
    if is_there:
        p = wp.vec3d(wp.float64(point[0]), wp.float64(point[1]), wp.float64(point[2])) - shift
        at = inverse * p
        for axis in range(3):
            x = wp.floor(at[axis] + wp.float64(0.5))
            if wp.abs(x) < wp.float64(2147483648.0):
                voxel[axis] = int(x)
            else:
                is_there = False
                wp.atomic_or(found, 0, _INVALID)
    return voxel, is_there


@wp.func
def _voxel_of(
    point: wp.vec3i, inverse: wp.mat33d, shift: wp.vec3d, found: wp.array(dtype=wp.uint32)
):
    return point, True


@wp.func
def cell(v: wp.vec3i, shift: int, bits: int):
    """The place of a child in a node with 2^bits along each axis."""
    mask = (1 << bits) - 1
    x = (v[0] >> shift) & mask
    y = (v[1] >> shift) & mask
    z = (v[2] >> shift) & mask
    return (x << (2 * bits)) | (y << bits) | z


@wp.kernel(enable_backward=False, module="unique")
def _key_points(
    points: wp.array(dtype=Any),
    mask: wp.array(dtype=int),
    inverse: wp.mat33d,
    shift: wp.vec3d,
    of_tiles: bool,
    keys: wp.array(dtype=wp.uint64),
    order: wp.array(dtype=int),
    voxels: wp.array(dtype=wp.vec3i),
    roots: wp.array(dtype=wp.uint64),
    found: wp.array(dtype=wp.uint32),
    bounds: wp.array(dtype=int),
):
    """Voxels, or the lowest ones of their tiles; those that are left out have the last root."""
    i = wp.tid()
    v, is_there = _voxel_of(points[i], inverse, shift, found)
    if mask:
        is_there = is_there and mask[i] != 0
    root = _LAST
    if of_tiles:
        v = wp.vec3i(v[0] & ~7, v[1] & ~7, v[2] & ~7)
    if is_there:
        root = wp.uint64(0)
        for axis in range(3):
            root = (root << wp.uint64(20)) | wp.uint64((v[axis] >> 12) + 524288)
            wp.atomic_min(bounds, axis, v[axis] & ~7)
            wp.atomic_max(bounds, 3 + axis, v[axis] | 7)
    key = (wp.uint64(cell(v, 7, 5)) << wp.uint64(21)) | wp.uint64(
        (cell(v, 3, 4) << 9) | cell(v, 0, 3)
    )
    keys[i] = key
    roots[i] = root
    voxels[i] = v
    order[i] = i


@wp.kernel(enable_backward=False, module="unique")
def _take_roots(
    order: wp.array(dtype=int), roots: wp.array(dtype=wp.uint64), keys: wp.array(dtype=wp.uint64)
):
    i = wp.tid()
    keys[i] = roots[order[i]]


@wp.kernel(enable_backward=False, module="unique")
def _mark_first(
    keys: wp.array(dtype=wp.uint64),
    order: wp.array(dtype=int),
    voxels: wp.array(dtype=wp.vec3i),
    ends: wp.array(dtype=wp.vec4i),
):
    """True if a root, a lower node, a leaf and a voxel start at a place of the order."""
    i = wp.tid()
    firsts = wp.vec4i()
    if keys[i] != _LAST:
        firsts = wp.vec4i(1, 1, 1, 1)
        if i > 0 and keys[i - 1] == keys[i]:
            v = voxels[order[i]]
            u = voxels[order[i - 1]]
            differ = (u[0] ^ v[0]) | (u[1] ^ v[1]) | (u[2] ^ v[2])
            firsts = wp.vec4i(0, int((differ >> 7) != 0), int((differ >> 3) != 0), int(differ != 0))
    ends[i] = firsts


@wp.kernel(enable_backward=False, module="unique")
def _reset(found: wp.array(dtype=wp.uint32), bounds: wp.array(dtype=int)):
    found[0] = wp.uint32(0)
    for axis in range(3):
        bounds[axis] = 2147483647
        bounds[3 + axis] = -2147483648


class VoxelOrder:
    """Memory for the order of a number of points, on a device.

    Attributes:
        count: how many points.
        order, voxels: which point is where, and each one's voxel.
        ends: of each place of the order how many roots, lower nodes, leaves and voxels have begun.
        found: 16 in its one element if a point was outside of index space.
        bounds: the least and the greatest voxel of all leaves.
    """

    def __init__(self, count, device):
        self.count, self.device = count, device

        def empty(size, dtype):
            return wp.empty(size, dtype=dtype, device=device)

        self._keys, self.order = empty(2 * count, wp.uint64), empty(2 * count, int)
        self._roots, self.voxels = empty(count, wp.uint64), empty(count, wp.vec3i)
        self.ends = empty(count, wp.vec4i)
        self.found, self.bounds = empty(1, wp.uint32), empty(6, int)

    def run(self, points, mask, recipe) -> None:
        """Orders points, of vec3i in index space or of vec3 in the world.

        recipe: an `allocation.Recipe`.
        """
        device, count = self.device, self.count
        _, shift = recipe.transform
        inverse, shift = wp.mat33d(*recipe.native.inverse), wp.vec3d(*shift)
        of_tiles = recipe.kind == "tiles"
        wp.launch(_reset, 1, inputs=[self.found, self.bounds], device=device)
        given = [points, mask, inverse, shift, of_tiles, self._keys, self.order]
        made = [self.voxels, self._roots, self.found, self.bounds]
        wp.launch(_key_points, count, inputs=[*given, *made], device=device)
        wp.utils.radix_sort_pairs(self._keys, self.order, count, 0, _IN_ROOT)
        wp.launch(_take_roots, count, inputs=[self.order, self._roots, self._keys], device=device)
        wp.utils.radix_sort_pairs(self._keys, self.order, count, 0, _ROOT + 1)
        given = [self._keys, self.order, self.voxels, self.ends]
        wp.launch(_mark_first, count, inputs=given, device=device)
        wp.utils.array_scan(self.ends, self.ends, inclusive=True)

    def capacities(self, recipe):
        """Leaves, lower nodes, upper nodes and voxels of a recipe's grid; waits for the order.

        None if there are none, or a point was outside of index space.
        """
        roots, lowers, leaves, voxels = (int(n) for n in self.ends[self.count - 1 :].numpy()[0])
        if not leaves or int(self.found.numpy()[0]):
            return None
        return leaves, lowers, roots, 512 * leaves if recipe.kind == "tiles" else voxels
