"""Public names of geometry in kernels, and which function advances a query of a loop."""

from __future__ import annotations

from warp._src.geometry import (
    grid_queries,
    mesh_queries,
    mesh_signs,
    proximity,
    tile_queries,
    tree_queries,
)
from warp._src.geometry.handles import BVH, GRID, MESH
from warp._src.types import dtypes

FUNCTIONS = {
    **grid_queries.FUNCTIONS,
    **tree_queries.FUNCTIONS,
    **mesh_queries.FUNCTIONS,
    **mesh_signs.FUNCTIONS,
    **tile_queries.FUNCTIONS,
}
for _name, _function in FUNCTIONS.items():
    _function.__module__ = "warp"
    if not _name.endswith(("_next", "_next_tiled", "_valid")):
        _kind = _name.removeprefix("tile_").partition("_")[0]
        _function.handle = {"hash": GRID, "bvh": BVH, "mesh": MESH}[_kind]
FUNCTIONS.update(proximity.FUNCTIONS)
TYPES = {
    "BvhQuery": tree_queries.BvhQuery,
    "BvhQueryTiled": tile_queries.BvhQueryTiled,
    "HashGridQuery": grid_queries.HashGridQuery,
    "MeshQuery": tree_queries.MeshQuery,
    "MeshQueryAABB": tree_queries.MeshQuery,
    "MeshQueryAABBTiled": tile_queries.MeshQueryAABBTiled,
    "MeshQueryPoint": mesh_queries.MeshQueryPoint,
    "MeshQueryRay": mesh_queries.MeshQueryRay,
}
_NEXT = (
    (dtypes.native_type(grid_queries.HashGridQuery), grid_queries.ADVANCE),
    (dtypes.native_type(grid_queries.HashGridGroupQuery), grid_queries.ADVANCE_GROUP),
    (dtypes.native_type(tree_queries.BvhQuery), tree_queries.ADVANCE_BVH),
    (dtypes.native_type(tree_queries.MeshQuery), tree_queries.ADVANCE_MESH),
)


def next_of(native):
    """The function that gives (found, index, query) for a query of a compiler's type, or None."""
    return next((function for kind, function in _NEXT if kind == native), None)
