"""B-splines on sparse grids - nodes around each cell, numbered by a volume of their own."""

from __future__ import annotations

import warp as wp
from warp._src.fem.cells.element import Element
from warp._src.fem.spaces.tables import NumberedTopology, Tables
from warp._src.fem.spaces.topologies import TopologyRecord
from warp._src.fem.types import IntTable, Voxels


@wp.kernel(enable_backward=False)
def _write_places(
    grid: wp.uint64, corners: Voxels, width: int, places: wp.array2d(dtype=wp.vec3i), mask: IntTable
):
    cell, k = wp.tid()
    pad = width // 2 - 1
    offset = wp.vec3i(k // (width * width), (k // width) % width, k % width)
    places[cell, k] = corners[8 * cell] + offset - wp.vec3i(pad, pad, pad)
    mask[cell, k] = wp.where(cell < wp.volume_voxel_count(grid), 1, 0)


@wp.kernel(enable_backward=False)
def _find_nodes(grid: wp.uint64, places: wp.array2d(dtype=wp.vec3i), nodes: IntTable):
    cell, k = wp.tid()
    p = places[cell, k]
    nodes[cell, k] = wp.max(wp.volume_lookup_index(grid, p[0], p[1], p[2]), 0)


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
        base, width = self.geometry.base, 2 * (self.element.degree // 2) + 2
        shape = (base.cell_count(), width**3)
        places = wp.empty(shape, dtype=wp.vec3i, device=device)
        mask = wp.empty(shape, dtype=wp.int32, device=device)
        inputs = [base.cell_grid.id, base._corners, width, places, mask]
        wp.launch(_write_places, shape, inputs, device=device)
        flat = (places.flatten(), mask.flatten())
        if base.is_rebuildable and self._node_grid is not None:
            self._node_grid.rebuild(flat[0], point_mask=flat[1])
        else:
            self._node_grid = base._make_node_grid(*flat, shape[1])
        nodes = wp.empty(shape, dtype=wp.int32, device=device) if old is None else old.nodes
        wp.launch(_find_nodes, shape, [self._node_grid.id, places, nodes], device=device)
        return Tables(nodes), self._node_grid.get_voxel_count()
