"""Partitions of geometries - subsets of cells with their sides, and the whole."""

import functools
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import (
    ElementArguments,
    GeometryRecord,
    forget,
)
from warp._src.fem.geometry.indices import masked_indices
from warp._src.fem.kept import Functions, Record
from warp._src.fem.types import Ints


@dataclass(frozen=True)
class PartitionRecord(Record):
    """Facts of a partition that its functions of kernels depend on."""

    kind: str
    geometry: GeometryRecord

    def make_functions(self) -> SimpleNamespace:
        """Makes the structs and functions of kernels of a partition."""
        return _MAKERS[self.kind](self)


@wp.func
def same_index(arg: Any, index: int):
    return index


_WholeCellArg = extend.struct_from_fields("WholeCellArg", {}, module=__name__)


@wp.func
def whole_cell_arg(side_arg: Any):
    return _WholeCellArg()


def _whole(record: PartitionRecord) -> SimpleNamespace:
    geometry = record.geometry.functions
    return Functions(
        CellArg=_WholeCellArg,
        SideArg=geometry.SideIndexArg,
        cell_index=same_index,
        partition_cell_index=same_index,
        side_index=same_index,
        boundary_side_index=geometry.boundary_side_index,
        frontier_side_index=same_index,
        side_to_cell_arg=whole_cell_arg,
    )


def _listed(record: PartitionRecord) -> SimpleNamespace:
    """Cells of a range or of a list; sides of a list."""
    is_range = record.kind == "range"
    fields = {"cell_begin": wp.int32, "cell_end": wp.int32}
    if not is_range:
        fields = {"cells": Ints, "partition_cells": Ints}
    name = "RangeCellArg" if is_range else "ListedCellArg"
    CellArg = extend.struct_from_fields(name, fields, module=__name__)
    fields = {"cell_arg": CellArg, "sides": Ints, "boundary_sides": Ints, "frontier_sides": Ints}
    SideArg = extend.struct_from_fields(f"{name}OfSides", fields, module=__name__)
    made = Functions(CellArg=CellArg, SideArg=SideArg)
    if is_range:

        @made.add
        def cell_index(arg: CellArg, index: int):
            return arg.cell_begin + index

        @made.add
        def partition_cell_index(arg: CellArg, cell: int):
            inside = cell >= arg.cell_begin and cell < arg.cell_end
            return wp.where(inside, cell - arg.cell_begin, -1)

    else:

        @made.add
        def cell_index(arg: CellArg, index: int):
            return arg.cells[index]

        @made.add
        def partition_cell_index(arg: CellArg, cell: int):
            if cell < 0:
                return -1
            return arg.partition_cells[cell]

    @made.add
    def side_index(arg: SideArg, index: int):
        return arg.sides[index]

    @made.add
    def boundary_side_index(arg: SideArg, index: int):
        return arg.boundary_sides[index]

    @made.add
    def frontier_side_index(arg: SideArg, index: int):
        return arg.frontier_sides[index]

    @made.add
    def side_to_cell_arg(arg: SideArg):
        return arg.cell_arg

    return made


_ActiveCellArg = extend.struct_from_fields("ActiveCellArg", {"grid": wp.uint64}, module=__name__)


@wp.func
def _active_cell(arg: _ActiveCellArg, cell: int):
    """The cell itself, -1 beyond the voxels in use of a rebuildable grid."""
    return wp.where(cell < wp.volume_voxel_count(arg.grid), cell, -1)


def _active(record: PartitionRecord) -> SimpleNamespace:
    made = _whole(record)
    SideArg = made.SideArg

    @made.add
    def side_to_cell_arg(arg: SideArg):
        return _ActiveCellArg(arg.cell_arg.grid)

    made.CellArg = _ActiveCellArg
    made.cell_index = made.partition_cell_index = _active_cell
    return made


_MAKERS = {"whole": _whole, "active": _active, "range": _listed, "list": _listed}


@functools.cache
def _side_kernel(record: PartitionRecord) -> wp.Kernel:
    """Kernel that marks the sides of a partition: its own, of the boundary, of the frontier."""
    geometry, partition = record.geometry.functions, record.functions
    SideArg, CellArg = geometry.SideArg, partition.CellArg
    inner_of, outer_of = geometry.side_inner_cell_index, geometry.side_outer_cell_index
    partition_index = partition.partition_cell_index

    @wp.kernel(enable_backward=False)
    def mark_sides(geo: SideArg, cells: CellArg, own: Ints, boundary: Ints, frontier: Ints):
        side = wp.tid()
        inner = inner_of(geo, side)
        outer = outer_of(geo, side)
        has_inner = partition_index(cells, inner) >= 0
        has_outer = partition_index(cells, outer) >= 0
        own[side] = wp.where(has_inner, 1, 0)
        boundary[side] = wp.where(has_inner and inner == outer, 1, 0)
        frontier[side] = wp.where(has_inner != has_outer, 1, 0)

    return mark_sides


class GeometryPartition(ElementArguments):
    """A subset of the cells of a geometry, with the sides that belong to it."""

    record: PartitionRecord

    def __init__(self, geometry):
        self.geometry = geometry

    @property
    def name(self) -> str:
        """Geometry and kind in one word."""
        return f"{self.geometry.name}_{type(self).__name__}"


