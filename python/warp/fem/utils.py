"""Meshes of dense grids."""

from warp._src.fem.grids import grid_to_hexes as grid_to_hexes
from warp._src.fem.grids import grid_to_quads as grid_to_quads
from warp._src.fem.grids import grid_to_tets as grid_to_tets
from warp._src.fem.grids import grid_to_tris as grid_to_tris
