"""B-splines on sparse grids - nodes around each cell, numbered by a volume of their own."""

from __future__ import annotations

from warp._src.fem.cells.element import Element
from warp._src.fem.spaces.tables import NumberedTopology, Tables
from warp._src.fem.spaces.topologies import TopologyRecord


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