class WholeGeometryPartition(GeometryPartition):
    """All cells and sides of a geometry."""

    def __init__(self, geometry):
        super().__init__(geometry)
        # Rebuildable grids have more room than cells.
        self._grid = getattr(geometry, "cell_grid", None) if geometry.is_rebuildable else None
        self.record = PartitionRecord("active" if self._grid else "whole", geometry.record)

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

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        if self._grid:
            arg.grid = self._grid.id

    def side_arg_value(self, device=None):
        """Argument of the functions of sides."""
        return self.geometry.side_index_arg_value(device)

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.geometry.fill_side_index_arg(arg, device)


class CellBasedGeometryPartition(GeometryPartition):
    """Some cells. Sides belong to the partition of their inner cell; those between two partitions
    are the frontier of both."""

    _sides = _boundary_sides = _frontier_sides = None

    def side_count(self) -> int:
        """Number of sides."""
        return self._sides.shape[0]

    def boundary_side_count(self) -> int:
        """Number of sides of the geometry's boundary."""
        return self._boundary_sides.shape[0]

    def frontier_side_count(self) -> int:
        """Number of sides between this and other partitions."""
        return self._frontier_sides.shape[0]

    def fill_side_arg(self, arg, device) -> None:
        """Fills an argument of the functions of sides."""
        self.fill_cell_arg(arg.cell_arg, device)
        arg.sides = self._sides.to(device)
        arg.boundary_sides = self._boundary_sides.to(device)
        arg.frontier_sides = self._frontier_sides.to(device)

    def _find_sides(self, device, max_count: int = -1) -> None:
        """Lists the sides; without reading a count from the device if there is a maximum."""
        forget(self)
        n = 0 if max_count == 0 else self.geometry.side_count()
        with extend.unrecorded():
            masks = [wp.empty(n, dtype=wp.int32, device=device) for _ in range(3)]
            if n:
                inputs = [self.geometry.side_arg_value(device), self.cell_arg_value(device)]
                wp.launch(_side_kernel(self.record), n, inputs, masks, device=device)
        lists = (self._sides, self._boundary_sides, self._frontier_sides)
        self._sides, self._boundary_sides, self._frontier_sides = (
            masked_indices(mask, max_count, kept)[0] for mask, kept in zip(masks, lists)
        )
        forget(self, "side_arg_value")


class LinearGeometryPartition(CellBasedGeometryPartition):
    """A range of cells: the `partition_rank`-th of `partition_count` of equal size.

    Args:
        geometry: the geometry.
        partition_rank: number of the range.
        partition_count: number of ranges.
        device: device of the lists of sides.
        temporary_store: ignored.

    Raises:
        ValueError: a rank out of range.
    """

    def __init__(
        self, geometry, partition_rank: int, partition_count: int, device=None, temporary_store=None
    ):
        super().__init__(geometry)
        if not 0 <= partition_rank < partition_count:
            raise ValueError(
                f"'partition_rank' expects 0 to {partition_count - 1}, but got {partition_rank}"
            )
        self.record = PartitionRecord("range", geometry.record)
        total = geometry.cell_count()
        size = -(-total // partition_count)
        self.cell_begin = min(size * partition_rank, total)
        self.cell_end = min(self.cell_begin + size, total)
        self._find_sides(wp.get_device(device))

    def cell_count(self) -> int:
        """Number of cells."""
        return self.cell_end - self.cell_begin

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.cell_begin, arg.cell_end = self.cell_begin, self.cell_end


class ExplicitGeometryPartition(CellBasedGeometryPartition):
    """Cells by a mask.

    Args:
        geometry: the geometry.
        cell_mask: (cells,) of int32, 1 for the cells of the partition.
        max_cell_count, max_side_count: sizes of the lists, so that nothing is read from the
            device; places that are left over name no element, -1.
        temporary_store: ignored.

    Raises:
        ValueError: the mask's size or type does not fit.
    """

    def __init__(
        self, geometry, cell_mask, max_cell_count=-1, max_side_count=-1, temporary_store=None
    ):
        super().__init__(geometry)
        self.record = PartitionRecord("list", geometry.record)
        self._cells = self._partition_cells = None
        self._max_cell_count, self._max_side_count = max_cell_count, max_side_count
        self.rebuild(cell_mask)

    def rebuild(self, cell_mask, temporary_store=None) -> None:
        """Takes the cells of another mask."""
        n = self.geometry.cell_count()
        if cell_mask.shape != (n,) or cell_mask.dtype is not wp.int32:
            raise ValueError(
                f"'cell_mask' expects an array ({n},) of int32, one per cell, but got "
                f"{extend.type_repr(cell_mask.dtype)} of shape {cell_mask.shape}"
            )
        self._cells, self._partition_cells = masked_indices(
            cell_mask, self._max_cell_count, self._cells, self._partition_cells
        )
        self._find_sides(cell_mask.device, self._max_side_count)

    def cell_count(self) -> int:
        """Number of cells."""
        return self._cells.shape[0]

    def fill_cell_arg(self, arg, device) -> None:
        """Fills an argument of the functions of cells."""
        arg.cells = self._cells.to(device)
        arg.partition_cells = self._partition_cells.to(device)
