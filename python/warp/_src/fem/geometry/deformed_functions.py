"""Functions of kernels of deformed geometries: the base's places, positions by a field."""

import functools
from types import SimpleNamespace
from typing import Any

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.curved import curved_functions
from warp._src.fem.geometry.derived import add_derived, of_gradient
from warp._src.fem.geometry.mesh_lookup import add_bvh_lookup
from warp._src.fem.geometry.shapes import DIMENSIONS, SIDES, cell_of
from warp._src.fem.kept import Functions
from warp._src.fem.types import Vectors, coords_type, make_free_sample, sample_type


def deformed_functions(record) -> SimpleNamespace:
    """The functions of kernels of a deformed geometry."""
    base_record, description, FieldArg, is_relative = record.base
    base = base_record.functions
    f = _structs(record, base, FieldArg)
    _add_positions(f, base, record, description, is_relative)
    _add_places(f, base)
    _add_sides(f, record)
    _add_lookup(f, record, description.degree)
    return f


def _structs(record, base, FieldArg) -> SimpleNamespace:
    boxes = dict.fromkeys(("box", "lowers", "uppers"), Vectors)
    fields = {"base": base.CellArg, "field": FieldArg, "bvh": wp.uint64, **boxes}
    CellArg = extend.struct_from_fields("DeformedCellArg", fields, module=__name__)
    fields = {"cell_arg": CellArg, "base": base.SideArg}
    SideArg = extend.struct_from_fields("DeformedSideArg", fields, module=__name__)
    return Functions(CellArg=CellArg, SideArg=SideArg, SideIndexArg=base.SideIndexArg)


def _add_positions(f, base, record, description, is_relative) -> None:
    Sample, CellArg = sample_type(record.scalar), f.CellArg
    field = description.evaluations(False)
    value, slope = field.inner, field.grad
    position, gradient = base.cell_position, base.cell_deformation_gradient
    kinds = getattr(description, "values", None)
    by_reference = hasattr(description, "reference") and hasattr(description, "nodes")
    by_reference = by_reference and kinds.map == "identity" and kinds.mapper is None
    reference = description.reference()[0].gradient if by_reference else None

    @f.add
    def cell_position(arg: CellArg, s: Sample):
        x = value(0, arg.field, arg.base, s)
        if wp.static(is_relative):
            x += position(arg.base, s)
        return x

    @f.add
    def cell_deformation_gradient(arg: CellArg, s: Sample):
        if wp.static(by_reference):
            F = reference(0, arg.field, arg.base, s)
            if wp.static(is_relative):
                F += gradient(arg.base, s)
            return F
        else:
            F = gradient(arg.base, s)
            if wp.static(is_relative):
                return F + slope(0, arg.field, arg.base, s) * F
            else:
                return slope(0, arg.field, arg.base, s) * F


# Functions that do not depend on positions: of an element, and of an element and coordinates.
_PLACES = {
    "cell_environment_index": 1,
    "side_environment_index": 1,
    "side_inner_cell_index": 1,
    "side_outer_cell_index": 1,
    "side_inner_cell_coords": 2,
    "side_outer_cell_coords": 2,
    "side_from_cell_coords": 3,
}


def _add_places(f, base) -> None:
    """Adds what does not depend on positions, from the base."""
    for name, count in _PLACES.items():
        setattr(f, name, _of_base(getattr(base, name), count))

    f.boundary_side_index = base.boundary_side_index


def _of_base(function, count: int) -> wp.Function:
    """A function of the argument's base and of `count` values more."""
    if count == 1:

        @wp.func
        def of_base(arg: Any, element: Any):
            return function(arg.base, element)

    elif count == 2:

        @wp.func
        def of_base(arg: Any, element: int, coords: Any):
            return function(arg.base, element, coords)

    else:

        @wp.func
        def of_base(arg: Any, side: int, cell: int, coords: Any):
            return function(arg.base, side, cell, coords)

    return of_base


