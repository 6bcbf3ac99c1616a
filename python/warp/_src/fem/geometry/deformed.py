"""Deformed geometries - positions moved, or given, by a field over a geometry."""

from __future__ import annotations

from dataclasses import replace

from warp import extend
from warp._src.fem.domains import Cells
from warp._src.fem.geometry.base import MAKERS, Geometry
from warp._src.fem.geometry.deformed_functions import deformed_functions
from warp._src.fem.geometry.hierarchy import HasHierarchy

MAKERS["deformed"] = deformed_functions


_OF_BASE = ("res", "strides", "positions", "cell_vertices", "cell_count", "vertex_count")
_OF_BASE += ("edge_count", "side_count", "boundary_side_count")


class DeformedGeometry(HasHierarchy, Geometry):
    """The cells of a geometry at other positions.

    Args:
        field: displacements, or positions if not `relative`, of any space; its values can change.
        relative: positions are those of the geometry plus the field.
        build_bvh: `build_bvh` at once, as `lookup` needs it.

    Raises:
        ValueError: the field's values are no vectors of the geometry's dimension, or have no
            gradient.
    """

    # Arguments hold the values of the field, which can be another array at any time.
    _keeps_arguments = False

    def __init__(self, field, relative: bool = True, build_bvh: bool = False):
        base, dtype = field.geometry.base, field.dtype
        if not extend.type_is_vector(dtype) or dtype._length_ != base.dimension:
            raise ValueError(
                f"'field' expects values of vec{base.dimension}, as positions are, but got "
                f"{extend.type_repr(dtype)}"
            )
        if extend.type_scalar_type(dtype) is not base.scalar_type:
            raise ValueError(
                f"'field' expects values of {extend.type_repr(base.scalar_type)}, as positions "
                f"are, but got {extend.type_repr(dtype)}"
            )
        if field.kind != "cells":
            raise ValueError("'field' expects values in cells, but got a trace")
        if not field.gradient_valid():
            raise ValueError(
                "'field' expects a field with a gradient, as cells have one, but got one without; "
                "implicit fields have it by 'grad_func=True'"
            )
        self.field, self.relative, self._base = field, bool(relative), base
        description = field.bind(Cells(base).record)
        made = (base.record, description, field.ArgType, self.relative)
        self.record = replace(base.record, kind="deformed", affine=False, base=made)
        if build_bvh:
            self.build_bvh(getattr(getattr(field, "dof_values", None), "device", None))

    def __reduce__(self):
        # The record describes the field by types that only this process has.
        made = type(self), (self.field, self.relative)
        return *made, {"_hierarchies": self._built}

    @property
    def base(self) -> Geometry:
        """The geometry that is deformed."""
        return self._base

    @property
    def name(self) -> str:
        """The base's name, and how the field counts."""
        return f"Deformed{self._base.name}_{'rel' if self.relative else 'abs'}"

    def __getattr__(self, name):
        # Counts and tables of the base, such as the resolution of a grid.
        if name in _OF_BASE:
            return getattr(self._base, name)
        return super().__getattr__(name)

    def environment_count(self) -> int:
        """Number of environments."""
        return self._base.environment_count()

    @property
    def cell_env(self):
        """Environment of each cell, if cells name theirs."""
        return self._base.cell_env

    def entities(self, device=None):
        """Edges and faces of the base."""
        return self._base.entities(device)

    def side_index_arg_value(self, device=None):
        """Argument of `boundary_side_index`."""
        return self._base.side_index_arg_value(device)

    def fill_side_index_arg(self, arg, device) -> None:
        """Fills an argument of `boundary_side_index`."""
        self._base.fill_side_index_arg(arg, device)

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.base = self._base.cell_arg_value(device)
        arg.field = self.field.arg_value(device)
        self._fill_hierarchy(arg, device)

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.fill_cell_arg(arg.cell_arg, device)
        arg.base = self._base.side_arg_value(device)
