"""Volume queries of kernels, for one type of values.

A sample is made of the values of a cell's corners (cells.py says where these are), and its
derivative follows from the weights. Values of another type than the grid's are 0.
"""

# The caller reads the value that is assigned to a reference.
# ruff: noqa: F841

from typing import Any

from warp._src.geometry.volumes.cells import access
from warp._src.geometry.volumes.places import cell_of, nearest
from warp._src.kernels.function import Function
from warp._src.language import namespace as wp
from warp._src.types.annotations import ref
from warp._src.types.dtypes import matrix, type_size, vec3f, vector
from warp._src.types.native import ArrayType
from warp._src.types.scalars import int32, uint64

LINEAR = 1


def lookups(value, scalar, number):
    """`volume_lookup` and `volume_store` of values of a type, which files give a number.

    Also what gives the values of a cell's corners, if the grid fits, and what says so.
    """

    def _lookup(id: uint64, i: int32, j: int32, k: int32):
        result = value()
        if fits(id):
            result = at_place(grid(id), id, voxel(id, i, j, k))
        return result

    def _lookup_typed(id: uint64, i: int32, j: int32, k: int32, dtype: type[value]):
        return lookup(id, i, j, k)

    def _store(id: uint64, i: int32, j: int32, k: int32, given: value):
        if fits(id):
            put(id, voxel(id, i, j, k), given)

    def _corners(id: uint64, at: vec3f):
        places = wp._library_call(
            "warp_volume_cell", id, number, int(at[0]), int(at[1]), int(at[2])
        )
        return at_corners(grid(id), id, places)

    fits, grid, at_place, put, voxel = access(value, scalar, number)
    at_corners = of_corners(at_place)
    lookup = Function(_lookup, "volume_lookup")
    return lookup, _lookup_typed, _store, Function(_corners, "corners"), fits


def of_corners(read):
    """The result of `read` for each corner of a cell, of whatever it reads from."""

    def _of_corners(source: Any, other: Any, c: Any):
        return (
            read(source, other, c[0]),
            read(source, other, c[1]),
            read(source, other, c[2]),
            read(source, other, c[3]),
            read(source, other, c[4]),
            read(source, other, c[5]),
            read(source, other, c[6]),
            read(source, other, c[7]),
        )

    return Function(_of_corners, "of_corners")


def closest(value, lookup):
    """`volume_sample` of a type that is not interpolated."""

    def _sample(id: uint64, uvw: vec3f, sampling_mode: int32):
        at = nearest(uvw)
        return lookup(id, at[0], at[1], at[2])

    def _sample_typed(id: uint64, uvw: vec3f, sampling_mode: int32, dtype: type[value]):
        return sample(id, uvw, sampling_mode)

    sample = Function(_sample, "volume_sample")
    return sample, _sample_typed


def interpolated(value, scalar, corners, fits, lookup):
    """`volume_sample` of a type whose numbers are `scalar`."""

    def _sample(id: uint64, uvw: vec3f, sampling_mode: int32):
        result = value()
        if sampling_mode == LINEAR:
            if fits(id):
                cell, x, y, z = cell_of(uvw)
                result = blend(corners(id, cell), scalar(x), scalar(y), scalar(z))
        else:
            at = nearest(uvw)
            result = lookup(id, at[0], at[1], at[2])
        return result

    def _sample_typed(id: uint64, uvw: vec3f, sampling_mode: int32, dtype: type[value]):
        return sample(id, uvw, sampling_mode)

    blend = blending(scalar)
    sample = Function(_sample, "volume_sample")
    return blend, sample, _sample_typed


def blending(scalar):
    """The interpolation of a cell's eight values, z fastest, at a place in it."""
    one = scalar(1.0)

    def _blend(v: Any, x: scalar, y: scalar, z: scalar):
        low = (v[0] * (one - z) + v[1] * z) * (one - y) + (v[2] * (one - z) + v[3] * z) * y
        high = (v[4] * (one - z) + v[5] * z) * (one - y) + (v[6] * (one - z) + v[7] * z) * y
        return low * (one - x) + high * x

    return Function(_blend, "blend")


def slopes(scalar):
    """The derivatives of a blend along x, y and z."""
    one = scalar(1.0)

    def _slopes(v: Any, x: scalar, y: scalar, z: scalar):
        dx = ((v[4] - v[0]) * (one - z) + (v[5] - v[1]) * z) * (one - y) + (
            (v[6] - v[2]) * (one - z) + (v[7] - v[3]) * z
        ) * y
        dy = ((v[2] - v[0]) * (one - z) + (v[3] - v[1]) * z) * (one - x) + (
            (v[6] - v[4]) * (one - z) + (v[7] - v[5]) * z
        ) * x
        dz = ((v[1] - v[0]) * (one - y) + (v[3] - v[2]) * y) * (one - x) + (
            (v[5] - v[4]) * (one - y) + (v[7] - v[6]) * y
        ) * x
        return dx, dy, dz

    return Function(_slopes, "slopes")