def _add_sides(f, record) -> None:
    """Adds positions of sides by those of the inner cell."""
    real, cell = record.scalar, record.cell
    SideArg, Sample, Coords = f.SideArg, sample_type(real), coords_type(real)
    side = cell_of(SIDES[cell])
    # Points of a side whose differences are the axes of parameters.
    ends = np.vstack((np.zeros(side.dimension), np.eye(side.dimension)))
    corners = [Coords(*corner) for corner in side.coords(ends)]
    a, b, c = corners[0], corners[1], corners[-1]
    is_curve, shift = len(corners) == 2, 1 if cell == "triangle" else 0
    k = DIMENSIONS[cell]
    params = wp.types.vector(k, real)
    inner_cell, inner_coords = f.side_inner_cell_index, f.side_inner_cell_coords
    gradient = f.cell_deformation_gradient

    @wp.func
    def axis(arg: SideArg, side: int, end: Coords):
        """Parameters of the inner cell along an axis of the side."""
        d = inner_coords(arg, side, end) - inner_coords(arg, side, a)
        p = params()
        for i in range(k):
            p[i] = d[i + shift]
        return p

    @f.add
    def side_deformation_gradient(arg: SideArg, s: Sample):
        side = s.element_index
        inside = inner_coords(arg, side, s.element_coords)
        F = gradient(arg.cell_arg, make_free_sample(inner_cell(arg, side), inside))
        if wp.static(is_curve):
            return F * axis(arg, side, b)
        else:
            return wp.matrix_from_cols(F * axis(arg, side, b), F * axis(arg, side, c))

    normal_of = of_gradient(k - 1, k)[1]
    if k != record.dimension or normal_of is None:
        return
    zero, inside_of = real(0.0), params(real(1.0 / (k + 1)))

    @f.add
    def side_normal(arg: SideArg, s: Sample):
        """Normal out of the inner cell, which positions may mirror."""
        side = s.element_index
        corner = inner_coords(arg, side, a)
        away = params()
        for i in range(k):
            away[i] = corner[i + shift] - inside_of[i]
        F = gradient(
            arg.cell_arg,
            make_free_sample(inner_cell(arg, side), inner_coords(arg, side, s.element_coords)),
        )
        turn = wp.determinant(F)
        if wp.static(is_curve):
            along = axis(arg, side, b)
            turn *= wp.dot(normal_of(along), away)
            return normal_of(F * along) * wp.where(turn < zero, real(-1.0), real(1.0))
        else:
            across = wp.matrix_from_cols(axis(arg, side, b), axis(arg, side, c))
            turn *= wp.dot(normal_of(across), away)
            return normal_of(F * across) * wp.where(turn < zero, real(-1.0), real(1.0))


def _add_lookup(f, record, degree: int) -> None:
    real, d, cell, side = record.scalar, record.dimension, record.cell, SIDES[record.cell]
    add_derived(record, f)

    def of_kind(kind):
        names = ("position", "deformation_gradient", "inverse_deformation_gradient")
        return getattr(f, f"{kind.capitalize()}Arg"), *(getattr(f, f"{kind}_{n}") for n in names)

    f.cell_coordinates, f.cell_closest_point, contains = curved_functions(
        *of_kind("cell"), cell, d, real
    )
    f.cell_contains = contains if DIMENSIONS[cell] == d else None
    f.side_coordinates, f.side_closest_point, _ = curved_functions(*of_kind("side"), side, d, real)
    f.cell_bounds = _bounds(f, record, degree)
    add_bvh_lookup(f, record)


@functools.cache
def _bound_points(cell: str, degree: int) -> tuple:
    """Nodes of a cell, and by how much of their range polynomials exceed values there: half of
    the Lebesgue constant less one."""
    from warp._src.fem.cells.element import ElementBasis, make_element

    shape = cell_of(cell)
    element = make_element(shape, max(degree, 1), ElementBasis.LAGRANGE, None)
    steps = np.linspace(0.0, 1.0, 13 if shape.dimension == 3 else 33)
    grid = np.stack(np.meshgrid(*[steps] * shape.dimension), -1).reshape(-1, shape.dimension)
    if shape.is_simplex:
        grid = grid[grid.sum(axis=1) <= 1.0 + 1e-12]
    values, _ = element.tabulate(shape.coords(grid))
    largest = float(np.abs(values).sum(axis=1).max())
    return np.array(element.node_coords), 0.5 * (largest - 1.0)


def _bounds(f, record, degree: int) -> wp.Function:
    real, CellArg, position = record.scalar, f.CellArg, f.cell_position
    points, excess = _bound_points(record.cell, degree)
    n, table, Coords = len(points), points, coords_type(real)
    grow = real(1.05 * excess if degree > 1 else 0.0)

    @wp.func
    def point(k: int):
        return Coords(real(table[k, 0]), real(table[k, 1]), real(table[k, 2]))

    @wp.func
    def cell_bounds(arg: CellArg, cell: int):
        lower = position(arg, make_free_sample(cell, point(0)))
        upper = lower
        for k in range(1, n):
            x = position(arg, make_free_sample(cell, point(k)))
            lower = wp.min(lower, x)
            upper = wp.max(upper, x)
        pad = grow * (upper - lower)
        return lower - pad, upper + pad

    return cell_bounds
