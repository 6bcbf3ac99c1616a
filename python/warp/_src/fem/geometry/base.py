"""Geometry - cells and sides in space: record, functions of kernels, arguments per device."""

from __future__ import annotations

import functools
import typing
from dataclasses import dataclass, field
from types import SimpleNamespace

import warp as wp
from warp._src.fem.geometry.derived import add_derived, element_measure, element_normal
from warp._src.fem.geometry.shapes import SIDES, cell_of
from warp._src.fem.kept import Record
from warp._src.fem.types import coords_type, sample_type


class PerDevice(dict):
    """Values of devices, which mean nothing to other processes: pickles without them."""

    def __reduce__(self):
        return PerDevice, ()


def per_device(method):
    """Decorates a method of `device` whose value is kept per device until it is forgotten."""

    @functools.wraps(method)
    def kept(self, device=None):
        device = wp.get_device(device)
        if not self._keeps_arguments:
            return method(self, device)
        values = self.__dict__.setdefault("_per_device", PerDevice())
        key = (method.__name__, device.alias)
        if key not in values:
            values[key] = method(self, device)
        return values[key]

    return kept


def forget(owner, *names: str) -> None:
    """Drops the values that `per_device` methods of `owner` keep; all of them without names."""
    values = owner.__dict__.get("_per_device", {})
    for key in [key for key in values if not names or key[0] in names]:
        del values[key]


@dataclass(frozen=True)
class GeometryRecord(Record):
    """Facts of a geometry that its functions of kernels depend on.

    `kind` names the maker of functions, `cell` is the reference cell by name, `affine` says that
    the deformation gradient is constant in a cell, `environments` that there are several.
    """

    kind: str
    cell: str
    dimension: int
    scalar: type = field(default=wp.float32)
    affine: bool = True
    environments: bool = False
    base: object = None

    def make_functions(self) -> SimpleNamespace:
        """Makes the structs and functions of kernels of a geometry."""
        functions = MAKERS[self.kind](self)
        add_derived(self, functions)
        return functions


# Makers of functions of kernels by kind of geometry; modules of geometries add theirs.
MAKERS: dict = {}


def checked_scalar(scalar_type) -> type:
    """The scalar type of a geometry.

    Raises:
        ValueError: it is neither float32 nor float64.
    """
    if scalar_type not in (wp.float32, wp.float64):
        raise ValueError(f"'scalar_type' expects wp.float32 or wp.float64, but got {scalar_type!r}")
    return scalar_type


class RecordFunctions:
    """Base of objects whose functions of kernels are attributes: those of their `record`."""

    record: typing.Any
    # Arguments of kernels are kept per device until they are forgotten.
    _keeps_arguments = True

    def __str__(self) -> str:
        return self.name

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return self.record.functions

    def __getattr__(self, name):
        # Names that `functions` itself needs.
        own = ("record", "functions", "geometry", "geometry_partition")
        if name.startswith("_") or name in own or not hasattr(self.functions, name):
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return getattr(self.functions, name)


class ElementArguments(RecordFunctions):
    """Base of objects that fill the arguments of functions of cells and of sides."""

    @per_device
    def cell_arg_value(self, device):
        """Argument of the functions of cells."""
        arg = self.CellArg()
        self.fill_cell_arg(arg, device)
        return arg

    @per_device
    def side_arg_value(self, device):
        """Argument of the functions of sides."""
        arg = self.SideArg()
        self.fill_side_arg(arg, device)
        return arg


class Geometry(ElementArguments):
    """A set of cells and of the sides between them.

    Functions of kernels (`cell_position`, `side_normal`, ...) are attributes. They are those of
    the geometry's record, so geometries of one kind share them.
    """

    record: GeometryRecord
    is_rebuildable = False
    _environments = 1
    # Measure and normal by a deformation gradient, by the names that programs know.
    _element_measure, _element_normal = element_measure, element_normal

    @property
    def scalar_type(self) -> type:
        """Scalar type of positions and coordinates: `wp.float32` or `wp.float64`."""
        return self.record.scalar

    @property
    def coords_type(self) -> type:
        """Vector type of coordinates in elements."""
        return coords_type(self.record.scalar)

    @property
    def sample_type(self) -> type:
        """Struct type of samples."""
        return sample_type(self.record.scalar)

    @property
    def dimension(self) -> int:
        """Dimension of the space that holds the geometry."""
        return self.record.dimension

    @property
    def cell_dimension(self) -> int:
        """Dimension of a cell."""
        return self.cell.dimension

    @property
    def is_affine(self) -> bool:
        """The deformation gradient is constant in each cell."""
        return self.record.affine

    @property
    def cell(self):
        """Reference cell."""
        return cell_of(self.record.cell)

    @property
    def side_cell(self):
        """Reference cell of the sides."""
        return cell_of(SIDES[self.record.cell])

    def reference_cell(self):
        """Reference cell."""
        return self.cell

    def reference_side(self):
        """Reference cell of the sides."""
        return self.side_cell

    @property
    def base(self) -> Geometry:
        """The geometry whose topology this one has; mostly itself."""
        return self

    @property
    def name(self) -> str:
        """Class, environments and scalar type in one word."""
        name = type(self).__name__ + ("_env" if self.environment_count() > 1 else "")
        return name if self.scalar_type is wp.float32 else f"{name}_f64"

    def environment_count(self) -> int:
        """Number of topologically independent copies of space."""
        return self._environments

    @property
    def cell_env(self):
        """Environment of each cell, if cells name theirs."""
        return None

    def side_index_arg_value(self, device=None):
        """Argument of `boundary_side_index`."""
        return self.side_arg_value(device)

    def fill_side_index_arg(self, arg, device) -> None:
        """Fills an argument of `boundary_side_index`."""
        self.fill_side_arg(arg, device)

    def entities(self, device=None):
        """Edges and faces of a mesh; None if numbers follow from arithmetic."""
        return None

    def supports_cell_lookup(self, device=None) -> bool:
        """`lookup` works on a device."""
        return True

    def build_bvh(self, device=None) -> None:
        """Makes what `lookup` needs; nothing where cells are found by arithmetic."""

    def update_bvh(self, device=None) -> None:
        """Follows new positions; nothing where there are none."""

    def check(self, device=None):
        """Looks for cells that forms cannot be integrated on.

        Returns:
            A `warp.fem.geometry.GeometryReport` with numbers of cells: flat, inverted, folded, not
            finite, with repeated vertices, duplicates; and sides of more than two cells.
        """
        from warp._src.fem.geometry.check import check_geometry

        return check_geometry(self, device)