def joining(value, scalar):
    """The type of a gradient, and the function that makes one of three slopes."""
    if value is scalar:
        gradient = vector(3, scalar)

        def _join(dx: value, dy: value, dz: value):
            return gradient(dx, dy, dz)

        return gradient, Function(_join, "join")
    length = type_size(value)
    gradient = matrix((length, 3), scalar)

    def _join(dx: value, dy: value, dz: value):
        result = gradient()
        for row in range(length):
            result[row, 0] = dx[row]
            result[row, 1] = dy[row]
            result[row, 2] = dz[row]
        return result

    return gradient, Function(_join, "join")


def with_gradient(value, scalar, sample, corners, fits, blend):
    """`volume_sample_grad` of a type, with and without the type as an argument."""
    gradient, join = joining(value, scalar)
    slope = slopes(scalar)

    def _both(id: uint64, uvw: vec3f, sampling_mode: int32):
        result = value()
        along = gradient()
        if sampling_mode == LINEAR:
            if fits(id):
                cell, x, y, z = cell_of(uvw)
                values = corners(id, cell)
                result = blend(values, scalar(x), scalar(y), scalar(z))
                dx, dy, dz = slope(values, scalar(x), scalar(y), scalar(z))
                along = join(dx, dy, dz)
        else:
            result = sample(id, uvw, sampling_mode)
        return result, along

    def _sample_grad(id: uint64, uvw: vec3f, sampling_mode: int32, grad: ref[gradient]):
        result, along = both(id, uvw, sampling_mode)
        grad = along
        return result

    def _sample_grad_typed(
        id: uint64, uvw: vec3f, sampling_mode: int32, grad: ref[gradient], dtype: type[value]
    ):
        result, along = both(id, uvw, sampling_mode)
        grad = along
        return result

    both = Function(_both, "volume_sample_grad")
    return _sample_grad, _sample_grad_typed


def indexed(value):
    """`volume_sample_index` of values that are not interpolated, and an element by its number."""

    def _element(data: ArrayType(value, 1), background: value, index: int32):
        result = background
        if index >= 0:
            result = data[index]
        return result

    def _nearest_element(id: uint64, uvw: vec3f, data: ArrayType(value, 1), background: value):
        at = nearest(uvw)
        index = wp._library_call("warp_volume_index", id, at)
        return element(data, background, index)

    def _sample(
        id: uint64,
        uvw: vec3f,
        sampling_mode: int32,
        voxel_data: ArrayType(value, 1),
        background: value,
    ):
        return nearest_element(id, uvw, voxel_data, background)

    element = Function(_element, "element")
    nearest_element = Function(_nearest_element, "nearest_element")
    return element, nearest_element, _sample


def indexed_corners(value, element):
    """The values of a cell's corners in an array of the caller."""

    def _corners(id: uint64, at: vec3f, data: ArrayType(value, 1), background: value):
        indices = wp._library_call("warp_volume_cell_index", id, int(at[0]), int(at[1]), int(at[2]))
        return at_corners(data, background, indices)

    at_corners = of_corners(element)
    return Function(_corners, "corners")


def interpolated_index(value, scalar, corners, nearest_element):
    """`volume_sample_index` and `volume_sample_grad_index` of values that are interpolated."""
    blend, slope = blending(scalar), slopes(scalar)
    gradient, join = joining(value, scalar)

    def _sample(
        id: uint64,
        uvw: vec3f,
        sampling_mode: int32,
        voxel_data: ArrayType(value, 1),
        background: value,
    ):
        result = value()
        if sampling_mode == LINEAR:
            cell, x, y, z = cell_of(uvw)
            values = corners(id, cell, voxel_data, background)
            result = blend(values, scalar(x), scalar(y), scalar(z))
        else:
            result = nearest_element(id, uvw, voxel_data, background)
        return result

    def _sample_grad(
        id: uint64,
        uvw: vec3f,
        sampling_mode: int32,
        voxel_data: ArrayType(value, 1),
        background: value,
        grad: ref[gradient],
    ):
        result = value()
        along = gradient()
        if sampling_mode == LINEAR:
            cell, x, y, z = cell_of(uvw)
            values = corners(id, cell, voxel_data, background)
            result = blend(values, scalar(x), scalar(y), scalar(z))
            dx, dy, dz = slope(values, scalar(x), scalar(y), scalar(z))
            along = join(dx, dy, dz)
        else:
            result = nearest_element(id, uvw, voxel_data, background)
        grad = along
        return result

    return _sample, _sample_grad
