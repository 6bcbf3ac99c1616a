"""Volume queries of kernels, under public names: one overload for each type of values.

Functions of one type, such as `volume_sample_f`, are the same ones without the type as an argument.
"""

from warp._src.geometry.handles import publish
from warp._src.geometry.volumes import places, typed
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.dtypes import vec3d, vec3f, vec3i, vec4d, vec4f
from warp._src.types.scalars import float32, float64, int32, int64, uint32, uint64

# Values, their numbers, and how files name the type (layout.TYPES).
_FLOATS = (
    *((float32, float32, 1), (float64, float64, 2), (vec3f, float32, 6)),
    *((vec3d, float64, 7), (vec4f, float32, 17), (vec4d, float64, 18)),
)
_INTEGERS = ((int32, 4), (int64, 5), (uint32, 10))


def volume_lookup_index(id: uint64, i: int32, j: int32, k: int32) -> int32:
    """The number of a voxel, from 0; -1 if it has none."""
    return wp._library_call("warp_volume_index", id, i, j, k)


def _sample_integer(id: uint64, uvw: vec3f):
    return sample_integer(id, uvw, 0)


# The first forms of these functions.


def _sample_world(id: uint64, xyz: vec3f, sampling_mode: int32):
    return sample_single(id, to_index(id, xyz), sampling_mode)


def _lookup_voxel(id: uint64, ijk: vec3i):
    return lookup_single(id, ijk[0], ijk[1], ijk[2])


_made: dict = {}


def _add(name, function):
    made = getattr(function, "func", function)
    if name in _made:
        _made[name].add_overload(made)
    else:
        _made[name] = Function(made, name)
        _made[name].__name__ = name


def _add_lookups(value, scalar, number, suffix):
    lookup, lookup_typed, store, corners, fits = typed.lookups(value, scalar, number)
    _add("volume_lookup", lookup_typed)
    _add("volume_store", store)
    if suffix:
        _add("volume_lookup_" + suffix, lookup)
        _add("volume_store_" + suffix, store)
    return lookup, corners, fits


def _add_floats(value, scalar, number, suffix):
    lookup, corners, fits = _add_lookups(value, scalar, number, suffix)
    blend, sample, sample_typed = typed.interpolated(value, scalar, corners, fits, lookup)
    sample_grad, grad_typed = typed.with_gradient(value, scalar, sample, corners, fits, blend)
    _add("volume_sample", sample_typed)
    _add("volume_sample_grad", grad_typed)
    if suffix:
        _add("volume_sample_" + suffix, sample)
        _add("volume_sample_grad_" + suffix, sample_grad)
    element, nearest_element, _ = typed.indexed(value)
    corners = typed.indexed_corners(value, element)
    sample, sample_grad = typed.interpolated_index(value, scalar, corners, nearest_element)
    _add("volume_sample_index", sample)
    _add("volume_sample_grad_index", sample_grad)


for _value, _scalar, _number in _FLOATS:
    _add_floats(_value, _scalar, _number, {1: "f", 6: "v"}.get(_number))
for _value, _number in _INTEGERS:
    _lookup, *_rest = _add_lookups(_value, _value, _number, {4: "i"}.get(_number))
    _sample, _sample_typed = typed.closest(_value, _lookup)
    _add("volume_sample", _sample_typed)
    _add("volume_sample_index", typed.indexed(_value)[2])
    if _number == 4:
        sample_integer = _sample

del _made["volume_sample_grad_v"]
FUNCTIONS = {
    **places.FUNCTIONS,
    **_made,
    "volume_lookup_index": Function(volume_lookup_index),
    "volume_sample_i": Function(_sample_integer, "volume_sample_i"),
    "volume_sample_local": _made["volume_sample_f"],
    "volume_sample_world": Function(_sample_world, "volume_sample_world"),
    "volume_transform": places.FUNCTIONS["volume_index_to_world"],
    "volume_transform_inv": places.FUNCTIONS["volume_world_to_index"],
}
sample_single, lookup_single = _made["volume_sample_f"], _made["volume_lookup_f"]
to_index = places.FUNCTIONS["volume_world_to_index"]
_made["volume_lookup"].add_overload(_lookup_voxel)
publish(FUNCTIONS)
