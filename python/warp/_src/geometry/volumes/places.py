"""Points of index space: the nearest voxel, the cell around; and the way from and to the world."""

from warp._src.device_table import WORDS
from warp._src.geometry.handles import VOLUME, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec3d, vec3f
from warp._src.types.scalars import float64, int32, uint64

_GRID, _VOXELS = WORDS["Volume"]["grid"], WORDS["Volume"]["voxels"]
# Doubles of the grid's header.
_MATRIX, _INVERSE, _SHIFT = 48, 57, 66


def _nearest(uvw: vec3f):
    """Halves go away from zero."""
    return wp.vec3i(int(wp.round(uvw[0])), int(wp.round(uvw[1])), int(wp.round(uvw[2])))


def _cell_of(uvw: vec3f):
    """The lower corner of the cell of a point, and where in the cell it is."""
    cell = wp.vec3f(wp.floor(uvw[0]), wp.floor(uvw[1]), wp.floor(uvw[2]))
    return cell, uvw[0] - cell[0], uvw[1] - cell[1], uvw[2] - cell[2]


def _header(id: uint64):
    return wp.array(ptr=words(id, VOLUME)[_GRID], shape=84, dtype=float64)


def _turned(id: uint64, first: int32, v: vec3d):
    """A matrix of the header, which begins at a place, times a vector."""
    m = header(id)
    return wp.vec3d(
        m[first] * v[0] + m[first + 1] * v[1] + m[first + 2] * v[2],
        m[first + 3] * v[0] + m[first + 4] * v[1] + m[first + 5] * v[2],
        m[first + 6] * v[0] + m[first + 7] * v[1] + m[first + 8] * v[2],
    )


def _shift(id: uint64):
    m = header(id)
    return wp.vec3d(m[_SHIFT], m[_SHIFT + 1], m[_SHIFT + 2])


def _wide(v: vec3f):
    return wp.vec3d(float64(v[0]), float64(v[1]), float64(v[2]))


def _narrow(v: vec3d):
    return wp.vec3f(float(v[0]), float(v[1]), float(v[2]))


def volume_index_to_world(id: uint64, uvw: vec3d) -> vec3d:
    """The point of the world at a place in index space."""
    return turned(id, _MATRIX, uvw) + shift(id)


def volume_world_to_index(id: uint64, xyz: vec3d) -> vec3d:
    """The place in index space of a point of the world."""
    return turned(id, _INVERSE, xyz - shift(id))


def volume_index_to_world_dir(id: uint64, uvw: vec3d) -> vec3d:
    """The direction in the world of one in index space, with its length there."""
    return turned(id, _MATRIX, uvw)


def volume_world_to_index_dir(id: uint64, xyz: vec3d) -> vec3d:
    """The direction in index space of one in the world, with its length there."""
    return turned(id, _INVERSE, xyz)


def volume_voxel_count(id: uint64) -> int32:
    """How many numbers of voxels there are, for `volume_sample_index`."""
    return int(words(id, VOLUME)[_VOXELS])


def _index_to_world(id: uint64, uvw: vec3f) -> vec3f:
    return narrow(turned(id, _MATRIX, wide(uvw)) + shift(id))


def _world_to_index(id: uint64, xyz: vec3f) -> vec3f:
    return narrow(turned(id, _INVERSE, wide(xyz) - shift(id)))


def _index_to_world_dir(id: uint64, uvw: vec3f) -> vec3f:
    return narrow(turned(id, _MATRIX, wide(uvw)))


def _world_to_index_dir(id: uint64, xyz: vec3f) -> vec3f:
    return narrow(turned(id, _INVERSE, wide(xyz)))


nearest, cell_of = Function(_nearest, "nearest"), Function(_cell_of, "cell_of")
header, turned = Function(_header, "header"), Function(_turned, "turned")
shift, wide, narrow = (
    Function(_shift, "shift"),
    Function(_wide, "wide"),
    Function(_narrow, "narrow"),
)
FUNCTIONS = {"volume_voxel_count": Function(volume_voxel_count)}
for _double, _single in (
    (volume_index_to_world, _index_to_world),
    (volume_world_to_index, _world_to_index),
    (volume_index_to_world_dir, _index_to_world_dir),
    (volume_world_to_index_dir, _world_to_index_dir),
):
    FUNCTIONS[_double.__name__] = Function(_double)
    FUNCTIONS[_double.__name__].add_overload(_single)
