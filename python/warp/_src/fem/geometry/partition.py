"""Partitions of geometries - subsets of cells with their sides, and the whole."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import GeometryRecord, geometry_functions, per_device


@dataclass(frozen=True)
class PartitionRecord:
    """Facts of a partition that its functions of kernels depend on."""

    kind: str
    geometry: GeometryRecord

    @property
    def functions(self) -> SimpleNamespace:
        """Structs and functions of kernels."""
        return partition_functions(self)


@wp.func
def same_index(arg: Any, index: int):
    return index


_WholeCellArg = extend.struct_from_fields("WholeCellArg", {}, module=__name__)


@wp.func
def whole_cell_arg(side_arg: Any):
    return _WholeCellArg()


_MAKERS: dict = {}


@functools.cache
def partition_functions(record: PartitionRecord) -> SimpleNamespace:
    """Structs and functions of kernels of a partition: made once per record."""
    return _MAKERS[record.kind](record)


def _whole(record: PartitionRecord) -> SimpleNamespace:
    geometry = geometry_functions(record.geometry)
    return SimpleNamespace(
        CellArg=_WholeCellArg,
        SideArg=geometry.SideIndexArg,
        cell_index=same_index,
        partition_cell_index=same_index,
        side_index=same_index,
        boundary_side_index=geometry.boundary_side_index,
        frontier_side_index=same_index,
        side_to_cell_arg=whole_cell_arg,
    )


_MAKERS["whole"] = _whole


class GeometryPartition:
    """A subset of the cells of a geometry, with the sides that belong to it."""

    record: PartitionRecord

    def __init__(self, geometry):
        self.geometry = geometry

    def __getattr__(self, name):
        if name.startswith("_") or name in ("record", "geometry"):
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        functions = self.record.functions
        try:
            return getattr(functions, name)
        except AttributeError:
            text = f"{type(self).__name__!r} has no attribute {name!r}"
            raise AttributeError(text) from None

    @property
    def name(self) -> str:
        """Geometry and kind in one word."""
        return f"{self.geometry.name}_{type(self).__name__}"

    def __str__(self) -> str:
        return self.name

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


class WholeGeometryPartition(GeometryPartition):
    """All cells and sides of a geometry."""

    def __init__(self, geometry):
        super().__init__(geometry)
        self.record = PartitionRecord("whole", geometry.record)

    def __eq__(self, other) -> bool:
        return isinstance(other, WholeGeometryPartition) and self.geometry is other.geometry

    def __hash__(self) -> int:
        return hash(id(self.geometry))

    @property
    def name(self) -> str:
        """Name of the geometry."""
        return self.geometry.name

    def cell_count(self) -> int:
        """Number of cells."""
        return self.geometry.cell_count()

    def side_count(self) -> int:
        """Number of sides."""
        return self.geometry.side_count()

    def boundary_side_count(self) -> int:
        """Number of sides of the boundary."""
        return self.geometry.boundary_side_count()

    def frontier_side_count(self) -> int:
        """Number of sides between this and other partitions."""
        return 0

    def cell_arg_value(self, device=None):
        """Argument of the functions of cells."""
        return self.CellArg()

    def fill_cell_arg(self, arg, device) -> None:
        """Does nothing: there is nothing to fill."""

    def side_arg_value(self, device=None):
        """Argument of the functions of sides."""
        return self.geometry.side_index_arg_value(device)

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.geometry.fill_side_index_arg(arg, device)
