"""Topologies with tables - nodes by entity of grids, meshes and sparse grids."""

from __future__ import annotations

import itertools

import numpy as np

import warp as wp
from warp import extend
from warp._src.fem.cells.element import Element
from warp._src.fem.spaces import numbering
from warp._src.fem.spaces.topologies import SpaceTopology, TopologyRecord


class Tables:
    """Numbers of the nodes of each cell on a device.

    Attributes:
        nodes: int32 (cells, n). signs: int8 (cells, n), or None. orientations: int32 (cells,), or
            None.
        source: what the numbers follow from; another object if the geometry was rebuilt.
    """

    def __init__(self, nodes, signs=None, orientations=None, source=None):
        self.nodes, self.signs, self.orientations = nodes, signs, orientations
        self.source = source


class NumberedTopology(SpaceTopology):
    """Nodes in a table that is made when it is needed, and again if the geometry was rebuilt."""

    _count: int | None = None

    def _source(self, device):
        """The arrays that the numbers follow from."""
        raise NotImplementedError

    def _number(self, source, device, old: Tables | None) -> tuple[Tables, int]:
        """Tables, in the arrays of old ones where they fit, and the number of nodes."""
        raise NotImplementedError

    def tables(self, device=None) -> Tables:
        """Numbers of the nodes of each cell."""
        device = wp.get_device(device)
        kept = self.__dict__.setdefault("_tables", {})
        old, source = kept.get(device.alias), self._source(device)
        if old is None or old.source is not source:
            with extend.unrecorded():
                kept[device.alias], self._count = self._number(source, device, old)
            kept[device.alias].source = source
            if old is not None:
                self.__dict__.pop("_per_device", None)
                self.revision += 1
        return kept[device.alias]

    def node_count(self) -> int:
        """Number of nodes; of a rebuildable sparse grid the room for them."""
        if self._count is None:
            self.tables()
        return self._count

    def rebuild(self) -> None:
        """Numbers the nodes anew for a geometry that was rebuilt."""
        for device in self.__dict__.get("_tables", {}):
            self.tables(device)

    def topo_arg_value(self, device=None):
        """Argument of the functions of kernels."""
        self.tables(device)
        return super().topo_arg_value(device)

    def element_table(self, device=None):
        """Node numbers of each cell, int32 (cells, n)."""
        return self.tables(device).nodes

    def fill_topo_arg(self, arg, device) -> None:
        """Fills an argument of the functions of kernels."""
        tables = self.tables(device)
        arg.nodes = tables.nodes
        if self.record.is_signed:
            arg.signs = tables.signs
        if self.record.is_oriented:
            arg.orientations = tables.orientations


class TableTopology(NumberedTopology):
    """Nodes by entity."""

    def __init__(self, geometry, element: Element):
        layout, kind = element.layout, geometry.base.record.kind
        signs = {s for _, of in (*layout.edge_turns, *layout.face_turns) for s in of}
        is_signed = -1 in signs or len(layout.side_signs) > 0
        record = TopologyRecord(
            "table",
            geometry.record,
            element.node_count,
            # Entities of all grids have one direction for all their cells.
            is_signed=is_signed and kind == "mesh",
            is_oriented=element.orientation_count > 1,
        )
        super().__init__(geometry, record, element)

    def _source(self, device):
        return self.geometry.base.entities(device)

    def _number(self, source, device, old):
        base, element = self.geometry.base, self.element
        cells, environments = base.cell_count(), 1
        if source is None:
            environments = base.environment_count()
            cells //= environments
            entities = numbering.grid_entities([int(n) for n in base.res], device)
        else:
            room = cells if base.is_rebuildable else 0
            entities = numbering.mesh_entities(source, element, room)
        out = None if old is None else (old.nodes, old.signs)
        nodes, signs, count = numbering.number_nodes(element, entities, cells, device, out)
        if environments > 1:
            local = nodes.numpy()
            moved = np.concatenate([local + env * count for env in range(environments)])
            nodes = wp.array(moved, dtype=wp.int32, device=device)
        orientations = None
        if self.record.is_oriented:
            from warp._src.fem.spaces.tables import cell_orientations

            orientations = cell_orientations(base, device)
        return Tables(nodes, signs, orientations), count * environments


def cell_orientations(base, device):
    """For each cell of a mesh of simplices the place of the ranks of its vertices among all
    permutations in lexicographic order, int32 (cells,)."""
    cells = base.entities(device).cells.numpy()
    ranks = np.argsort(np.argsort(cells, axis=1), axis=1)
    size = cells.shape[1]
    codes = ranks @ size ** np.arange(size)
    orders = np.array(list(itertools.permutations(range(size))))
    places = np.zeros(size**size, np.int32)
    places[orders @ size ** np.arange(size)] = np.arange(len(orders), dtype=np.int32)
    return wp.array(places[codes], dtype=wp.int32, device=device)


class SparseSplineTopology(NumberedTopology):
    """Nodes of B-splines on a sparse grid of one level: its vertices and the ones around them."""

    def __init__(self, geometry, element: Element):
        if geometry.base.record.kind != "nanogrid":
            raise ValueError(f"B-splines need cells of one size, but got {geometry.name!r}")
        record = TopologyRecord("table", geometry.record, element.node_count)
        super().__init__(geometry, record, element)
        self._node_grid = None

    def _source(self, device):
        return self.geometry.base.entities(device)

    def _number(self, source, device, old):
        from warp._src.fem.geometry.sparse_build import node_numbers, node_places

        base, width = self.geometry.base, 2 * (self.element.degree // 2) + 2
        places, mask = node_places(
            base.cell_grid, base._packed, base._levels, width, self.element.degree // 2
        )
        if base.is_rebuildable and self._node_grid is not None:
            self._node_grid.rebuild(places, point_mask=mask)
        else:
            self._node_grid = base._make_node_grid(places, mask, width**3)
        nodes = node_numbers(self._node_grid, places, width**3, old and old.nodes)
        return Tables(nodes), self._node_grid.get_voxel_count()
