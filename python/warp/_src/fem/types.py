"""Types of arguments of kernels - samples, which are evaluation points, arrays, fields, domains."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

import warp as wp

Coords = wp.vec3
Coords_f64 = wp.vec3d
ElementIndex = int
QuadraturePointIndex = int
NodeIndex = int
DofIndex = wp.vec2i

# Numbers of elements, nodes and places; tables have a row per element.
Ints, IntTable = wp.array(dtype=wp.int32), wp.array2d(dtype=wp.int32)
Longs, Pairs = wp.array(dtype=wp.int64), wp.array(dtype=wp.vec2i)
Voxels, Levels = wp.array(dtype=wp.vec3i), wp.array(dtype=wp.uint8)
Vectors, AnyArray = wp.array(dtype=wp.vec3), wp.array(dtype=Any)

OUTSIDE = -1.0e8
NULL_ELEMENT_INDEX = wp.constant(-1)
NULL_QP_INDEX = wp.constant(-1)
NULL_NODE_INDEX = wp.constant((1 << 31) - 1)
NULL_DOF_INDEX = wp.constant(wp.vec2i(-1, -1))


class ElementKind(IntEnum):
    """Kind of the elements of a domain."""

    CELL = 0
    SIDE = 1


@wp.struct
class Sample:
    """A point of an element where an integrand is evaluated, in float32."""

    element_index: int
    element_coords: wp.vec3
    qp_index: int
    qp_weight: wp.float32
    test_dof: wp.vec2i
    trial_dof: wp.vec2i


@wp.struct
class Sample_f64:
    """A point of an element where an integrand is evaluated, in float64."""

    element_index: int
    element_coords: wp.vec3d
    qp_index: int
    qp_weight: wp.float64
    test_dof: wp.vec2i
    trial_dof: wp.vec2i


_COORDS = {wp.float32: Coords, wp.float64: Coords_f64}
_SAMPLES = {wp.float32: Sample, wp.float64: Sample_f64}


def coords_type(scalar: type) -> type:
    """The vector of element coordinates of a scalar type."""
    return _COORDS[scalar]


def sample_type(scalar: type) -> type:
    """The struct of samples of a scalar type."""
    return _SAMPLES[scalar]


@wp.func
def make_free_sample(element_index: int, element_coords: wp.vec3):
    """A sample that belongs to no quadrature point and no degree of freedom."""
    return Sample(element_index, element_coords, -1, 0.0, wp.vec2i(-1, -1), wp.vec2i(-1, -1))


@wp.func
def make_free_sample(element_index: int, element_coords: wp.vec3d):
    """A sample that belongs to no quadrature point and no degree of freedom."""
    return Sample_f64(
        element_index, element_coords, -1, wp.float64(0.0), wp.vec2i(-1, -1), wp.vec2i(-1, -1)
    )


class _Tag:
    """Base of annotations of parameters that take records alone."""

    is_open = True

    @staticmethod
    def fits(native) -> bool:
        """A value of a type of the compiler is no record."""
        return False


class Field(_Tag):
    """Annotation of a parameter that takes a field; base of all fields."""


class Domain(_Tag):
    """Annotation of a parameter that takes a domain; base of all domains."""
