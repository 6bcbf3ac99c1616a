"""The arrays of a mesh in kernels."""

from warp._src.device_table import WORDS
from warp._src.geometry.handles import EXTENT, GRADIENTS, MESH, words
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec3f
from warp._src.types.native import ArrayType
from warp._src.types.scalars import int32, uint64

_POINTS, _VELOCITIES, _INDICES = (
    WORDS["Mesh"][name] for name in ("points", "velocities", "indices")
)
POINT_GRADIENTS, VELOCITY_GRADIENTS = _POINTS + GRADIENTS, _VELOCITIES + GRADIENTS
_POINT_COUNT, _VELOCITY_COUNT = _POINTS + EXTENT, _VELOCITIES + EXTENT
_INDEX_COUNT = _INDICES + EXTENT


def _array_vec3(address: uint64, gradients: uint64, count: uint64):
    extent = int(count & uint64(0xFFFFFFFF))
    return wp.array(ptr=address, shape=extent, dtype=vec3f, grad=gradients)


def _points(id: uint64):
    slot = words(id, MESH)
    return array_vec3(slot[_POINTS], slot[POINT_GRADIENTS], slot[_POINT_COUNT])


def _velocities(id: uint64):
    slot = words(id, MESH)
    return array_vec3(slot[_VELOCITIES], slot[VELOCITY_GRADIENTS], slot[_VELOCITY_COUNT])


def _indices(id: uint64):
    slot = words(id, MESH)
    extent = int(slot[_INDEX_COUNT] & uint64(0xFFFFFFFF))
    return wp.array(ptr=slot[_INDICES], shape=extent, dtype=int32)


def _corners(values: ArrayType(vec3f, 1), corners: ArrayType(int32, 1), face: int):
    a = wp.vec3f()
    b = wp.vec3f()
    c = wp.vec3f()
    if face >= 0 and 3 * face + 2 < len(corners):
        a = values[corners[3 * face]]
        b = values[corners[3 * face + 1]]
        c = values[corners[3 * face + 2]]
    return a, b, c


array_vec3 = Function(_array_vec3, "array_vec3")
points, velocities = Function(_points, "points"), Function(_velocities, "velocities")
indices, corners = Function(_indices, "indices"), Function(_corners, "corners")
