"""Domains - sets of elements over which forms are integrated: cells, sides, selections."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.geometry.base import RecordFunctions, per_device
from warp._src.fem.geometry.partition import (
    GeometryPartition,
    PartitionRecord,
    WholeGeometryPartition,
)
from warp._src.fem.kept import Functions, Record
from warp._src.fem.types import ElementKind, Ints

# Words of numbers and counts of elements by kind of domain.
_WORDS = {"cells": "cell", "sides": "side"}
_WORDS |= {"boundary": "boundary_side", "frontier": "frontier_side"}


@dataclass(frozen=True)
class DomainRecord(Record):
    """Facts of a domain that its functions of kernels depend on.

    `kind` is cells, sides, boundary or frontier; `is_subset` says that a table selects elements.
    """

    kind: str
    partition: PartitionRecord
    is_subset: bool = False

    @property
    def geometry(self):
        """Record of the geometry."""
        return self.partition.geometry

    @property
    def is_cells(self) -> bool:
        """Elements are cells."""
        return self.kind == "cells"

    @property
    def cells(self) -> "DomainRecord":
        """Record of the cells of the same partition."""
        return DomainRecord("cells", self.partition)

    @property
    def has_gaps(self) -> bool:
        """Numbers of elements may be -1: lists of a fixed size, and rebuildable grids."""
        return self.partition.kind in ("list", "active")

    def make_functions(self) -> SimpleNamespace:
        """Makes the structs and functions of kernels of a domain.

        They have one set of names for cells and for sides: `element_position`, and `position`.
        """
        return _domain_functions(self)


def _domain_functions(record: DomainRecord) -> SimpleNamespace:
    geometry = record.geometry.functions
    partition = record.partition.functions
    f = Functions()
    kind = "cell_" if record.is_cells else "side_"
    for name, of in vars(geometry).items():
        if name.startswith(kind):
            setattr(f, name.replace(kind, "element_", 1), of)
            setattr(f, name.removeprefix(kind), of)
    if not record.is_cells:
        f.cell_to_element_coords = geometry.side_from_cell_coords
    f.ElementArg = geometry.CellArg if record.is_cells else geometry.SideArg
    f.ElementIndexArg = partition.CellArg if record.is_cells else partition.SideArg
    f.element_index = getattr(partition, f"{_WORDS[record.kind]}_index")
    f.element_partition_index = partition.partition_cell_index
    if record.is_subset:
        _select(f)
    fields = {"geo": f.ElementArg, "index": f.ElementIndexArg}
    f.DomainArg = extend.struct_from_fields("DomainArg", fields, module=__name__)
    _add_cells(f, record, geometry, partition)
    return f


def _select(f: SimpleNamespace) -> None:
    """Makes the numbers of elements those of a table of selected ones."""
    Whole, whole_index, whole_partition_index = (
        *(f.ElementIndexArg, f.element_index, f.element_partition_index),
    )
    fields = {"domain_arg": Whole, "element_indices": Ints}
    IndexArg = extend.struct_from_fields("SubdomainIndexArg", fields, module=__name__)

    @f.add
    def element_index(arg: IndexArg, index: int):
        return whole_index(arg.domain_arg, arg.element_indices[index])

    @f.add
    def element_partition_index(arg: IndexArg, element: int):
        return whole_partition_index(arg.domain_arg, element)

    f.ElementIndexArg = IndexArg


def _add_cells(f, record, geometry, partition) -> None:
    """Adds the way from a domain to that of its cells, and the look-up in a partition."""
    DomainArg = f.DomainArg
    if record.is_cells:

        @f.add
        def domain_cell_arg(arg: DomainArg):
            return arg

    else:
        cells = record.cells.functions
        CellsArg, to_cell, index_to_cell = (
            *(cells.DomainArg, geometry.side_to_cell_arg, partition.side_to_cell_arg),
        )
        is_subset = record.is_subset

        @f.add
        def domain_cell_arg(arg: DomainArg):
            if wp.static(is_subset):
                return CellsArg(to_cell(arg.geo), index_to_cell(arg.index.domain_arg))
            else:
                return CellsArg(to_cell(arg.geo), index_to_cell(arg.index))

    if record.is_cells and hasattr(geometry, "make_filtered_cell_lookup"):
        from warp._src.fem.geometry.lookup_forms import add_partition_lookup

        add_partition_lookup(f, record, geometry)


class GeometryDomain(RecordFunctions):
    """Base of domains: elements of a geometry or of a partition of one."""

    kind = ""

    def __init__(self, geometry):
        whole = not isinstance(geometry, GeometryPartition)
        self.geometry_partition = WholeGeometryPartition(geometry) if whole else geometry
        self.geometry = self.geometry_partition.geometry

    @property
    def record(self) -> DomainRecord:
        """Facts that functions of kernels depend on."""
        return DomainRecord(self.kind, self.geometry_partition.record)

    def __getattr__(self, name):
        if name in ("element_lookup", "element_partition_lookup"):
            return getattr(self.functions, name, None)
        return super().__getattr__(name)

    def __eq__(self, other) -> bool:
        same = type(self) is type(other)
        return same and self.geometry_partition == other.geometry_partition

    def __hash__(self) -> int:
        return hash((type(self), self.geometry_partition))

    @property
    def name(self) -> str:
        """Partition and kind in one word."""
        return f"{self.geometry_partition.name}_{type(self).__name__}"

    @property
    def is_cells(self) -> bool:
        """Elements are cells."""
        return self.kind == "cells"

    @property
    def is_whole(self) -> bool:
        """Elements are all cells or sides, in their order, of a geometry that is not rebuilt."""
        is_all = isinstance(self.geometry_partition, WholeGeometryPartition)
        return is_all and not isinstance(self, Subdomain) and not self.geometry.base.is_rebuildable

    @property
    def element_kind(self) -> ElementKind:
        """Cells or sides."""
        return ElementKind.CELL if self.is_cells else ElementKind.SIDE

    @property
    def cell(self):
        """Reference cell of the elements."""
        return self.geometry.cell if self.is_cells else self.geometry.side_cell

    def reference_element(self):
        """Reference cell of the elements."""
        return self.cell

    @property
    def dimension(self) -> int:
        """Dimension of the elements."""
        return self.geometry.dimension - (0 if self.is_cells else 1)

    def element_count(self) -> int:
        """Number of elements."""
        return getattr(self.geometry_partition, f"{_WORDS[self.kind]}_count")()

    def geometry_element_count(self) -> int:
        """Number of such elements in the geometry; a whole geometry has no frontier."""
        if self.kind == "frontier":
            raise RuntimeError("frontier sides are those of a partition, the geometry has none")
        return getattr(self.geometry, f"{_WORDS[self.kind]}_count")()

    @property
    def _word(self) -> str:
        return "cell" if self.is_cells else "side"

    def element_arg_value(self, device=None):
        """Argument of the functions of elements."""
        return getattr(self.geometry, f"{self._word}_arg_value")(device)

    def fill_element_arg(self, arg, device) -> None:
        """Fills an argument of the functions of elements."""
        getattr(self.geometry, f"fill_{self._word}_arg")(arg, device)

    def element_index_arg_value(self, device=None):
        """Argument of `element_index`."""
        return getattr(self.geometry_partition, f"{self._word}_arg_value")(device)

    def fill_element_index_arg(self, arg, device) -> None:
        """Fills an argument of `element_index`."""
        getattr(self.geometry_partition, f"fill_{self._word}_arg")(arg, device)

    def domain_arg_value(self, device=None):
        """Both arguments in one."""
        arg = self.DomainArg()
        self.fill_element_arg(arg.geo, device)
        self.fill_element_index_arg(arg.index, device)
        return arg

    def supports_lookup(self, device=None) -> bool:
        """`lookup` works on a device."""
        return self.is_cells and self.geometry.supports_cell_lookup(device)

    def cell_domain(self) -> "GeometryDomain":
        """The domain of the cells."""
        return Cells(self.geometry_partition)

    def side_domain(self) -> "GeometryDomain":
        """The domain of all sides."""
        return Sides(self.geometry_partition)


class Cells(GeometryDomain):
    """All cells of a geometry or of a partition."""

    kind = "cells"

    def cell_domain(self) -> "GeometryDomain":
        """The domain itself."""
        return self


class Sides(GeometryDomain):
    """All sides, of the interior and of the boundary."""

    kind = "sides"


class BoundarySides(Sides):
    """Sides with one cell."""

    kind = "boundary"


class FrontierSides(Sides):
    """Sides between a partition and others."""

    kind = "frontier"


def _check_indices(indices, count) -> None:
    """Raises unless an array has numbers of elements."""
    if not isinstance(indices, wp.array) or indices.dtype is not wp.int32 or indices.ndim != 1:
        raise ValueError(
            f"'element_indices' expects an array (n,) of int32, but got {extend.shown(indices)}"
        )
    if indices.device.is_capturing:
        return
    numbers = indices.numpy()
    wrong = np.flatnonzero((numbers < 0) | (numbers >= count))
    if wrong.size:
        raise ValueError(
            f"'element_indices' expects numbers in [0, {count}), but got {numbers[wrong[0]]} at "
            f"index {wrong[0]}"
        )


class Subdomain(GeometryDomain):
    """Selected elements of a domain.

    Args:
        domain: the domain to select from.
        element_mask: array (domain.element_count(),) of int32, 1 for elements to take.
        element_indices: in place of a mask: int32, the numbers in `domain` of the elements. They
            are read once, except in a capture.

    Raises:
        ValueError: both or none are given, a size that does not fit, or a number of no element.
    """

    def __init__(self, domain, element_mask=None, element_indices=None, temporary_store=None):
        super().__init__(domain.geometry_partition)
        if (element_mask is None) == (element_indices is None):
            raise ValueError("expects one of 'element_mask' and 'element_indices'")
        if isinstance(domain, Subdomain):
            raise ValueError("'domain' expects a whole domain, but got a 'Subdomain'")
        if element_indices is None:
            from warp._src.fem.geometry.indices import masked_indices

            count = domain.element_count()
            is_mask = extend.is_array(element_mask) and element_mask.dtype is wp.int32
            if not is_mask or element_mask.shape != (count,):
                got = extend.shown(element_mask)
                if extend.is_array(element_mask):
                    got = f"{element_mask.shape} of {extend.type_repr(element_mask.dtype)}"
                raise ValueError(f"'element_mask' expects shape ({count},) of int32, but got {got}")
            element_indices, _ = masked_indices(element_mask)
        else:
            _check_indices(element_indices, domain.element_count())
        self._domain, self._element_indices = domain, element_indices
        self.kind = domain.kind

    @property
    def record(self) -> DomainRecord:
        """Facts that functions of kernels depend on."""
        return DomainRecord(self.kind, self.geometry_partition.record, True)

    @property
    def name(self) -> str:
        """The domain's name and the class."""
        return f"{self._domain.name}_Subdomain"

    def __eq__(self, other) -> bool:
        return (
            type(self) is type(other)
            and self._domain == other._domain
            and self._element_indices is other._element_indices
        )

    def __hash__(self) -> int:
        return hash((self._domain, id(self._element_indices)))

    def element_count(self) -> int:
        """Number of elements."""
        return self._element_indices.shape[0]

    @per_device
    def element_index_arg_value(self, device):
        """Argument of `element_index`."""
        arg = self.ElementIndexArg()
        self.fill_element_index_arg(arg, device)
        return arg

    def fill_element_index_arg(self, arg, device) -> None:
        """Fills an argument of `element_index`."""
        self._domain.fill_element_index_arg(arg.domain_arg, device)
        arg.element_indices = self._element_indices.to(device)

    def cell_domain(self) -> "GeometryDomain":
        """The domain of the cells."""
        return self._domain.cell_domain()
